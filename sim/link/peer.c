/* The peer's side of the link. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <zmq.h>

#include "sim/core/memory.h"
#include "sim/core/wall_clock.h"
#include "sim/link/crc32c.h"
#include "sim/link/curve_keys.h"
#include "sim/link/endpoint.h"
#include "sim/link/link.h"
#include "sim/link/shared_frames.h"

enum { PARTS = 1 + BST_LINK_PARTS };

struct bst_link_peer {
    void *context, *socket;
    bst_link_hello hello;
    int64_t sent;
    bst_shared_frames *shared;
    char shared_name[64];
    zmq_msg_t parts[PARTS]; /* parts of the last received message */
    int part_count;
    void *payload; /* struct of the message */
    size_t payload_room;
    uint16_t *pixels; /* aligned copy, if the pixels are misaligned in the message */
    size_t pixel_room;
};

static void release_parts(bst_link_peer *peer) {
    for (int i = 0; i < peer->part_count; i++) {
        zmq_msg_close(&peer->parts[i]);
    }
    peer->part_count = 0;
}

void bst_link_peer_close(bst_link_peer *peer) {
    if (!peer) {
        return;
    }
    release_parts(peer);
    if (peer->socket) {
        zmq_close(peer->socket);
    }
    if (peer->context) {
        zmq_ctx_term(peer->context);
    }
    bst_shared_frames_free(peer->shared);
    free(peer->payload);
    free(peer->pixels);
    free(peer);
}

static bst_status say_hello(bst_ctx *ctx, bst_link_peer *peer) {
    return bst_link_peer_send(ctx, peer, BST_LINK_HELLO, &peer->hello, NULL);
}

static bst_status secure(bst_ctx *ctx, void *socket, const char *keys_file) {
    bst_curve_keys keys;
    BST_TRY(bst_curve_keys_read(ctx, keys_file, &keys));
    return bst_curve_secure(ctx, socket, &keys, false);
}

bst_status bst_link_peer_open(bst_ctx *ctx, const char *address, const char *keys_file,
                              const bst_link_hello *hello, bst_link_peer **out) {
    char checked[BST_LINK_ENDPOINT_BYTES];
    *out = NULL;
    BST_TRY(bst_link_endpoint_check(ctx, address, checked));
    bst_link_peer *peer = calloc(1, sizeof *peer);
    if (!peer) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the link");
    }
    peer->hello = *hello;
    peer->context = zmq_ctx_new();
    peer->socket = peer->context ? zmq_socket(peer->context, ZMQ_DEALER) : NULL;
    bst_status status = peer->socket && keys_file ? secure(ctx, peer->socket, keys_file) : BST_OK;
    if (status != BST_OK) {
        bst_link_peer_close(peer);
        return status;
    }
    int linger_ms = 500, ipv6 = strncmp(checked, "tcp://[", 7) == 0, reconnect_ms = 50;
    if (!peer->socket ||
        zmq_setsockopt(peer->socket, ZMQ_LINGER, &linger_ms, sizeof linger_ms) != 0 ||
        zmq_setsockopt(peer->socket, ZMQ_IPV6, &ipv6, sizeof ipv6) != 0 ||
        zmq_setsockopt(peer->socket, ZMQ_RECONNECT_IVL, &reconnect_ms, sizeof reconnect_ms) != 0 ||
        zmq_connect(peer->socket, checked) != 0) {
        status = bst_fail(ctx, BST_ERR_IO, "link: cannot connect to %s: %s", checked,
                          zmq_strerror(errno));
        bst_link_peer_close(peer);
        return status;
    }
    status = say_hello(ctx, peer);
    if (status != BST_OK) {
        bst_link_peer_close(peer);
        return status;
    }
    *out = peer;
    return BST_OK;
}

