#include <math.h>

#include "boresight/vec.h"
#include "sim/astro/trajectory.h"
#include "sim/bench/bench.h"

enum { STATES = 1440 };

/* Computes a state per minute of one day of a low orbit through the shadow with all forces; places:
 * [STATES]. */
static bst_status one_day(bst_ctx *ctx, bst_trajectory_options *options, double tolerance,
                          bst_vec3 *places) {
    options->tolerance = tolerance;
    bst_trajectory *orbit;
    BST_TRY(bst_trajectory_create(ctx, options, &orbit));
    bst_status status = BST_OK;
    for (int i = 0; i < STATES && status == BST_OK; i++) {
        bst_vec3 velocity;
        status = bst_trajectory_state(ctx, orbit, 60.0 * (i + 1), &places[i], &velocity);
    }
    bst_trajectory_free(orbit);
    return status;
}

bst_status bst_bench_numerical(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    static const int rounds = 5;
    bst_gravity *field = NULL;
    bst_astro_eop *eop = NULL;
    bst_bench_clock clock = {.count = 0};
    bst_vec3 places[STATES], finer[STATES];
    bst_trajectory_options orbit = {.position_m = {0.0, 7e6, 0.0},
                                    .velocity_mps = {1050.0, 0.0, 7470.0}};
    bst_status status =
        bst_gravity_builtin(ctx, BST_GRAVITY_BUILTIN_DEGREE, BST_GRAVITY_BUILTIN_DEGREE, &field);
    if (status == BST_OK) {
        status = bst_astro_eop_builtin(ctx, &eop);
    }
    if (status == BST_OK) {
        status = bst_time_from_utc(ctx, "2022-06-16T22:10:00Z", &orbit.epoch);
    }
    orbit.forces = (bst_force_model){.gravity = field,
                                     .eop = eop,
                                     .sun = true,
                                     .moon = true,
                                     .solar_pressure = true,
                                     .drag = true,
                                     .density_scale = 1.0,
                                     .spacecraft = {500.0, 4.0, 2.2, 4.0, 1.3}};
    for (int i = 0; i < rounds && status == BST_OK; i++) {
        bst_bench_start(&clock);
        status = one_day(ctx, &orbit, 0.0, places);
        bst_bench_stop(&clock, 1);
    }
    if (status == BST_OK) {
        status = one_day(ctx, &orbit, 1e-11, finer);
    }
    if (status == BST_OK) {
        out->error_m = 0.0;
        for (int i = 0; i < STATES; i++) {
            out->error_m = fmax(out->error_m, bst_vec3_norm(bst_vec3_sub(places[i], finer[i])));
        }
        bst_bench_summarise(&clock, out);
    }
    bst_astro_eop_free(eop);
    bst_gravity_free(field);
    return status;
}
