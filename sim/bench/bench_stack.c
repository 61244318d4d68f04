/* Benchmark of stacking: 16 frames of noise, 2048 x 2048 pixels, rates to 3 px per frame; time per
 * frame, including its part of the search. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/detect/background.h"
#include "imgproc/stack/stack.h"
#include "sim/bench/bench.h"

enum { SIDE = 2048, FRAMES = 16, STACKS = 4, APART = 64 };

typedef struct noise {
    float *values; /* consecutive frames start APART rows from each other: no motion along a path */
    bst_background background;
    bst_stack *stack;
} noise;

static bst_status make(bst_ctx *ctx, const bst_bench_options *options, noise *n) {
    bst_camera camera = {
        .width_px = SIDE, .height_px = SIDE, .pixel_scale_arcsec = 3.0, .psf_fwhm_px = 2.0};
    bst_stack_config config = {FRAMES, 3.0, 1.0};
    size_t pixels = (size_t)SIDE * (SIDE + APART * (FRAMES - 1));
    n->values = malloc(pixels * sizeof *n->values);
    if (!n->values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for frames of noise");
    }
    bst_rng_key key = bst_rng_make_key(1, 0, "bench", "stack");
    for (size_t i = 0; i < pixels; i += 2) {
        double two[2];
        bst_rng_normal2(key, 0, i, two);
        n->values[i] = (float)two[0];
        n->values[i + 1] = (float)two[1];
    }
    BST_TRY(bst_background_create(ctx, 64, SIDE, SIDE, 1, &n->background));
    bst_background_estimate(&n->background, n->values, SIDE, SIDE, 1e-3f);
    for (int i = 0; i < n->background.columns * n->background.rows; i++) {
        n->background.noise[i] = 1.0f; /* of all frames */
    }
    return bst_stack_create(ctx, &camera, &config, options->threads, &n->stack);
}

bst_status bst_bench_stack(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                           bst_bench_result *out) {
    (void)self;
    noise n = {.values = NULL};
    bst_status status = make(ctx, options, &n);
    bst_bench_clock clock = {.count = 0};
    double found = 0.0;
    for (int s = 0; s < 1 + STACKS && status == BST_OK; s++) { /* the first is warm-up */
        int count;
        bst_bench_start(&clock);
        for (int i = 0; i < FRAMES; i++) {
            bst_stack_frame frame = {.signal = n.values + (size_t)i * APART * SIDE,
                                     .background = &n.background,
                                     .width = SIDE,
                                     .height = SIDE,
                                     .sigma_px = 2.0 / BST_FWHM_PER_SIGMA,
                                     .time_s = i,
                                     .q_cam_from_gcrf = BST_QUAT_IDENTITY,
                                     .binning = 1.0};
            bst_stack_add(n.stack, &frame);
        }
        bst_stack_search(n.stack, &count);
        if (s > 0) {
            bst_bench_stop(&clock, FRAMES);
            found += count;
        }
    }
    bst_stack_free(n.stack);
    bst_background_free(&n.background);
    free(n.values);
    if (status == BST_OK) {
        out->detections = found / (STACKS * FRAMES);
        out->detections_lost = 0.0;
        bst_bench_summarise(&clock, out);
    }
    return status;
}
