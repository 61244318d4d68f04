/* Sends messages from the simulation's side of the link. */
#include <stdio.h>
#include <string.h>

#include "sim/link/crc32c.h"
#include "sim/link/link_internal.h"

/* Called by ZeroMQ's thread when it no longer needs a frame's pixels. */
static void pixels_sent(void *pixels, void *hint) {
    link_flying *f = hint;
    (void)pixels;
    if (f->release) {
        f->release(f->owner);
    }
    __atomic_store_n(&f->busy, 0, __ATOMIC_RELEASE);
}

/* Makes a message part with the pixels: borrowed, or a copy if too many are in flight. */
static bool pixels_message(bst_link *link, const bst_link_input *frame, zmq_msg_t *out) {
    for (int i = 0; i < LINK_FLYING; i++) {
        link_flying *f = &link->flying[i];
        if (__atomic_load_n(&f->busy, __ATOMIC_ACQUIRE)) {
            continue;
        }
        f->busy = 1;
        f->release = frame->release;
        f->owner = frame->owner;
        if (frame->hold) {
            frame->hold(frame->owner);
        }
        if (zmq_msg_init_data(out, (void *)(uintptr_t)frame->pixels, frame->pixel_bytes,
                              pixels_sent, f) == 0) {
            return true;
        }
        pixels_sent(NULL, f);
        return false;
    }
    if (zmq_msg_init_size(out, frame->pixel_bytes) != 0) {
        return false;
    }
    memcpy(zmq_msg_data(out), frame->pixels, frame->pixel_bytes);
    return true;
}

/* Sends the parts of a message to an address. False: nothing was sent. */
static bool send_parts(bst_link *link, const link_id *id, const char *header, size_t header_bytes,
                       zmq_msg_t *payload, zmq_msg_t *pixels) {
    bool sent = zmq_send(link->router, id->bytes, id->count, ZMQ_SNDMORE | ZMQ_DONTWAIT) >= 0 &&
                zmq_send(link->router, header, header_bytes, ZMQ_SNDMORE) >= 0 &&
                zmq_msg_send(payload, link->router, pixels ? ZMQ_SNDMORE : 0) >= 0 &&
                (!pixels || zmq_msg_send(pixels, link->router, 0) >= 0);
    if (!sent) {
        zmq_msg_close(payload);
        if (pixels) {
            zmq_msg_close(pixels);
        }
    }
    return sent;
}

/* Called by ZeroMQ's thread when a peer's `end` was sent. */
static void end_sent(void *text, void *left) {
    (void)text;
    __atomic_sub_fetch((int *)left, 1, __ATOMIC_RELEASE);
}

bool bst_link_send_end(bst_link *link, int peer, uint8_t *room) {
    const bst_wire_message *about = bst_wire_message_of(BST_LINK_END);
    size_t bytes = bst_wire_encode(about, &link->end, room);
    bst_link_header header = {.type = BST_LINK_END,
                              .sequence = link->peers[peer].sent,
                              .step = -1,
                              .slot = -1,
                              .parts = 1,
                              .lengths = {(int64_t)bytes},
                              .crcs = {bst_crc32c(room, bytes)}};
    char text[BST_LINK_HEADER_BYTES];
    zmq_msg_t payload;
    __atomic_add_fetch(&link->parting, 1, __ATOMIC_RELAXED);
    if (zmq_msg_init_data(&payload, room, bytes, end_sent, &link->parting) != 0) {
        end_sent(NULL, &link->parting);
        return false;
    }
    return send_parts(link, &link->peers[peer].id, text, bst_link_header_write(&header, text),
                      &payload, NULL);
}

static bool encode(const bst_wire_message *message, const void *payload, bst_link_header *header,
                   zmq_msg_t *out) {
    size_t bytes = bst_wire_payload_bytes(message, bst_wire_items(message, payload));
    if (zmq_msg_init_size(out, bytes) != 0) {
        return false;
    }
    bst_wire_encode(message, payload, zmq_msg_data(out));
    header->lengths[0] = (int64_t)bytes;
    header->crcs[0] = bst_crc32c(zmq_msg_data(out), bytes);
    header->parts = 1;
    return true;
}

bool bst_link_send(bst_link *link, int peer, bst_link_header *header, const void *payload,
                   const bst_link_input *frame, uint32_t crc) {
    link_peer *to = &link->peers[peer];
    zmq_msg_t first, pixels;
    char text[BST_LINK_HEADER_BYTES];
    bst_time_to_utc(bst_time_at_tick(link->run.epoch, header->tick, link->run.tick_rate_hz), 6,
                    header->utc, sizeof header->utc);
    header->sequence = to->sent;
    header->slot = -1;
    if (!encode(bst_wire_message_of(header->type), payload, header, &first)) {
        return false;
    }
    bool socket = frame && !(link->shared && to->shared_memory);
    if (frame) {
        header->lengths[header->parts++] = (int64_t)frame->pixel_bytes;
        header->crcs[1] = crc;
    }
    if (frame && !socket) {
        header->slot = bst_shared_frames_next(link->shared);
    }
    size_t bytes = bst_link_header_write(header, text);
    if (frame && !socket) {
        bst_shared_frames_write(link->shared, text, bytes, frame->pixels, frame->pixel_bytes);
    }
    if (socket && !pixels_message(link, frame, &pixels)) {
        zmq_msg_close(&first);
        return false;
    }
    bool sent = send_parts(link, &to->id, text, bytes, &first, socket ? &pixels : NULL);
    to->sent += sent;
    return sent;
}

void bst_link_reply(bst_link *link, const link_id *id, link_peer *peer, const char *fault,
                    int64_t sequence, const char *text) {
    bst_link_error error = {.sequence = sequence};
    bst_link_header header = {.type = BST_LINK_ERROR, .step = -1, .slot = -1};
    char line[BST_LINK_HEADER_BYTES];
    zmq_msg_t first;
    snprintf(error.fault, sizeof error.fault, "%s", fault);
    snprintf(error.text, sizeof error.text, "%.*s", (int)sizeof error.text - 1, text);
    for (char *c = error.text; *c; c++) {
        *c = *c >= 0x20 && *c <= 0x7e ? *c : '?';
    }
    header.sequence = peer ? peer->sent : 0;
    if (!encode(bst_wire_message_of(header.type), &error, &header, &first)) {
        return;
    }
    size_t bytes = bst_link_header_write(&header, line);
    if (send_parts(link, id, line, bytes, &first, NULL) && peer) {
        peer->sent++;
    }
}
