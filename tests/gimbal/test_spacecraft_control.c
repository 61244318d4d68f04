/* One step of the spacecraft's attitude law in all its branches, against numbers that numpy worked
 * out with rotation matrices from the formulas of Wie (see the header): no axis, wheel or product
 * of inertia is zero, and none equals another. */
#include "gimbal/spacecraft/spacecraft_control.h"
#include "gimbal/spacecraft/spacecraft_sky.h"
#include "tests/archive_support.h"

/* natural 0.3 rad/s, damping 0.8: the slope is 0.1875 per s; 70 % of 0.004 rad/s^2 give a straight
 * part up to 0.0028 / 0.1875^2 = 0.07964 rad */
static bst_spacecraft_attitude_control control_of(double rate_limit_radps) {
    const bst_spacecraft_attitude_control_spec spec = {
        .natural_radps = 0.3,
        .damping = 0.8,
        .integral_radps = 0.05,
        .rate_limit_radps = rate_limit_radps,
        .accel_limit_radps2 = 0.004,
        .dt_s = 0.1,
        .inertia_kgm2 = {{{120, -3, 5}, {-3, 90, 2}, {5, 2, 150}}}};
    bst_spacecraft_attitude_control control;
    bst_spacecraft_attitude_control_init(&control, &spec);
    return control;
}

static const bst_quat wanted_attitude = {0.1, -0.2, 0.3, 0.9}; /* to be normalised */

/* The body is turned from the wanted attitude by `angle` about (2, -1, 3) / sqrt(14). */
static bst_vec3 step(bst_spacecraft_attitude_control *control, double angle, bst_vec3 rate,
                     bool saturated) {
    const bst_spacecraft_attitude_reference wanted = {
        .q_body_from_gcrf = bst_quat_unit(wanted_attitude),
        .rate_radps = {0.001, -0.002, 0.0015},
        .accel_radps2 = {1e-4, 2e-4, -3e-4}};
    double s = sin(0.5 * angle) / sqrt(14.0);
    bst_quat turned = {-2.0 * s, 1.0 * s, -3.0 * s, cos(0.5 * angle)};
    return bst_spacecraft_attitude_control_step(control, &wanted,
                                                bst_quat_mul(turned, wanted.q_body_from_gcrf), rate,
                                                (bst_vec3){3, -2, 1}, saturated);
}

/* Rounding: torques of some 0.1 N m out of products with moments of 100 kg m^2. */
static void expect(bst_vec3 got, double x, double y, double z, double tolerance) {
    bst_assert_close(got.x, x, tolerance);
    bst_assert_close(got.y, y, tolerance);
    bst_assert_close(got.z, z, tolerance);
}

static void near_the_end_the_law_is_linear(void **state) {
    (void)state;
    const double linear = 0.0028 / (0.1875 * 0.1875);
    /* with an integral that moves */
    bst_spacecraft_attitude_control c = control_of(0.02);
    bst_vec3 t = step(&c, 0.02 * linear, (bst_vec3){0.0012, -0.0021, 0.0013}, false);
    expect(t, -0.010976754578446638, 0.028001987738402775, -0.04366318320174488, 1e-14);
    expect(c.integral_radps2, 3.8314571640565187e-07, -1.9157285820282594e-07,
           5.747185746084778e-07, 1e-18);
    /* that stands still while wheels are saturated, and counts nevertheless */
    c = control_of(0.02);
    c.integral_radps2 = (bst_vec3){2e-4, -1e-4, 3e-4};
    t = step(&c, 0.02 * linear, (bst_vec3){0.0012, -0.0021, 0.0013}, true);
    expect(t, -0.03672732878103031, 0.03698474618116452, -0.08937544283268797, 1e-14);
    expect(c.integral_radps2, 2e-4, -1e-4, 3e-4, 0.0);
    /* and farther off than a twentieth of the straight part */
    c = control_of(0.02);
    c.integral_radps2 = (bst_vec3){1e-4, 0, -1e-4};
    t = step(&c, 0.5 * linear, (bst_vec3){-0.002, -0.001, -0.004}, false);
    expect(t, -0.07235331680494649, 0.050628045422356265, -0.05772125754783737, 1e-14);
    expect(c.integral_radps2, 1e-4, 0.0, -1e-4, 0.0);
    /* the integral is clipped to the acceleration limit, and so is the sum */
    c = control_of(0.02);
    c.integral_radps2 = (bst_vec3){0.0032, -0.0016, 0.0048};
    t = step(&c, 0.02 * linear, (bst_vec3){0.001, -0.002, 0.0015}, false);
    expect(t, -0.26518376971640045, 0.11675690788717953, -0.5295832504410932, 1e-14);
    expect(c.integral_radps2, 0.0021380899352993954, -0.0010690449676496977, 0.0032071349029490926,
           1e-17);
    /* on the spot: the reference's torque and the gyroscopic one alone */
    const bst_vec3 rate = {0.001, -0.002, 0.0015};
    const bst_spacecraft_attitude_reference there = {.q_body_from_gcrf = BST_QUAT_IDENTITY,
                                                     .rate_radps = rate,
                                                     .accel_radps2 = {1e-4, 2e-4, -3e-4}};
    c = control_of(0.02);
    t = bst_spacecraft_attitude_control_step(&c, &there, BST_QUAT_IDENTITY, rate,
                                             (bst_vec3){3, -2, 1}, false);
    /* I a = (0.0099, 0.0171, -0.0441); I w + h = (3.1335, -2.18, 1.226) */
    expect(t, 0.0099 - 0.002 * 1.226 + 0.0015 * 2.18, 0.0171 + 0.0015 * 3.1335 - 0.001 * 1.226,
           -0.0441 - 0.001 * 2.18 + 0.002 * 3.1335, 1e-14);
}

