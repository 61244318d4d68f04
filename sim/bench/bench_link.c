#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/bench/bench.h"
#include "sim/link/link.h"

enum { SIDE = 2048, PIXELS = SIDE * SIDE, WARM = 50, ROUNDS = 1000 };

typedef struct answer {
    bst_link_pointing head;
    bst_los_sample samples[2];
} answer;

/* Sum of all pixels. */
static uint32_t sum_of(const uint16_t *pixels) {
    uint32_t sum = 0;
    for (int i = 0; i < PIXELS; i++) {
        sum += pixels[i];
    }
    return sum;
}

/* Peer: reads every pixel and answers with the camera's pointing at start and end; returns the sum
 * of pixels in the ticks. */
static bst_status play(bst_ctx *ctx, bst_link_peer *peer) {
    bst_link_received got;
    uint32_t sum = 0;
    for (;;) {
        bst_status status = bst_link_peer_receive(ctx, peer, 30.0, &got);
        if (status != BST_OK || got.header.type == BST_LINK_END) {
            return status;
        }
        if (got.header.type == BST_LINK_FRAME) {
            sum = sum_of(got.pixels);
        } else if (got.header.type == BST_LINK_STEP) {
            answer pointing = {.head = {2}};
            for (int i = 0; i < 2; i++) {
                memcpy(&pointing.head.items[i],
                       &(bst_los_sample){(int64_t)sum, {0.0, 0.0, 0.0, 1.0}},
                       sizeof(bst_los_sample));
            }
            BST_TRY(bst_link_peer_send(ctx, peer, BST_LINK_POINTING, &pointing, &got.header));
            BST_TRY(bst_link_peer_send(ctx, peer, BST_LINK_DONE, &(bst_link_done){.outputs = 1},
                                       &got.header));
        }
    }
}

static int peer_process(const char *address) {
    bst_ctx ctx = {0};
    bst_link_hello hello = {.name = "bench", .serves = "*", .shared_memory = true};
    bst_link_peer *peer = NULL;
    bst_status status = bst_link_peer_open(&ctx, address, NULL, &hello, &peer);
    if (status == BST_OK) {
        status = play(&ctx, peer);
    }
    bst_link_peer_close(peer);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: the peer: %s\n", ctx.message);
    }
    return status == BST_OK ? 0 : 1;
}

static bst_status round_trips(bst_ctx *ctx, bst_link *link, int part, uint16_t *pixels,
                              bst_bench_result *out) {
    bst_bench_clock clock = {.count = 0};
    for (int i = 0; i < WARM + ROUNDS; i++) {
        pixels[i % PIXELS]++;
        uint32_t sum = i % 100 == 0 ? sum_of(pixels) : 0;
        const bst_link_frame frame = {.exposure_id = i,
                                      .start_tick = i,
                                      .end_tick = i,
                                      .window = {0, 0, SIDE, SIDE},
                                      .binning = 1,
                                      .bits = 16,
                                      .width = SIDE,
                                      .height = SIDE};
        const bst_link_input input = {.type = BST_LINK_FRAME,
                                      .payload = &frame,
                                      .tick = i,
                                      .pixels = pixels,
                                      .pixel_bytes = sizeof(uint16_t) * PIXELS};
        answer pointing = {.head = {0}};
        bst_link_output output = {.type = BST_LINK_POINTING, .payload = &pointing, .capacity = 2};
        bool answered;
        const bst_link_messages messages = {&input, 1, &output, 1};
        bst_bench_start(&clock);
        BST_TRY(bst_link_exchange(ctx, link, part, i, &messages, &answered));
        if (i >= WARM) {
            bst_bench_stop(&clock, 1);
        }
        if (!output.given || (i % 100 == 0 && pointing.head.items[0].tick != (int64_t)sum)) {
            return bst_fail(ctx, BST_ERR_FORMAT, "the peer has seen other pixels");
        }
    }
    bst_bench_summarise(&clock, out);
    return BST_OK;
}

bst_status bst_bench_link(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) {
    (void)options;
    bst_link_config config = {.timeout_s = 30.0,
                              .connect_timeout_s = 30.0,
                              .shared_memory = strcmp(self->name, "link_shm") == 0};
    if (strcmp(self->name, "link_tcp") == 0) {
        snprintf(config.address, sizeof config.address, "tcp://127.0.0.1:%d",
                 20000 + (int)(getpid() % 10000));
    } else {
        snprintf(config.address, sizeof config.address, "ipc:///tmp/boresight-bench-%ld",
                 (long)getpid());
    }
    bst_link_run run = {.scenario = "bench",
                        .tick_rate_hz = 1000,
                        .duration_ticks = ROUNDS,
                        .pixel_bytes = sizeof(uint16_t) * PIXELS};
    const bst_link_part part = {.instance = "bench/camera/gimbal", .role = "gimbal"};
    BST_TRY(bst_time_from_utc(ctx, "2026-01-01T00:00:00Z", &run.epoch));
    pid_t child = fork(); /* before this process has threads */
    if (child == 0) {
        _exit(peer_process(config.address));
    }
    uint16_t *pixels = malloc(sizeof(uint16_t) * PIXELS);
    bst_link *link = NULL;
    int number;
    bst_status status = child > 0 && pixels
                            ? bst_link_create(ctx, &config, &run, &link)
                            : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a peer and a frame");
    if (status == BST_OK) {
        status = bst_link_add(ctx, link, &part, &number);
    }
    if (status == BST_OK) {
        for (int i = 0; i < PIXELS; i++) {
            pixels[i] = (uint16_t)((uint32_t)i * 40503u >> 8);
        }
        status = round_trips(ctx, link, number, pixels, out);
    }
    bst_link_close(link, status == BST_OK ? 0 : 2, "the benchmark is over");
    if (child > 0) {
        if (status != BST_OK) {
            kill(child, SIGTERM);
        }
        waitpid(child, NULL, 0);
    }
    free(pixels);
    return status;
}
