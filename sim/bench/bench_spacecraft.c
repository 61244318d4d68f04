#include <math.h>

#include "gimbal/mount/mount.h"
#include "gimbal/platform.h"
#include "sim/astro/bodies.h"
#include "sim/bench/bench.h"

enum { CRAFT_ROUNDS = 20, CRAFT_STEPS = 25000 };
#define CRAFT_DT 1e-3

/* Environment of a circular orbit of 7000 km with the Sun in its plane. */
static bst_status sky_at(void *user, bst_ctx *ctx, double seconds, bst_spacecraft_sky *out) {
    (void)user;
    (void)ctx;
    double r = 7e6, n = sqrt(BST_EARTH_MU_M3PS2 / (r * r * r)), a = n * seconds;
    bst_vec3 u = {cos(a), sin(a), 0.0}, v = {-sin(a), cos(a), 0.0}, sun = {BST_AU_M, 0, 0};
    *out = (bst_spacecraft_sky){.position_m = bst_vec3_scale(u, r), .sun_m = sun};
    out->sunlit = bst_astro_sun_fraction(out->position_m, sun, BST_EARTH_POLE_J2000);
    out->known = (bst_spacecraft_law_inputs){
        .position_m = out->position_m, .velocity_mps = bst_vec3_scale(v, n * r), .sun_m = sun};
    return BST_OK;
}

/* Creates a nadir-pointing spacecraft: four wheels with friction and imbalance, two flexible modes,
 * gravity gradient, radiation pressure, two star trackers and a gyro. */
static bst_status make(bst_ctx *ctx, bst_spacecraft **out) {
    bst_spacecraft_config c;
    BST_TRY(bst_config_defaults(ctx, bst_spacecraft_config_table, &c));
    c.type = BST_CRAFT_RIGID_BODY;
    c.attitude.law = BST_LAW_NADIR;
    int count;
    const bst_wheel_config *set = bst_spacecraft_wheels(&c, &count);
    bst_wheel_config wheels[4];
    for (int i = 0; i < 4; i++) {
        wheels[i] = set[i];
        wheels[i].speed_rpm = i % 2 ? -1500.0 : 1500.0;
        wheels[i].coulomb_nm = 5e-4;
        wheels[i].viscous_nms = 2e-6;
        wheels[i].static_imbalance_kgm = 1e-6;
        wheels[i].dynamic_imbalance_kgm2 = 1e-8;
    }
    bst_spacecraft_mode_config modes[2] = {{1.1, 0.005, {1.2, 0.0, 0.3}},
                                           {3.4, 0.005, {0.0, 0.8, 0.1}}};
    c.wheels = (bst_config_list){wheels, 4};
    c.modes = (bst_config_list){modes, 2};
    c.disturbances.srp_area_m2 = 2.0;
    bst_spacecraft_setup setup = {.dt_s = CRAFT_DT,
                                  .q_nominal = BST_QUAT_IDENTITY,
                                  .sky_at = sky_at,
                                  .seed = 1,
                                  .instance = "bench"};
    return bst_spacecraft_create(ctx, &c, &setup, out);
}

bst_status bst_bench_plant_spacecraft(bst_ctx *ctx, const bst_bench *self,
                                      const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    bst_spacecraft *craft = NULL;
    BST_TRY(make(ctx, &craft));
    bst_bench_clock clock = {.count = 0};
    bst_status status = BST_OK;
    double sum = 0.0;
    int64_t n = 0;
    for (int round = 0; round < CRAFT_ROUNDS && status == BST_OK; round++) {
        bst_bench_start(&clock);
        for (int i = 0; i < CRAFT_STEPS && status == BST_OK; i++, n++) {
            status = bst_spacecraft_step(ctx, craft, n, CRAFT_DT * (double)n, (bst_vec3){0, 0, 0});
            sum += bst_spacecraft_at(craft)->body.q_body_from_gcrf.x;
        }
        bst_bench_stop(&clock, CRAFT_STEPS);
    }
    bst_bench_summarise(&clock, out);
    bst_spacecraft_free(craft);
    return status != BST_OK || isfinite(sum)
               ? status
               : bst_fail(ctx, BST_ERR_NUMERIC, "the spacecraft became infinite");
}

bst_status bst_bench_plant_all(bst_ctx *ctx, const bst_bench *self,
                               const bst_bench_options *options, bst_bench_result *out) {
    (void)self;
    (void)options;
    bst_mount_config config;
    BST_TRY(bst_config_defaults(ctx, bst_mount_config_table, &config));
    config.flexible.frequency_hz[0] = config.flexible.frequency_hz[1] = 40.0;
    bst_mount mount;
    BST_TRY(bst_mount_init(ctx, &mount, BST_MOUNT_AZIMUTH_ELEVATION, &config, CRAFT_DT,
                           (bst_rng_key){{5, 6}}));
    mount.want_reaction = true;
    bst_spacecraft *craft = NULL;
    BST_TRY(make(ctx, &craft));
    const bst_spacecraft_now *now = bst_spacecraft_at(craft);
    bst_bench_clock clock = {.count = 0};
    bst_status status = BST_OK;
    double sum = 0.0, commanded = 0.0;
    int64_t n = 0;
    bst_los_command command = {.direction_gcrf = bst_vec3_unit((bst_vec3){0.3, 0.5, 0.8})};
    for (int round = 0; round < CRAFT_ROUNDS && status == BST_OK; round++) {
        bst_bench_start(&clock);
        for (int i = 0; i < CRAFT_STEPS && status == BST_OK; i++, n++) {
            double t = CRAFT_DT * (double)n;
            status = bst_spacecraft_step(ctx, craft, n, t, mount.reaction_nm);
            bst_mount_body body = {now->body.rate_radps, now->q_believed_from_gcrf,
                                   now->rate_believed_radps};
            bst_mount_step(&mount, &body, &command, t - commanded, n % 10 == 0);
            sum += bst_quat_mul(mount.q_cam_from_body, now->body.q_body_from_gcrf).x;
        }
        bst_bench_stop(&clock, CRAFT_STEPS);
    }
    bst_bench_summarise(&clock, out);
    bst_spacecraft_free(craft);
    return status != BST_OK || isfinite(sum)
               ? status
               : bst_fail(ctx, BST_ERR_NUMERIC, "the plant became infinite");
}