static void a_slew_brakes_along_its_curve(void **state) {
    (void)state;
    const double linear = 0.0028 / (0.1875 * 0.1875);
    bst_spacecraft_attitude_control c = control_of(0.02);
    bst_vec3 t =
        step(&c, 1.05 * linear,
             (bst_vec3){-0.00727151423646519, 0.002090769844996865, -0.010689611133837961}, false);
    expect(t, 0.17060905290778908, -0.07454483260520975, 0.28387053882998203, 1e-14);
    /* at the rate limit nothing brakes */
    c = control_of(0.02);
    t = step(&c, 2.0,
             (bst_vec3){-0.010280579458119431, 0.005217715074867722, -0.013051424581457416}, false);
    expect(t, -0.056317296254304455, -0.047013200118243254, -0.056736040542188365, 1e-13);
    /* what departs from the reference is clipped, its direction kept */
    c = control_of(0.02);
    t = step(&c, 2.0, (bst_vec3){0.01, -0.01, 0.02}, false);
    expect(t, -0.25545910075081024, 0.15793556342166012, -0.5101976725639294, 1e-13);
    /* a rate limit that is met before the braking curve ends the straight part at 0.01 / 0.1875 */
    c = control_of(0.01);
    t = step(&c, 1.2 * 0.01 / 0.1875, (bst_vec3){-0.006, 0.001, -0.008}, false);
    expect(t, 0.09003151725285077, -0.018424140747321835, 0.07778545074308832, 1e-14);
}

/* Beyond 0.9 pi the way round that was taken last is kept, and only there. */
static void the_way_round_is_kept(void **state) {
    (void)state;
    const bst_vec3 u = {2.0 / sqrt(14.0), -1.0 / sqrt(14.0), 3.0 / sqrt(14.0)};
    const struct {
        double angle, before, after;
    } cases[] = {
        {0.95 * BST_PI, -1.05 * BST_PI, -1.05 * BST_PI}, /* kept: the long way */
        {0.95 * BST_PI, 1.0, 0.95 * BST_PI},             /* the same way as before */
        {0.95 * BST_PI, 0.0, 0.95 * BST_PI},             /* none before */
        {0.85 * BST_PI, -1.05 * BST_PI, 0.85 * BST_PI},  /* clearly the shorter */
    };
    for (int i = 0; i < 4; i++) {
        bst_spacecraft_attitude_control c = control_of(0.02);
        c.error_rad = bst_vec3_scale(u, cases[i].before);
        (void)step(&c, cases[i].angle, (bst_vec3){0, 0, 0}, false);
        bst_vec3 e = bst_vec3_scale(u, cases[i].after);
        expect(c.error_rad, e.x, e.y, e.z, 1e-13); /* rounding of an arc cosine's neighbourhood */
    }
}

static bst_status archive_control(void *control, bst_archive *archive) {
    bst_spacecraft_attitude_control_archive(control, archive);
    return BST_OK;
}

/* After a restore the integral goes on, and a turn of more than half a circle keeps its direction.
 */
static void it_is_saved_and_restored(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    for (int k = 0; k < 2; k++) {
        double first = k ? 3.13 : 1e-3, next = k ? 3.15 : 2e-3;
        bst_spacecraft_attitude_control c = control_of(0.02), copy = control_of(0.02);
        (void)step(&c, first, (bst_vec3){0, 0, 0}, false);
        test_saved saved = test_save(archive_control, &c);
        bst_assert_ok(&ctx, test_restore(&ctx, archive_control, &copy, saved));
        bst_vec3 was = step(&c, next, (bst_vec3){0, 0, 0}, false);
        bst_vec3 is = step(&copy, next, (bst_vec3){0, 0, 0}, false);
        assert_memory_equal(&was, &is, sizeof was);
        free(saved.bytes);
    }
}

