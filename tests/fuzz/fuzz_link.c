/* The link's decoder on any bytes: a header, and a payload after its first zero byte. Whatever is
 * accepted encodes to bytes that are accepted again and mean the same. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/link/packet.h"
#include "sim/link/payloads.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { ITEMS = 16, ROOM = 1 << 13 };

static void read_payload(bst_link_type type, const uint8_t *data, size_t bytes, void *payload) {
    bst_ctx ctx = {0};
    const bst_wire_message *m = bst_wire_message_of(type);
    if (m->header_bytes + ITEMS * m->item_bytes > ROOM) {
        abort();
    }
    memset(payload, 0, ROOM);
    int dropped;
    bst_wire_fault fault = bst_wire_decode(&ctx, m, data, bytes, payload, ITEMS, &dropped);
    if ((fault == BST_WIRE_GOOD) != (ctx.message[0] == '\0')) {
        abort(); /* a fault without its reason, or a reason without a fault */
    }
    if (fault != BST_WIRE_GOOD) {
        return;
    }
    int items = bst_wire_items(m, payload);
    size_t again = bst_wire_payload_bytes(m, items);
    uint8_t *out = malloc(again);
    if (!out || items < 0 || items > ITEMS || bst_wire_encode(m, payload, out) != again ||
        (dropped == 0 && again != bytes) ||
        bst_wire_decode(&ctx, m, out, again, payload, ITEMS, &dropped) != BST_WIRE_GOOD) {
        abort();
    }
    free(out);
}

static void read_header(const uint8_t *data, size_t header_bytes, const uint8_t *rest,
                        size_t rest_bytes) {
    bst_ctx ctx = {0};
    bst_link_header header, again;
    char text[BST_LINK_HEADER_BYTES];
    bst_wire_fault fault = bst_link_header_read(&ctx, (const char *)data, header_bytes, &header);
    if ((fault == BST_WIRE_GOOD) != (ctx.message[0] == '\0')) {
        abort();
    }
    if (fault != BST_WIRE_GOOD) {
        return;
    }
    (void)!bst_link_part_check(&ctx, &header, 0, rest, rest_bytes);
    size_t n = bst_link_header_write(&header, text);
    if (bst_link_header_read(&ctx, text, n, &again) != BST_WIRE_GOOD || again.type != header.type ||
        again.tick != header.tick || again.sequence != header.sequence ||
        again.step != header.step || strcmp(again.instance, header.instance) != 0 ||
        again.parts != header.parts || again.lengths[0] != header.lengths[0] ||
        again.slot != header.slot) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    void *payload = malloc(ROOM);
    if (!payload || bytes == 0) {
        free(payload);
        return 0;
    }
    const uint8_t *zero = memchr(data, 0, bytes);
    size_t header_bytes = zero ? (size_t)(zero - data) : bytes;
    size_t rest = zero ? bytes - header_bytes - 1 : 0;
    read_header(data, header_bytes, zero ? zero + 1 : data, rest);
    /* a random header's checksum is wrong: the same text with its right one */
    if (header_bytes >= 20 && header_bytes <= BST_LINK_HEADER_BYTES) {
        char text[BST_LINK_HEADER_BYTES];
        memcpy(text, data, header_bytes);
        bst_link_header_seal(text, header_bytes);
        read_header((const uint8_t *)text, header_bytes, zero ? zero + 1 : data, rest);
    }
    /* and checksums would keep most bytes away from what comes after them */
    read_payload((bst_link_type)(data[0] % BST_LINK_TYPES), data + 1, bytes - 1, payload);
    free(payload);
    return 0;
}
