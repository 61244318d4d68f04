#include <stdlib.h>
#include <string.h>

#include "boresight/boresight.h"
#include "boresight/messages.h"
#include "sim/bench/bench.h"
#include "sim/core/parallel.h"

/* Simulations that a program commands frame by frame, as the vector environments of Python do. */
enum { ENVS = 64, ROUNDS = 30, WARM_ROUNDS = 4 };

typedef struct env {
    bst_ctx ctx;
    bst_sim *sim;
    bst_status status;
} env;

/* Commands the boresight to stay where it is by the telemetry. */
static bst_status hold_direction(env *e) {
    bst_sim_message view;
    BST_TRY(bst_sim_view(&e->ctx, e->sim, NULL, BST_CHANNEL_POINTING_TELEMETRY, &view));
    const bst_pointing_telemetry *telemetry = view.payload;
    if (!telemetry || telemetry->written == 0) {
        return BST_OK;
    }
    const bst_pointing_sample *newest =
        &telemetry->items[(telemetry->written - 1) % telemetry->capacity];
    const bst_los_command command = {
        .tick = newest->tick,
        .direction_gcrf =
            bst_quat_rotate(bst_quat_conj(newest->q_cam_from_gcrf), (bst_vec3){0.0, 0.0, 1.0})};
    return bst_sim_command(&e->ctx, e->sim, NULL, BST_CHANNEL_LOS_COMMAND, &command);
}

/* Commands, and goes on to the next detections. */
static bst_status step(env *e) {
    bst_sim_message detections, truth;
    bool arrived;
    BST_TRY(hold_direction(e));
    BST_TRY(bst_sim_step(&e->ctx, e->sim, NULL, BST_CHANNEL_DETECTIONS, 1e6, &arrived));
    BST_TRY(bst_sim_view(&e->ctx, e->sim, NULL, BST_CHANNEL_DETECTIONS, &detections));
    BST_TRY(bst_sim_view(&e->ctx, e->sim, NULL, BST_CHANNEL_TRUTH, &truth));
    return arrived && detections.payload && truth.payload
               ? BST_OK
               : bst_fail(&e->ctx, BST_ERR_STATE, "a simulation has given no detections");
}

static void step_some(void *user, int begin, int end) {
    env *envs = user;
    for (int i = begin; i < end; i++) {
        envs[i].status = step(&envs[i]);
    }
}

/* Steps all simulations once. */
static bst_status step_all(bst_ctx *ctx, bst_parallel *pool, env *envs, int count) {
    bst_parallel_for(pool, count, 1, step_some, envs);
    for (int i = 0; i < count; i++) {
        if (envs[i].status != BST_OK) {
            return bst_fail(ctx, envs[i].status, "%s", envs[i].ctx.message);
        }
    }
    return BST_OK;
}

static bst_status measure(bst_ctx *ctx, const bst_model *model, bst_parallel *pool, int count,
                          bst_bench_result *out) {
    env *envs = calloc((size_t)count, sizeof *envs);
    bst_bench_clock clock = {.count = 0};
    bst_status status = envs ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for simulations");
    for (int i = 0; i < count && status == BST_OK; i++) {
        const bst_sim_options run = {.other_run = true, .run = (uint64_t)i};
        envs[i].ctx = *ctx;
        status = bst_sim_create(ctx, model, &run, &envs[i].sim);
    }
    for (int r = 0; r < WARM_ROUNDS && status == BST_OK; r++) {
        status = step_all(ctx, pool, envs, count);
    }
    for (int r = 0; r < ROUNDS && status == BST_OK; r++) {
        bst_bench_start(&clock);
        status = step_all(ctx, pool, envs, count);
        bst_bench_stop(&clock, count);
    }
    bst_bench_summarise(&clock, out);
    for (int i = 0; envs && i < count; i++) {
        bst_sim_free(envs[i].sim);
    }
    free(envs);
    return status;
}

/* The scenario of PointingEnv: the observation generator, and a program in the place of control. */
static bst_status run(bst_ctx *ctx, const bst_bench_options *options, int count, int threads,
                      bst_bench_result *out) {
    static const char *const assignments[] = {
        "/observers/0/sensors/0/observation_source=generator",
        "/observers/0/sensors/0/cue/offset_deg=0",
        "/observers/0/sensors/0/modules/control={\"type\": \"external\"}"};
    const bst_model_options how = {.assignments = assignments, .assignment_count = 3};
    bst_model *model = NULL;
    bst_parallel *pool = NULL;
    bst_status status = bst_model_load(ctx, options->scenario, &how, &model);
    if (status == BST_OK) {
        status = bst_parallel_create(ctx, threads, &pool);
    }
    if (status == BST_OK) {
        status = measure(ctx, model, pool, count, out);
    }
    bst_parallel_free(pool);
    bst_model_free(model);
    return status;
}

bst_status bst_bench_env(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                         bst_bench_result *out) {
    (void)self;
    return run(ctx, options, 1, 1, out);
}

bst_status bst_bench_envs(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                          bst_bench_result *out) {
    (void)self;
    return run(ctx, options, ENVS, options->threads, out);
}