bst_status bst_link_peer_send(bst_ctx *ctx, bst_link_peer *peer, bst_link_type type,
                              const void *payload, const bst_link_header *step) {
    const bst_wire_message *about = bst_wire_message_of(type);
    if (!about || !(about->from & BST_WIRE_FROM_PEER)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "link: a peer does not send messages of type %s",
                        about ? about->name : "?");
    }
    bst_link_header header = {.type = type, .sequence = peer->sent, .step = -1, .slot = -1};
    if (step) {
        header.tick = step->tick;
        header.step = step->step;
        memcpy(header.instance, step->instance, sizeof header.instance);
    }
    size_t bytes = bst_wire_payload_bytes(about, bst_wire_items(about, payload));
    zmq_msg_t body;
    if (zmq_msg_init_size(&body, bytes) != 0) {
        return bst_fail(ctx, BST_ERR_MEMORY, "link: no memory for %zu bytes", bytes);
    }
    bst_wire_encode(about, payload, zmq_msg_data(&body));
    header.parts = 1;
    header.lengths[0] = (int64_t)bytes;
    header.crcs[0] = bst_crc32c(zmq_msg_data(&body), bytes);
    char text[BST_LINK_HEADER_BYTES];
    size_t text_bytes = bst_link_header_write(&header, text);
    if (zmq_send(peer->socket, text, text_bytes, ZMQ_SNDMORE) < 0 ||
        zmq_msg_send(&body, peer->socket, 0) < 0) {
        int why = errno;
        zmq_msg_close(&body);
        return bst_fail(ctx, BST_ERR_IO, "link: cannot send: %s", zmq_strerror(why));
    }
    peer->sent++;
    return BST_OK;
}

/* Receives the parts of one message; BST_ERR_NOT_FOUND: time-out. */
static bst_status receive_parts(bst_ctx *ctx, bst_link_peer *peer, double timeout_s) {
    zmq_pollitem_t item = {.socket = peer->socket, .events = ZMQ_POLLIN};
    int wait_ms = timeout_s <= 0.0 ? 0 : timeout_s > 1e6 ? 1000000000 : (int)(timeout_s * 1e3) + 1;
    int ready = zmq_poll(&item, 1, wait_ms);
    if (ready < 0) {
        return bst_fail(ctx, errno == EINTR ? BST_ERR_INTERRUPTED : BST_ERR_IO, "link: %s",
                        zmq_strerror(errno));
    }
    if (ready == 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "link: nothing has come for %.3g s", timeout_s);
    }
    int more = 1;
    while (more) {
        zmq_msg_t spare, *part = peer->part_count < PARTS ? &peer->parts[peer->part_count] : &spare;
        zmq_msg_init(part);
        if (zmq_msg_recv(part, peer->socket, 0) < 0) {
            zmq_msg_close(part);
            return bst_fail(ctx, BST_ERR_IO, "link: %s", zmq_strerror(errno));
        }
        more = zmq_msg_more(part);
        if (part == &spare) {
            zmq_msg_close(&spare);
        } else {
            peer->part_count++;
        }
    }
    return BST_OK;
}

/* Error status of a faulty message from the simulation. */
static bst_status wrong(bst_ctx *ctx, bst_wire_fault fault) {
    return bst_fail_prefix(ctx, BST_ERR_FORMAT, "link: a message of the simulation is %s",
                           bst_wire_fault_name(fault));
}

static bst_status find_pixels(bst_ctx *ctx, bst_link_peer *peer, bst_link_received *out) {
    const bst_link_header *h = &out->header;
    const bst_link_frame *frame = out->payload;
    int64_t bytes = (int64_t)2 * frame->width * frame->height;
    if (h->lengths[1] != bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: %lld bytes of pixels in a frame of %d x %d",
                        (long long)h->lengths[1], frame->width, frame->height);
    }
    if (h->slot >= 0) {
        out->pixels = peer->shared ? bst_shared_frames_read(peer->shared, h->slot, bytes) : NULL;
        return out->pixels ? BST_OK
                           : bst_fail(ctx, BST_ERR_FORMAT,
                                      "link: frame %lld is not in the shared memory any more",
                                      (long long)h->slot);
    }
    const void *data = zmq_msg_data(&peer->parts[2]);
    if ((uintptr_t)data % sizeof(uint16_t) == 0) {
        out->pixels = data;
        return BST_OK;
    }
    void *copy = peer->pixels;
    BST_TRY(bst_memory_grow(ctx, "link: no memory", &copy, &peer->pixel_room, (size_t)bytes));
    peer->pixels = copy;
    memcpy(peer->pixels, data, (size_t)bytes);
    out->pixels = peer->pixels;
    return BST_OK;
}

