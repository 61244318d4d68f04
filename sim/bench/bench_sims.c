#include "boresight/boresight.h"
#include "sim/bench/bench.h"

enum { SIMS = 100 };

/* A model and a simulation of it that runs. */
typedef struct running {
    bst_model *model;
    bst_sim *sim;
} running;

static void end(running *r) {
    bst_sim_free(r->sim);
    bst_model_free(r->model);
}

/* Runs the scenario to an exposure after its first frames: a frame is held, tracks exist. */
static bst_status begin(bst_ctx *ctx, const bst_bench_options *options, running *r) {
    const double in_exposure_s = 8.7;
    const bst_model_options how = {.device = options->device, .threads = options->threads};
    *r = (running){NULL, NULL};
    BST_TRY(bst_model_load(ctx, options->scenario, &how, &r->model));
    BST_TRY(bst_sim_create(ctx, r->model, NULL, &r->sim));
    return bst_sim_run_until(ctx, r->sim, in_exposure_s);
}

/* Measures the creation of simulations. They stay allocated: none reuses the memory of an earlier
 * one. */
static bst_status measure(bst_ctx *ctx, const running *r, bool clones, bst_bench_result *out) {
    bst_sim *made[SIMS] = {NULL};
    bst_bench_clock clock = {.count = 0};
    bst_status status = BST_OK;
    for (int i = 0; i < SIMS && status == BST_OK; i++) {
        bst_bench_start(&clock);
        status = clones ? bst_sim_clone(ctx, r->sim, &made[i])
                        : bst_sim_create(ctx, r->model, NULL, &made[i]);
        bst_bench_stop(&clock, 1);
    }
    bst_bench_summarise(&clock, out);
    for (int i = 0; i < SIMS; i++) {
        bst_sim_free(made[i]);
    }
    return status;
}

static bst_status run(bst_ctx *ctx, const bst_bench_options *options, bool clones,
                      bst_bench_result *out) {
    running r;
    bst_status status = begin(ctx, options, &r);
    if (status == BST_OK) {
        status = measure(ctx, &r, clones, out);
    }
    end(&r);
    return status;
}

bst_status bst_bench_sim_create(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    return run(ctx, options, false, out);
}

bst_status bst_bench_sim_clone(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    return run(ctx, options, true, out);
}
