/* A link message consists of parts: a JSON header with type and lengths, the payload (wire.h), and
 * for frames the pixels. The header is one flat object of at most BST_LINK_HEADER_BYTES bytes
 * whose last member is "crc32c", a checksum of all bytes before that member:
 *
 *   {"version":3,"type":"done","tick":6000,"sequence":3,"step":2,"instance":"a/b/control",
 *    "lengths":[16],"crcs":["0a1b2c3d"],"crc32c":"8899aabb"} */
#ifndef BST_LINK_PACKET_H
#define BST_LINK_PACKET_H

#include "sim/link/wire.h"

enum {
    /* increases with every change of layout or meaning of a message or header member; a peer with
     * another version is rejected (test link_wire) */
    BST_LINK_VERSION = 9,
    BST_LINK_HEADER_BYTES = 1024, /* maximum size of a header */
    BST_LINK_PARTS = 2,           /* after the header: payload, pixels */
    BST_LINK_INSTANCE_BYTES = 160,
};

typedef struct bst_link_header {
    bst_link_type type;
    int64_t tick;                           /* simulation tick of the message */
    char utc[40];                           /* time of the tick, for readers; "": not given */
    int64_t sequence;                       /* 0, 1, ... per sender and connection */
    int64_t step;                           /* step of the part, 0, 1, ...; -1: none */
    char instance[BST_LINK_INSTANCE_BYTES]; /* "observer/sensor/module"; "": none */
    int parts;
    int64_t lengths[BST_LINK_PARTS]; /* bytes of the parts; also of pixels in shared memory */
    uint32_t crcs[BST_LINK_PARTS];   /* CRC-32C of the parts sent over the socket */
    int64_t slot; /* slot number of the pixels in shared memory; -1: they are a part */
} bst_link_header;

/* Writes a link header with its checksum; returns its length (no terminating zero). */
size_t bst_link_header_write(const bst_link_header *header, char out[BST_LINK_HEADER_BYTES]);

/* Writes the correct checksum at the end of a header text of 20 bytes or more. */
void bst_link_header_seal(char *text, size_t bytes);

/* Parses a link header from untrusted bytes. Members may have any order except "crc32c", the last;
 * unknown members are skipped. */
bst_wire_fault bst_link_header_read(bst_ctx *ctx, const char *text, size_t bytes,
                                    bst_link_header *out) BST_MUST_CHECK;

/* Checks length and checksum of a message part against the header. */
bst_wire_fault bst_link_part_check(bst_ctx *ctx, const bst_link_header *header, int part,
                                   const void *data, size_t bytes) BST_MUST_CHECK;

#endif
