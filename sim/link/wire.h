/* The payloads of the link as bytes: one table for each type of message says which member of its
 * struct lies where, in which unit, and what it may be. Encoding, decoding, the checks and the
 * interface control document (docs/icd.md) all follow from these tables.
 *
 * A payload is one record, then `count` items. Members are packed in the order of the table,
 * little-endian, without gaps; a record and an item are filled up with zeros to a multiple of 8
 * bytes. */
#ifndef BST_LINK_WIRE_H
#define BST_LINK_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

typedef enum bst_wire_type {
    BST_WIRE_I32,
    BST_WIRE_U32,
    BST_WIRE_I64,
    BST_WIRE_F64,
    BST_WIRE_BOOL, /* C bool; on the wire an int32 that is 0 or 1 */
    BST_WIRE_TEXT, /* `count` bytes of ASCII, filled up with zeros, at least one of them */
} bst_wire_type;

typedef enum bst_wire_check {
    BST_WIRE_ANY,          /* any bits, NaN among them */
    BST_WIRE_FINITE,       /* neither NaN nor infinite */
    BST_WIRE_RANGE,        /* minimum <= value <= maximum */
    BST_WIRE_UNIT,         /* F64: the squares of the `count` numbers sum to 1 within 1e-6 */
    BST_WIRE_UNIT_OR_ZERO, /* the same, or all 0: not known */
    BST_WIRE_COUNT,        /* I32: number of items; the payload is as long as they take */
} bst_wire_check;

typedef struct bst_wire_field {
    const char *name; /* NULL ends a table */
    bst_wire_type type;
    int count; /* numbers, or bytes of a text */
    bst_wire_check check;
    double minimum, maximum; /* BST_WIRE_RANGE */
    size_t offset;           /* in the struct */
    const char *unit, *doc;
} bst_wire_field;

/* Who may send a message. */
enum { BST_WIRE_FROM_SIM = 1u << 0, BST_WIRE_FROM_PEER = 1u << 1 };

typedef enum bst_link_type {
    BST_LINK_HELLO,
    BST_LINK_WELCOME,
    BST_LINK_STEP,
    BST_LINK_DONE,
    BST_LINK_ERROR,
    BST_LINK_HEALTH,
    BST_LINK_END,
    BST_LINK_FRAME,
    BST_LINK_TRUTH,
    BST_LINK_POINTING_TELEMETRY,
    BST_LINK_NAV_TELEMETRY,
    BST_LINK_MOUNT_STATUS,
    BST_LINK_DETECTIONS,
    BST_LINK_PREDICTIONS,
    BST_LINK_TRACKS,
    BST_LINK_LOS_COMMAND,
    BST_LINK_SENSOR_COMMAND,
    BST_LINK_CONTROL_STATUS,
    BST_LINK_POINTING,
    BST_LINK_TARGET_STATES,
    BST_LINK_TYPES
} bst_link_type;

typedef struct bst_wire_message {
    const char *name; /* the header's "type" */
    unsigned from;
    bool pixels; /* a second part follows: uint16 pixels, rows from y = 0 on, x along a row */
    const bst_wire_field *record;
    const bst_wire_field *items;     /* NULL: none */
    size_t header_bytes, item_bytes; /* of the struct: where its items begin, and one of them */
    int max_items;
    const char *doc;
} bst_wire_message;

/* Table of a message type. */
const bst_wire_message *bst_wire_message_of(bst_link_type type);
/* Type of a message by its name; BST_LINK_TYPES if there is none. */
bst_link_type bst_wire_type_of(const char *name);

/* Bytes on the wire of one record of a table. */
size_t bst_wire_bytes(const bst_wire_field *table);
/* Of a payload with so many items. */
size_t bst_wire_payload_bytes(const bst_wire_message *message, int items);
/* Where a field begins in its record. */
size_t bst_wire_offset(const bst_wire_field *table, const bst_wire_field *field);
/* Bytes on the wire of one number of a type (of a text: one character). */
size_t bst_wire_number_bytes(bst_wire_type type);
/* The items that a struct holds, by its field that says so; 0 for messages without. */
int bst_wire_items(const bst_wire_message *message, const void *payload);

/* Writes a struct of the message's kind; `out` has room for bst_wire_payload_bytes of its items.
 * Returns the bytes written. */
size_t bst_wire_encode(const bst_wire_message *message, const void *payload, uint8_t *out);

/* What is wrong with bytes that are no message; each has a counter of its own. */
typedef enum bst_wire_fault {
    BST_WIRE_GOOD,
    BST_WIRE_BAD_HEADER,
    BST_WIRE_BAD_VERSION,
    BST_WIRE_BAD_LENGTH,
    BST_WIRE_BAD_CRC,
    BST_WIRE_BAD_VALUE,
    BST_WIRE_UNEXPECTED, /* a type that is unknown, or not for this side to receive */
    BST_WIRE_FAULTS
} bst_wire_fault;
/* "bad_crc" and so on: the word of counters, of `error` messages, and of the document. */
const char *bst_wire_fault_name(bst_wire_fault fault);

/* Reads a payload into a struct that has room for `capacity` items. Every number is checked before
 * anything is taken to be true; at most `capacity` items are stored, *dropped (may be NULL) are
 * those beyond, which are checked too. After a fault the struct holds nothing of meaning, and ctx
 * says why. */
bst_wire_fault bst_wire_decode(bst_ctx *ctx, const bst_wire_message *message, const uint8_t *data,
                               size_t bytes, void *payload, int capacity,
                               int *dropped) BST_MUST_CHECK;

#endif
