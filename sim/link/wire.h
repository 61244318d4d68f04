/* Encoding of link payloads: a table per message type defines position, unit and range of each
 * struct member. Encoding, decoding, checks and the interface control document
 * (docs/reference/icd.md) use these tables.
 *
 * A payload is one record, then `count` items. Members are packed in the order of the table,
 * little-endian, without gaps; records and items are zero-padded to a multiple of 8 bytes. */
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
    BST_WIRE_TEXT, /* `count` bytes of ASCII, zero-padded, with at least one zero */
} bst_wire_type;

typedef enum bst_wire_check {
    BST_WIRE_ANY,          /* any bits, including NaN */
    BST_WIRE_FINITE,       /* neither NaN nor infinite */
    BST_WIRE_RANGE,        /* minimum <= value <= maximum */
    BST_WIRE_UNIT,         /* F64: the squares of the `count` numbers sum to 1 within 1e-6 */
    BST_WIRE_UNIT_OR_ZERO, /* as BST_WIRE_UNIT, or all 0: unknown */
    BST_WIRE_COUNT,        /* I32: number of items; it determines the length of the payload */
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

/* Allowed senders of a message. */
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
    BST_LINK_TRACK_IDENTITIES,
    BST_LINK_TRACKS_SMOOTHED,
    BST_LINK_LOS_COMMAND,
    BST_LINK_SENSOR_COMMAND,
    BST_LINK_CONTROL_STATUS,
    BST_LINK_POINTING,
    BST_LINK_TARGET_STATES,
    BST_LINK_TARGET_ATTITUDES,
    BST_LINK_TYPES
} bst_link_type;

typedef struct bst_wire_message {
    const char *name; /* the header's "type" */
    unsigned from;
    bool pixels; /* a second part follows: uint16 pixels, rows from y = 0, x along a row */
    const bst_wire_field *record;
    const bst_wire_field *items;     /* NULL: none */
    size_t header_bytes, item_bytes; /* of the struct: offset of its items, size of an item */
    int max_items;
    const char *doc;
} bst_wire_message;

/* Field table of a message type. */
const bst_wire_message *bst_wire_message_of(bst_link_type type);
/* Type of a message by its name; BST_LINK_TYPES if there is none. */
bst_link_type bst_wire_type_of(const char *name);

/* Bytes on the wire of one record of a table. */
size_t bst_wire_bytes(const bst_wire_field *table);
/* Bytes on the wire of a payload with that many items. */
size_t bst_wire_payload_bytes(const bst_wire_message *message, int items);
/* Offset of a field in its record on the wire. */
size_t bst_wire_offset(const bst_wire_field *table, const bst_wire_field *field);
/* Bytes on the wire of one number of a type (of a text: one character). */
size_t bst_wire_number_bytes(bst_wire_type type);
/* Number of items in a struct, from its count field; 0 for messages without items. */
int bst_wire_items(const bst_wire_message *message, const void *payload);
/* Sets the number of items in a struct; nothing for messages without items. */
void bst_wire_set_items(const bst_wire_message *message, void *payload, int items);

/* Encodes a struct of a message type; `out` has room for bst_wire_payload_bytes of its items.
 * Returns the bytes written. */
size_t bst_wire_encode(const bst_wire_message *message, const void *payload, uint8_t *out);

/* Faults of received bytes; each has its own counter. */
typedef enum bst_wire_fault {
    BST_WIRE_GOOD,
    BST_WIRE_BAD_HEADER,
    BST_WIRE_BAD_VERSION,
    BST_WIRE_BAD_LENGTH,
    BST_WIRE_BAD_CRC,
    BST_WIRE_BAD_VALUE,
    BST_WIRE_UNEXPECTED, /* unknown type, or not for this receiver */
    BST_WIRE_FAULTS
} bst_wire_fault;
/* Name of a fault ("bad_crc"), used in counters, `error` messages and the interface control
 * document. */
const char *bst_wire_fault_name(bst_wire_fault fault);

/* Decodes a payload into a struct with room for `capacity` items. Every number is checked before
 * use. At most `capacity` items are stored; *dropped (may be NULL) counts the others, which are
 * checked too. After a fault the struct is undefined, and ctx has the reason. */
bst_wire_fault bst_wire_decode(bst_ctx *ctx, const bst_wire_message *message, const uint8_t *data,
                               size_t bytes, void *payload, int capacity,
                               int *dropped) BST_MUST_CHECK;

/* Checks every number of a struct with room for `capacity` items, by the rules for a peer's
 * messages. BST_ERR_FORMAT with the field, its value and what is allowed. */
bst_status bst_wire_check_struct(bst_ctx *ctx, const bst_wire_message *message, const void *payload,
                                 int capacity) BST_MUST_CHECK;

#endif