static bst_status open_shared(bst_ctx *ctx, bst_link_peer *peer, const bst_link_welcome *welcome) {
    if (!*welcome->shared_memory || strcmp(welcome->shared_memory, peer->shared_name) == 0) {
        return BST_OK;
    }
    bst_shared_frames_free(peer->shared);
    peer->shared = NULL;
    memcpy(peer->shared_name, welcome->shared_memory, sizeof peer->shared_name);
    return bst_shared_frames_open(ctx, welcome->shared_memory, welcome->slot_bytes, welcome->slots,
                                  &peer->shared);
}

static bst_status read_message(bst_ctx *ctx, bst_link_peer *peer, bst_link_received *out) {
    *out = (bst_link_received){.payload = NULL};
    bst_wire_fault fault = bst_link_header_read(ctx, zmq_msg_data(&peer->parts[0]),
                                                zmq_msg_size(&peer->parts[0]), &out->header);
    if (fault != BST_WIRE_GOOD) {
        return wrong(ctx, fault);
    }
    const bst_wire_message *about = bst_wire_message_of(out->header.type);
    int expected = 1 + out->header.parts - (out->header.slot >= 0);
    if (!(about->from & BST_WIRE_FROM_SIM) || peer->part_count != expected) {
        return bst_fail(ctx, BST_ERR_FORMAT, "link: %s in %d parts (expected: %d)", about->name,
                        peer->part_count, expected);
    }
    for (int i = 1; i < peer->part_count; i++) {
        fault = bst_link_part_check(ctx, &out->header, i - 1, zmq_msg_data(&peer->parts[i]),
                                    zmq_msg_size(&peer->parts[i]));
        if (fault != BST_WIRE_GOOD) {
            return wrong(ctx, fault);
        }
    }
    size_t bytes = zmq_msg_size(&peer->parts[1]), record = bst_wire_bytes(about->record);
    size_t items =
        about->items && bytes > record ? (bytes - record) / bst_wire_bytes(about->items) : 0;
    BST_TRY(bst_memory_grow(ctx, "link: no memory", &peer->payload, &peer->payload_room,
                            about->header_bytes + (items + 1) * about->item_bytes + 64));
    fault = bst_wire_decode(ctx, about, zmq_msg_data(&peer->parts[1]), bytes, peer->payload,
                            (int)items, NULL);
    if (fault != BST_WIRE_GOOD) {
        return wrong(ctx, fault);
    }
    out->payload = peer->payload;
    if (out->header.type == BST_LINK_WELCOME) {
        return open_shared(ctx, peer, peer->payload);
    }
    return about->pixels ? find_pixels(ctx, peer, out) : BST_OK;
}

bst_status bst_link_peer_receive(bst_ctx *ctx, bst_link_peer *peer, double timeout_s,
                                 bst_link_received *out) {
    double end = bst_wall_seconds() + timeout_s;
    for (;;) {
        release_parts(peer);
        BST_TRY(receive_parts(ctx, peer, end - bst_wall_seconds()));
        BST_TRY(read_message(ctx, peer, out));
        const bst_link_error *error = out->payload;
        if (out->header.type != BST_LINK_ERROR || strcmp(error->fault, "stranger") != 0) {
            return BST_OK;
        }
        /* the connection was lost, or an answer was too late */
        BST_TRY(say_hello(ctx, peer));
    }
}
