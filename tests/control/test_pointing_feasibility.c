/* What is out of reach, when it is within reach again, and keyholes against the simulated mount. */
#include "control/guidance/pointing_feasibility.h"
#include "gimbal/mount/second_order.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"

#define DEG BST_DEG_RAD
#define CLOSEST_S 100.0
#define RATE (2 * DEG) /* of the line of sight, at the closest approach */

/* A straight pass: closest approach along body +y turned by `miss` towards x, motion along z. */
typedef struct pass {
    double miss_rad, sun_rad;
    bst_vec3 sun;
    double height_m; /* 0: nothing behind the Earth */
    int calls;
} pass;

static bst_vec3 direction_at(const pass *p, double seconds) {
    bst_vec3 near = {sin(p->miss_rad), cos(p->miss_rad), 0.0};
    return bst_vec3_unit(bst_vec3_axpy(near, RATE * (seconds - CLOSEST_S), (bst_vec3){0, 0, -1}));
}

static bst_status look(void *user, bst_ctx *ctx, double seconds,
                       bst_pointing_feasibility_look *out) {
    pass *p = user;
    (void)ctx;
    p->calls++;
    *out = (bst_pointing_feasibility_look){.valid = seconds < 1000.0,
                                           .direction_gcrf = direction_at(p, seconds),
                                           .range_m = 1e6,
                                           .position_m = {0, 0, 7000e3},
                                           .q_body_from_gcrf = BST_QUAT_IDENTITY};
    if (p->height_m > 0.0) {
        /* a body that goes round behind the Earth: down at 1 deg/s from the zenith */
        double a = 1 * DEG * seconds;
        out->direction_gcrf = (bst_vec3){sin(a), 0, cos(a)};
        out->range_m = p->height_m;
    }
    if (p->sun_rad > 0.0) {
        out->zones[out->zone_count++] = (bst_keep_out_zone){BST_ZONE_SUN, p->sun, p->sun_rad};
    }
    return BST_OK;
}

static bst_mount_status mount_of(double rate_degps, double accel_degps2) {
    return (bst_mount_status){.axes = 2,
                              .q_body_from_cam_at_zero = BST_QUAT_IDENTITY,
                              .axis = {{.axis_body = {0, 1, 0},
                                        .rate_limit_radps = rate_degps * DEG,
                                        .accel_limit_radps2 = accel_degps2 * DEG},
                                       {.axis_body = {1, 0, 0},
                                        .rate_limit_radps = rate_degps * DEG,
                                        .accel_limit_radps2 = accel_degps2 * DEG,
                                        .min_rad = -90 * DEG,
                                        .max_rad = 90 * DEG}}};
}

static void reasons_and_times(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pointing_feasibility reach;
    bst_pointing_feasibility_change change;
    /* in the Sun's cone of 20 degrees, its axis on the pass: out where the pass is 20 degrees on */
    pass p = {.miss_rad = 60 * DEG, .sun_rad = 20 * DEG};
    p.sun = direction_at(&p, CLOSEST_S);
    bst_pointing_feasibility_problem problem = {.look = look, .user = &p, .limit_fraction = 1.0};
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S, &reach));
    assert_int_equal(reach, BST_REACH_SUN); /* cue and Sun parallel */
    bst_assert_ok(
        &ctx, bst_pointing_feasibility_next(
                  &ctx, &problem, &(bst_pointing_feasibility_search){CLOSEST_S, 100.0, 1.0, true},
                  &change));
    assert_true(change.found);
    bst_assert_close(change.when_s, CLOSEST_S + tan(20 * DEG) / RATE,
                     0.01); /* what it is found to */
    bst_assert_ok(&ctx, bst_pointing_feasibility_next(
                            &ctx, &problem,
                            &(bst_pointing_feasibility_search){0.0, 200.0, 1.0, false}, &change));
    assert_true(change.found && change.why == BST_REACH_SUN);
    bst_assert_close(change.when_s, CLOSEST_S - tan(20 * DEG) / RATE, 0.01);
    /* and never, within a horizon that ends before */
    bst_assert_ok(&ctx,
                  bst_pointing_feasibility_next(
                      &ctx, &problem, &(bst_pointing_feasibility_search){CLOSEST_S, 9.0, 1.0, true},
                      &change));
    assert_false(change.found);
    /* the cue ends */
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, 1000.0, &reach));
    assert_int_equal(reach, BST_REACH_NO_CUE);
    /* behind the Earth: nadir angle below asin(6378.137 / 7000), from 180 - 65.7 degrees on, when
     * farther than the limb; in front of it when nearer */
    p = (pass){.height_m = 1e7};
    bst_assert_ok(&ctx, bst_pointing_feasibility_next(
                            &ctx, &problem,
                            &(bst_pointing_feasibility_search){0.0, 300.0, 5.0, false}, &change));
    assert_true(change.found && change.why == BST_REACH_BEHIND_EARTH);
    bst_assert_close(change.when_s, 180.0 - asin(BST_EARTH_RADIUS_M / 7000e3) / DEG, 0.01);
    bst_assert_ok(
        &ctx, bst_pointing_feasibility_next(
                  &ctx, &problem,
                  &(bst_pointing_feasibility_search){change.when_s, 300.0, 5.0, true}, &change));
    assert_true(change.found);
    bst_assert_close(change.when_s, 180.0 + asin(BST_EARTH_RADIUS_M / 7000e3) / DEG, 0.01);
    p.height_m = 300e3;
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, 180.0, &reach));
    assert_int_equal(reach, BST_REACH_OK);
    assert_string_equal(bst_pointing_feasibility_reason(BST_REACH_SUN),
                        "in the keep-out cone of the Sun");
    assert_string_equal(bst_pointing_feasibility_reason(99), "unknown");
}

