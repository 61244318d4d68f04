/* Hash of a message's content, without padding and pointers: two runs are equal if the hashes of
 * all their messages are. */
#ifndef BST_TESTS_API_MESSAGE_HASH_H
#define BST_TESTS_API_MESSAGE_HASH_H

#include <stdlib.h>
#include <string.h>

#include "boresight/boresight.h"
#include "sim/link/crc32c.h"
#include "sim/link/wire.h"

static inline uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size) {
    hash = (hash ^ bst_crc32c(bytes, size)) * UINT64_C(0x9e3779b97f4a7c15);
    return hash ^ (hash >> 29);
}

static inline uint64_t hash_pixels(uint64_t hash, const bst_frame_message *message) {
    const uint16_t *pixels;
    bst_ctx ctx = {0};
    if (!message->frame || bst_frame_map(message->frame, &ctx, &pixels) != BST_OK) {
        return hash_bytes(hash, "none", 4);
    }
    hash = hash_bytes(hash, &message->exposure_id, sizeof message->exposure_id);
    hash = hash_bytes(hash, &message->window, sizeof message->window);
    hash =
        hash_bytes(hash, pixels,
                   sizeof *pixels * (size_t)message->frame->width * (size_t)message->frame->height);
    bst_frame_unmap(message->frame);
    return hash;
}

/* Hash of a message by its wire format; rings: their newest sample. */
static inline uint64_t hash_message(uint64_t hash, const char *scope, const char *channel,
                                    const void *payload, int64_t tick) {
    hash = hash_bytes(hash, scope, strlen(scope));
    hash = hash_bytes(hash, channel, strlen(channel));
    hash = hash_bytes(hash, &tick, sizeof tick);
    if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        return hash_pixels(hash, payload);
    }
    if (strcmp(channel, BST_CHANNEL_LOS_HISTORY) == 0) {
        const bst_los_history *h = payload;
        return hash_bytes(hash, &h->items[(h->written - 1) % h->capacity], sizeof *h->items);
    }
    if (strcmp(channel, BST_CHANNEL_POINTING_TELEMETRY) == 0) {
        const bst_pointing_telemetry *t = payload;
        return hash_bytes(hash, &t->items[(t->written - 1) % t->capacity], sizeof *t->items);
    }
    bst_link_type type = bst_wire_type_of(channel);
    if (type == BST_LINK_TYPES) { /* exposure, task, planes: what follows from them is compared */
        return hash;
    }
    const bst_wire_message *about = bst_wire_message_of(type);
    size_t bytes = bst_wire_payload_bytes(about, bst_wire_items(about, payload));
    uint8_t *wire = malloc(bytes);
    bst_wire_encode(about, payload, wire);
    hash = hash_bytes(hash, wire, bytes);
    free(wire);
    return hash;
}

#endif
