/* The reader of a link's recording (link.packets) on any bytes, as they are and with the checksums
 * of packets made right. The recording is asked for what a run of one part asks: at ticks 0, 1, ...
 * in turn whether the part is ready, for an answer, for an answer more, and for lost frames. */
#define _GNU_SOURCE /* memmem */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/link/crc32c.h"
#include "sim/link/link_internal.h"
#include "sim/link/payloads.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { ITEMS = 4, ROOM = 1 << 13, OUTPUTS = 3, CALLS = 64 };

static const char crcs[] = "\"crcs\":[\"";

/* A header's checksums of its payload and of itself. */
static void seal(uint8_t *header, size_t header_bytes, const uint8_t *payload, size_t bytes) {
    uint8_t *list = memmem(header, header_bytes, crcs, sizeof crcs - 1);
    uint8_t *at = list ? list + sizeof crcs - 1 : NULL;
    if (at && header + header_bytes - at >= 8) {
        char digits[9];
        snprintf(digits, sizeof digits, "%08x", bst_crc32c(payload, bytes));
        memcpy(at, digits, 8);
    }
    if (header_bytes >= 20 && header_bytes <= BST_LINK_HEADER_BYTES) {
        bst_link_header_seal((char *)header, header_bytes);
    }
}

static void seal_all(uint8_t *data, size_t bytes) {
    while (bytes >= 8) {
        uint32_t lengths[2] = {0};
        for (int i = 0; i < 8; i++) {
            lengths[i / 4] |= (uint32_t)data[i] << (8 * (i % 4));
        }
        data += 8;
        bytes -= 8;
        if (lengths[0] > bytes || lengths[1] > bytes - lengths[0]) {
            return;
        }
        seal(data, lengths[0], data + lengths[0], lengths[1]);
        data += lengths[0] + lengths[1];
        bytes -= lengths[0] + lengths[1];
    }
}

static void check_outputs(const bst_link_output *outputs) {
    for (int i = 0; i < OUTPUTS; i++) {
        int items = bst_wire_items(bst_wire_message_of(outputs[i].type), outputs[i].payload);
        if (outputs[i].given && (items < 0 || items > ITEMS)) {
            abort();
        }
    }
}

static bst_status ask(bst_ctx *ctx, bst_link *link, int call, bst_link_output *outputs) {
    bool yes = false;
    int64_t tick = call / 4;
    switch (call % 4) {
        case 0:
            return bst_link_tape_read_ready(ctx, link, 0, tick, &yes);
        case 1:
            return bst_link_tape_read(ctx, link, 0, tick, outputs, OUTPUTS);
        case 2:
            return bst_link_tape_read_more(ctx, link, 0, tick, outputs, OUTPUTS, &yes);
        default:
            return bst_link_keep_drop(ctx, link, "a/b/c", tick, &yes);
    }
}

static void replay(const void *data, size_t bytes) {
    static const bst_link_type types[OUTPUTS] = {BST_LINK_DETECTIONS, BST_LINK_TRACKS,
                                                 BST_LINK_LOS_COMMAND};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    link_part part = {.about = {.instance = "a/b/c"}};
    bst_link *link = calloc(1, sizeof *link);
    bst_link_output outputs[OUTPUTS];
    for (int i = 0; i < OUTPUTS; i++) {
        outputs[i] = (bst_link_output){types[i], calloc(1, ROOM), ITEMS, false, 0};
    }
    link->parts = &part;
    link->part_count = 1;
    bst_status status = bst_link_replay(&ctx, link, fuzz_write_file("link.packets", data, bytes));
    for (int call = 0; status == BST_OK && call < CALLS; call++) {
        status = ask(&ctx, link, call, outputs);
        if (status == BST_OK) {
            check_outputs(outputs);
        }
    }
    FUZZ_CHECK_REASON(ctx, status);
    bst_link_tape_free(link->tape);
    for (int i = 0; i < OUTPUTS; i++) {
        free(outputs[i].payload);
    }
    free(link);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    uint8_t *sealed = malloc(bytes + 1);
    memcpy(sealed, data, bytes);
    seal_all(sealed, bytes);
    replay(data, bytes);
    if (memcmp(sealed, data, bytes) != 0) {
        replay(sealed, bytes);
    }
    free(sealed);
    return 0;
}
