/* A spacecraft on its way round a simple Earth, for tests. */
#ifndef BST_TESTS_CRAFT_FLIGHT_H
#define BST_TESTS_CRAFT_FLIGHT_H

#include "gimbal/spacecraft/spacecraft.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

static bst_ctx ctx;

/* A circular orbit of 7000 km (others by test) in a plane that contains x and is tilted by 60 deg,
 * the Sun along +x far away, a target that passes along the equator at 0.2 deg/s. */
static double radius_m = 7e6;
static inline double orbit_rate(void) {
    return sqrt(BST_EARTH_MU_M3PS2 / (radius_m * radius_m * radius_m));
}

static inline bst_status sky_at(void *user, bst_ctx *c, double seconds, bst_spacecraft_sky *out) {
    (void)user;
    (void)c;
    double n = orbit_rate(), phase = n * seconds + 0.5 * BST_PI;
    bst_vec3 p = {1, 0, 0}, q = {0, 0.5, 0.8660254037844386};
    bst_vec3 u = bst_vec3_axpy(bst_vec3_scale(p, cos(phase)), sin(phase), q);
    bst_vec3 v = bst_vec3_axpy(bst_vec3_scale(p, -sin(phase)), cos(phase), q);
    bst_vec3 sun = {BST_AU_M, 0, 0};
    *out = (bst_spacecraft_sky){.position_m = bst_vec3_scale(u, radius_m), .sun_m = sun};
    out->sunlit = bst_astro_sun_fraction(out->position_m, sun, BST_EARTH_POLE_J2000);
    double a = 0.2 * BST_DEG_RAD * seconds;
    out->known = (bst_spacecraft_law_inputs){.position_m = out->position_m,
                                             .velocity_mps = bst_vec3_scale(v, n * radius_m),
                                             .sun_m = sun,
                                             .target = {cos(a), sin(a), 0.3}};
    return BST_OK;
}

static inline bst_spacecraft_config config_make(bst_spacecraft_law law) {
    bst_spacecraft_config c;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_spacecraft_config_table, &c));
    c.type = BST_CRAFT_RIGID_BODY;
    c.attitude.law = (int32_t)law;
    c.filter_warm_up_s = 0.0; /* its filter begins at the epoch; others by test */
    /* the sets that it has without, to be changed */
    static bst_wheel_config wheels[4];
    static bst_spacecraft_star_tracker_config trackers[2];
    int count;
    bst_spacecraft_config controlled = {.attitude.law = BST_LAW_NADIR};
    memcpy(wheels, bst_spacecraft_wheels(&controlled, &count), sizeof wheels);
    memcpy(trackers, bst_spacecraft_trackers(&controlled, &count), sizeof trackers);
    c.wheels = (bst_config_list){wheels, 4};
    c.star_trackers = (bst_config_list){trackers, 2};
    return c;
}

static inline bst_status create(const bst_spacecraft_config *config, double dt_s, uint64_t run,
                                bst_spacecraft **out) {
    bst_spacecraft_setup setup = {.dt_s = dt_s,
                                  .q_nominal = bst_quat_unit((bst_quat){0.1, 0.3, -0.2, 0.9}),
                                  .sky_at = sky_at,
                                  .seed = 7,
                                  .run = run,
                                  .instance = "craft"};
    return bst_spacecraft_create(&ctx, config, &setup, out);
}

static const bst_vec3 none = {0, 0, 0};

typedef struct flight {
    bst_spacecraft *craft;
    double dt_s;
    int64_t n;
} flight;

static inline flight start(const bst_spacecraft_config *config, uint64_t run) {
    flight f = {.dt_s = 1e-2};
    bst_assert_ok(&ctx, create(config, f.dt_s, run, &f.craft));
    return f;
}

static inline const bst_spacecraft_now *fly(flight *f, double seconds) {
    for (int64_t end = f->n + (int64_t)llround(seconds / f->dt_s); f->n < end; f->n++) {
        bst_assert_ok(&ctx,
                      bst_spacecraft_step(&ctx, f->craft, f->n, f->dt_s * (double)f->n, none));
    }
    return bst_spacecraft_at(f->craft);
}

static inline double off(const bst_spacecraft_now *now) {
    return bst_vec3_norm(
        bst_attitude_filter_error(now->body.q_body_from_gcrf, now->reference.q_body_from_gcrf));
}

#endif
