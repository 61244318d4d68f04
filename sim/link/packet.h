/* A message of the link as parts: a JSON header that says what it is, then its payload (wire.h),
 * and for frames the pixels. The header is one flat object of at most BST_LINK_HEADER_BYTES bytes
 * whose last member is "crc32c", a checksum of all bytes before that member:
 *
 *   {"version":3,"type":"done","tick":6000,"sequence":3,"step":2,"instance":"a/b/control",
 *    "lengths":[16],"crcs":["0a1b2c3d"],"crc32c":"8899aabb"} */
#ifndef BST_LINK_PACKET_H
#define BST_LINK_PACKET_H

#include "sim/link/wire.h"

enum {
    /* rises with every change to the layout or the meaning of a message or a header's member; a
       peer of another version is refused (test link_wire) */
    BST_LINK_VERSION = 3,
    BST_LINK_HEADER_BYTES = 1024, /* of a header, at most */
    BST_LINK_PARTS = 2,           /* after the header: the payload, the pixels */
    BST_LINK_INSTANCE_BYTES = 160,
};

typedef struct bst_link_header {
    bst_link_type type;
    int64_t tick;                           /* of the simulation, to which the message belongs */
    char utc[40];                           /* the same instant, for readers; "": not told */
    int64_t sequence;                       /* 0, 1, ... per sender and connection */
    int64_t step;                           /* of the part, 0, 1, ...; -1: belongs to none */
    char instance[BST_LINK_INSTANCE_BYTES]; /* "observer/sensor/module"; "": none */
    int parts;
    int64_t lengths[BST_LINK_PARTS]; /* bytes; of pixels in shared memory too */
    uint32_t crcs[BST_LINK_PARTS];   /* CRC-32C of the parts in the socket */
    int64_t slot; /* number of the message in shared memory that has the pixels; -1: they are a part
                   */
} bst_link_header;

/* Writes the header with its checksum; returns its bytes (no zero byte after them). */
size_t bst_link_header_write(const bst_link_header *header, char out[BST_LINK_HEADER_BYTES]);

/* Puts the ending with the right checksum at the end of a header's text of 20 bytes or more. */
void bst_link_header_seal(char *text, size_t bytes);

/* Reads one, whatever the bytes are. Members may come in any order, "crc32c" last; those that are
 * not known are passed over. */
bst_wire_fault bst_link_header_read(bst_ctx *ctx, const char *text, size_t bytes,
                                    bst_link_header *out) BST_MUST_CHECK;

/* Whether a part is what the header says: its length and checksum. */
bst_wire_fault bst_link_part_check(bst_ctx *ctx, const bst_link_header *header, int part,
                                   const void *data, size_t bytes) BST_MUST_CHECK;

#endif