static void limits_of_the_mount(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_pointing_feasibility reach;
    bst_mount_status mount = mount_of(5, 5);
    pass p = {.miss_rad = 60 * DEG};
    bst_pointing_feasibility_problem problem = {
        .look = look, .user = &p, .mount = &mount, .limit_fraction = 1.0};
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S, &reach));
    assert_int_equal(reach, BST_REACH_OK);
    mount = mount_of(1.5, 5);
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S, &reach));
    assert_int_equal(reach, BST_REACH_RATE);
    mount = mount_of(5, 0.01);
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S + 10, &reach));
    assert_int_equal(reach, BST_REACH_ACCEL);
    mount = mount_of(5, 5);
    p.miss_rad = 10 * DEG; /* outer rate 2 / sin 10 = 11.5 deg/s */
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S, &reach));
    assert_int_equal(reach, BST_REACH_KEYHOLE);
    mount.axis[1].min_rad = -70 * DEG;
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, CLOSEST_S, &reach));
    assert_int_equal(reach, BST_REACH_TRAVEL);
    /* exactly zero rate */
    p.height_m = 1e-300;
    mount = mount_of(5, 5);
    bst_assert_ok(&ctx, bst_pointing_feasibility_at(&ctx, &problem, 0.0, &reach));
    assert_int_equal(reach, BST_REACH_OK);
}

/* Loss and reacquisition in a keyhole as predicted, against the mount itself, which is given the
 * true direction and rate twenty times a second: within 10 % of the time that is lost. */
static void keyholes_as_simulated(void **state) {
    (void)state;
    const double misses_deg[] = {0.0, 0.5, 2.0, 5.0, 10.0, 15.0};
    const double tolerance = 20 * BST_ARCSEC_RAD;
    const bst_pointing_feasibility_span span = {40.0, 160.0, tolerance};
    for (int k = 0; k < 6; k++) {
        bst_ctx ctx = {0};
        bst_mount_status mount = mount_of(5, 5);
        pass p = {.miss_rad = misses_deg[k] * DEG};
        bst_pointing_feasibility_problem problem = {
            .look = look, .user = &p, .mount = &mount, .limit_fraction = 0.95};
        bst_pointing_feasibility_loss losses[4];
        int count;
        bst_assert_ok(&ctx,
                      bst_pointing_feasibility_chase(&ctx, &problem, &span, losses, 4, &count));
        assert_int_equal(count, 1);

        bst_mount_two_axis_config config;
        bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_two_axis_config_table, &config));
        config.rate_limit_degps = 5;
        config.accel_limit_degps2 = 5;
        config.encoder_noise_arcsec = 0;
        bst_mount_two_axis plant;
        bst_mount_two_axis_keys keys = {0};
        bst_assert_ok(&ctx, bst_mount_two_axis_init(&ctx, &plant, &config, BST_QUAT_IDENTITY, 1e-5,
                                                    1e-3, &keys));
        double from = INFINITY, until = -INFINITY;
        bst_los_command command = {0};
        for (int64_t n = 0; n < 160000; n++) {
            double t = (double)n * 1e-3;
            if (n % 50 == 0) {
                bst_vec3 up = direction_at(&p, t + 1e-3), down = direction_at(&p, t - 1e-3);
                command.direction_gcrf = direction_at(&p, t);
                command.rate_gcrf_radps = bst_vec3_scale(bst_vec3_sub(up, down), 500.0);
                command.accel_gcrf_radps2 = bst_vec3_scale(
                    bst_vec3_axpy(bst_vec3_add(up, down), -2.0, command.direction_gcrf), 1e6);
            }
            bst_mount_two_axis_step(&plant, &command, (double)(n % 50) * 1e-3, false);
            bst_vec3 boresight =
                bst_quat_rotate(bst_quat_conj(plant.q_cam_from_gcrf), (bst_vec3){0, 0, 1});
            /* the slew to the start is over by then */
            if (t > 60.0 && bst_vec3_angle(boresight, direction_at(&p, t)) > tolerance) {
                from = fmin(from, t);
                until = fmax(until, t);
            }
        }
        print_message(
            "pole missed by %4.1f deg: predicted %.2f to %.2f s, worst %.1f deg; "
            "simulated %.2f to %.2f s\n",
            misses_deg[k], losses[0].from_s, losses[0].until_s, losses[0].worst_rad / DEG, from,
            until);
        assert_true(isfinite(from) && until < 155.0);
        double lost = until - from;
        bst_assert_close(losses[0].from_s, from, 0.1 * lost);
        bst_assert_close(losses[0].until_s, until, 0.1 * lost);
    }
    /* far from the pole nothing is lost */
    bst_ctx ctx = {0};
    bst_mount_status mount = mount_of(5, 5);
    pass p = {.miss_rad = 40 * DEG};
    bst_pointing_feasibility_problem problem = {
        .look = look, .user = &p, .mount = &mount, .limit_fraction = 0.95};
    bst_pointing_feasibility_loss losses[4];
    int count;
    bst_assert_ok(&ctx, bst_pointing_feasibility_chase(&ctx, &problem, &span, losses, 4, &count));
    assert_int_equal(count, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reasons_and_times),
        cmocka_unit_test(limits_of_the_mount),
        cmocka_unit_test(keyholes_as_simulated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
