#include <math.h>

#include "gimbal/mount/mount.h"
#include "gimbal/mount/second_order.h"
#include "sim/bench/bench.h"

enum { PLANT_ROUNDS = 20, PLANT_STEPS = 25000, TELEMETRY_STEPS = 10 };
#define PLANT_DT 1e-3

/* Platform of scenarios/neossat_geo_track.json. */
static bst_platform_config demo_platform(bst_platform_config c) {
    c.drift_arcsec_per_s[0] = 3.0;
    c.drift_arcsec_per_s[1] = -4.0;
    c.jitter_low_px_rms = 0.5;
    c.jitter_high_px_rms = 0.2;
    return c;
}

/* Line-of-sight command for a geostationary target seen from a low orbit, 20 times a second. */
static bst_los_command command_at(double t) {
    double rate = 15.0 * BST_ARCSEC_RAD, unit = 1.0 / sqrt(1.0 + 0.01 * 0.01);
    bst_vec3 place = {sin(rate * t), 0.01, cos(rate * t)},
             change = {rate * cos(rate * t), 0.0, -rate * sin(rate * t)};
    return (bst_los_command){.direction_gcrf = bst_vec3_scale(place, unit),
                             .rate_gcrf_radps = bst_vec3_scale(change, unit)};
}

bst_status bst_bench_plant_second_order(bst_ctx *ctx, const bst_bench *self,
                                        const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    bst_mount_two_axis_config config;
    BST_TRY(bst_config_defaults(ctx, bst_two_axis_config_table, &config));
    config.platform = demo_platform(config.platform);
    bst_mount_two_axis plant;
    bst_mount_two_axis_keys keys = {{{1, 2}}, {{3, 4}}, {{5, 6}}};
    BST_TRY(bst_mount_two_axis_init(ctx, &plant, &config, BST_QUAT_IDENTITY, 3.0 * BST_ARCSEC_RAD,
                                    PLANT_DT, &keys));
    bst_bench_clock clock = {.count = 0};
    bst_los_command command = command_at(0.0);
    double commanded = 0.0, sum = 0.0;
    for (int round = 0; round < PLANT_ROUNDS; round++) {
        bst_bench_start(&clock);
        for (int i = 0; i < PLANT_STEPS; i++) {
            double t = (double)plant.steps * PLANT_DT;
            if (plant.steps % 50 == 0) {
                command = command_at(t);
                commanded = t;
            }
            bst_mount_two_axis_step(&plant, &command, t - commanded, i % TELEMETRY_STEPS == 0);
            sum += plant.q_cam_from_gcrf.x;
        }
        bst_bench_stop(&clock, PLANT_STEPS);
    }
    bst_bench_summarise(&clock, out);
    return isfinite(sum) ? BST_OK : bst_fail(ctx, BST_ERR_NUMERIC, "the plant became infinite");
}

bst_status bst_bench_plant_full(bst_ctx *ctx, const bst_bench *self,
                                const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    bst_mount_config config;
    BST_TRY(bst_config_defaults(ctx, bst_mount_config_table, &config));
    config.platform = demo_platform(config.platform);
    config.flexible.frequency_hz[0] = config.flexible.frequency_hz[1] = 40.0;
    bst_mount mount;
    bst_platform platform;
    BST_TRY(bst_mount_init(ctx, &mount, BST_MOUNT_AZIMUTH_ELEVATION, &config, PLANT_DT,
                           (bst_rng_key){{5, 6}}));
    const bst_platform_setup setup = {.q_nominal_from_gcrf = BST_QUAT_IDENTITY,
                                      .pixel_rad = 3.0 * BST_ARCSEC_RAD,
                                      .dt_s = PLANT_DT,
                                      .jitter_key = {{1, 2}},
                                      .attitude_key = {{3, 4}}};
    BST_TRY(bst_platform_init(ctx, &platform, &config.platform, &setup));
    bst_mount_body body = {.rate_radps = platform.drift_radps,
                           .q_believed_from_gcrf = platform.q_believed_from_gcrf};
    bst_bench_clock clock = {.count = 0};
    bst_los_command command = command_at(0.0);
    double commanded = 0.0, sum = 0.0;
    for (int round = 0; round < PLANT_ROUNDS; round++) {
        bst_bench_start(&clock);
        for (int i = 0; i < PLANT_STEPS; i++) {
            int64_t n = mount.steps;
            double t = (double)n * PLANT_DT;
            if (n % 50 == 0) {
                command = command_at(t);
                commanded = t;
            }
            bst_mount_step(&mount, &body, &command, t - commanded, i % TELEMETRY_STEPS == 0);
            sum += bst_platform_true_camera(&platform, n, t, mount.q_cam_from_body).x;
        }
        bst_bench_stop(&clock, PLANT_STEPS);
    }
    bst_bench_summarise(&clock, out);
    return isfinite(sum) ? BST_OK : bst_fail(ctx, BST_ERR_NUMERIC, "the plant became infinite");
}