typedef struct path {
    int asked;
    double earliest, latest;
} path;

/* A cubic path, whose interpolation through four nodes is exact, and known places on a circle at
 * 0.02 rad/s about an inclined axis. */
static bst_status cubic_sky(void *user, bst_ctx *ctx, double t, bst_spacecraft_sky *out) {
    (void)ctx;
    path *p = user;
    p->asked++;
    p->earliest = fmin(p->earliest, t);
    p->latest = fmax(p->latest, t);
    bst_vec3 x = {0.6, 0.0, 0.8}, y = {0.0, 1.0, 0.0};
    double c = cos(0.02 * t), s = sin(0.02 * t);
    *out = (bst_spacecraft_sky){
        .position_m = {7e6 + 20.0 * t, 3.0 * t * t, -t * t * t},
        .velocity_mps = {20.0, 6.0 * t, -3.0 * t * t},
        .sun_m = {1e3 - t, 2e3 + 0.5 * t * t, 3e3 * t},
        .sunlit = 0.5 + 0.2 * t,
        .known = {.position_m = bst_vec3_axpy(bst_vec3_scale(x, 7e6 * c), 7e6 * s, y),
                  .velocity_mps = bst_vec3_axpy(bst_vec3_scale(y, 7e3 * c), -7e3 * s, x)}};
    return BST_OK;
}

/* Environment and wanted motion between the nodes, forwards and back; nothing before the epoch is
 * asked for after it, and nothing later than two steps ahead, or the fourth node. */
static void the_sky_is_interpolated_between_nodes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    path user = {.earliest = INFINITY};
    const bst_pointing_law law = {
        .law = BST_LAW_NADIR, .axis = {0, 0, 1}, .second_axis = {1, 0, 0}};
    bst_spacecraft_sky_grid grid = {.sky_at = cubic_sky, .user = &user, .law = &law};
    const double times[] = {0.0, 0.1, 0.26, 0.499, 0.5, 0.77, 1.3, 0.9, 2.25, 7.7, 7.7, 3.1};
    for (size_t k = 0; k < sizeof times / sizeof *times; k++) {
        double t = times[k];
        bst_spacecraft_sky sky, want;
        bst_spacecraft_attitude_reference reference;
        user.latest = -INFINITY;
        bst_assert_ok(&ctx, bst_spacecraft_sky_grid_at(&grid, &ctx, t, &sky, &reference));
        assert_true(user.latest <= (t < 0.25 ? 0.75 : t + 0.5));
        path unused = {0};
        bst_assert_ok(&ctx, cubic_sky(&unused, &ctx, t, &want));
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(sky.position_m, want.position_m)), 0, 1e-7);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(sky.velocity_mps, want.velocity_mps)), 0, 1e-9);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(sky.sun_m, want.sun_m)), 0, 1e-8);
        bst_assert_close(sky.sunlit, fmin(0.5 + 0.2 * t, 1.0), 1e-12);
        /* nadir along +z, the way along +x: it turns about -y, which is the orbit's pole */
        bst_vec3 z = bst_quat_rotate(reference.q_body_from_gcrf, want.known.position_m);
        bst_vec3 x = bst_quat_rotate(reference.q_body_from_gcrf, want.known.velocity_mps);
        bst_assert_close(bst_vec3_angle(z, (bst_vec3){0, 0, -1}), 0, 1e-7);
        bst_assert_close(bst_vec3_angle(x, (bst_vec3){1, 0, 0}), 0, 1e-7);
        bst_assert_close(reference.rate_radps.x, 0.0, 1e-6);
        bst_assert_close(reference.rate_radps.y, -0.02, 1e-6);
        bst_assert_close(reference.rate_radps.z, 0.0, 1e-6);
        bst_assert_close(bst_vec3_norm(reference.accel_radps2), 0.0, 1e-6);
    }
    assert_true(user.earliest == 0.0);
    assert_true(user.asked < 4 * (int)(sizeof times / sizeof *times)); /* nodes are kept */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(near_the_end_the_law_is_linear),
        cmocka_unit_test(a_slew_brakes_along_its_curve),
        cmocka_unit_test(the_way_round_is_kept),
        cmocka_unit_test(it_is_saved_and_restored),
        cmocka_unit_test(the_sky_is_interpolated_between_nodes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
