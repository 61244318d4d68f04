/* The body on its way to a roll, and the least roll that keeps a pass off the mount's pole. */
#include "control/guidance/guidance.h"
#include "tests/test_support.h"

#define DEG BST_DEG_RAD

/* v turned by `angle` about the unit vector k: Rodrigues' formula. */
static bst_vec3 turned(bst_vec3 v, bst_vec3 k, double angle) {
    bst_vec3 across = {k.y * v.z - k.z * v.y, k.z * v.x - k.x * v.z, k.x * v.y - k.y * v.x};
    double along = (k.x * v.x + k.y * v.y + k.z * v.z) * (1.0 - cos(angle));
    return (bst_vec3){v.x * cos(angle) + across.x * sin(angle) + k.x * along,
                      v.y * cos(angle) + across.y * sin(angle) + k.y * along,
                      v.z * cos(angle) + across.z * sin(angle) + k.z * along};
}

/* A rotation's effect on coordinates is that of the body's turn undone. */
static void expect_body(bst_quat q, bst_quat before, bst_vec3 drift_axis, double drift,
                        bst_vec3 roll_axis, double roll) {
    const bst_vec3 probes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        bst_vec3 want = bst_quat_rotate(before, probes[i]);
        want = turned(want, drift_axis, -drift);
        want = turned(want, roll_axis, -roll);
        bst_vec3 got = bst_quat_rotate(q, probes[i]);
        bst_assert_close(got.x, want.x, 1e-13); /* rounding */
        bst_assert_close(got.y, want.y, 1e-13);
        bst_assert_close(got.z, want.z, 1e-13);
    }
}

/* Limits 1 and 0.2 deg/s^2, of which 0.9 are used: full rate after 5 s and 2.25 degrees; 40 degrees
 * take 40 / 0.9 + 5 s. */
static void the_roll_is_where_its_limits_have_it(void **state) {
    (void)state;
    const bst_vec3 axis = bst_vec3_unit((bst_vec3){2, -1, 3});
    const bst_vec3 drift = bst_vec3_unit((bst_vec3){-1, 4, 2});
    const bst_quat q = bst_quat_unit((bst_quat){0.1, -0.2, 0.3, 0.9});
    static bst_guidance g;
    g = (bst_guidance){.mount_known = true};
    g.mount.q_body_from_gcrf = q;
    g.mount.rate_body_radps = bst_vec3_scale(drift, 0.3 * DEG);
    g.mount.roll = (bst_body_roll){.axis_body = axis,
                                   .angle_rad = 15 * DEG,
                                   .rate_limit_radps = 1.0 * DEG,
                                   .accel_limit_radps2 = 0.2 * DEG};
    const double a = 0.18, v = 0.9; /* deg/s^2, deg/s */
    const struct {
        double seconds, roll_deg;
    } points[] = {{0.0, 0.0},
                  {3.0, 0.5 * a * 9.0},
                  {20.0, 2.25 + v * 15.0},
                  {40.0 / v + 2.0, 40.0 - 0.5 * a * 9.0},
                  {100.0, 40.0}};
    for (int side = -1; side <= 1; side += 2) {
        for (int i = 0; i < 5; i++) {
            double t = points[i].seconds;
            expect_body(bst_guidance_rolled(&g, t, (15.0 + side * 40.0) * DEG), q, drift,
                        0.3 * DEG * t, axis, side * points[i].roll_deg * DEG);
        }
    }
    /* already rolling at 0.5 deg/s, which is part of the body's rate: 0.4 deg/s more within
     * 0.4 / 0.18 s, and braked in 5 s before the end */
    g.mount.roll.rate_radps = 0.5 * DEG;
    g.mount.rate_body_radps = bst_vec3_axpy(bst_vec3_scale(drift, 0.3 * DEG), 0.5 * DEG, axis);
    double speeding_s = 0.4 / a, speeding_deg = 0.7 * speeding_s;
    expect_body(bst_guidance_rolled(&g, 1.0, 55 * DEG), q, drift, 0.3 * DEG, axis,
                (0.5 + 0.5 * a) * DEG);
    expect_body(bst_guidance_rolled(&g, 20.0, 55 * DEG), q, drift, 6.0 * DEG, axis,
                (speeding_deg + v * (20.0 - speeding_s)) * DEG);
    /* without limits for a plan it goes on as it does */
    g.mount.roll.accel_limit_radps2 = 0.0;
    expect_body(bst_guidance_rolled(&g, 20.0, 55 * DEG), q, drift, 6.0 * DEG, axis, 10.0 * DEG);
}

/* A great circle at 2 deg/s through +z, which misses the outer axis, +y of the body, by `miss`
 * towards +x at 40 s. The body has rolled about +z as guidance asks for. */
typedef struct pass {
    const bst_guidance *g;
    double miss_deg;
} pass;

static bst_status look(void *user, bst_ctx *ctx, double seconds,
                       bst_pointing_feasibility_look *out) {
    const pass *p = user;
    (void)ctx;
    double m = p->miss_deg * DEG, a = 2.0 * DEG * (seconds - 40.0);
    bst_vec3 d = {cos(a) * sin(m), cos(a) * cos(m), -sin(a)};
    *out = (bst_pointing_feasibility_look){
        .valid = true,
        .direction_gcrf = turned(d, (bst_vec3){0, 0, 1}, -p->g->roll_rad),
        .q_body_from_gcrf = BST_QUAT_IDENTITY};
    return BST_OK;
}

static void make_mount(bst_guidance *g, double rate_limit_degps) {
    *g = (bst_guidance){.mount_known = true};
    g->config.loss_tolerance_px = 5.0;
    g->env.pixel_rad = 1e-3; /* coarse: what the chase starts with is no loss */
    g->mount = (bst_mount_status){.axes = 2, .q_body_from_cam_at_zero = BST_QUAT_IDENTITY};
    for (int k = 0; k < 2; k++) {
        g->mount.axis[k].rate_limit_radps = rate_limit_degps * DEG;
        g->mount.axis[k].accel_limit_radps2 = 100.0 * DEG;
    }
    g->mount.axis[0].axis_body = (bst_vec3){0, 1, 0};
    g->mount.axis[1].axis_body = (bst_vec3){1, 0, 0};
    g->mount.axis[1].min_rad = -90 * DEG;
    g->mount.axis[1].max_rad = 90 * DEG;
    g->mount.roll.axis_body = (bst_vec3){0, 0, 1};
}

/* The outer axis must turn at 2 deg/s / sin(miss) at most: with 0.8 of 5 deg/s the pole is to be
 * missed by more than 30 degrees. */
static void the_least_roll_that_is_enough_is_taken(void **state) {
    (void)state;
    static bst_guidance g;
    const struct {
        double miss_deg, share, from_deg, given_deg, chosen_deg;
    } cases[] = {
        {12.0, 1.0, 0.0, NAN, 20.0}, /* 32 degrees of miss; the other side takes 45 */
        {-12.0, 1.0, 0.0, NAN, -20.0},
        {12.0, 1.0, -5.0, NAN, 20.0},   /* from where the body is, in steps of 5 degrees */
        {12.0, 1.0, 0.0, -30.0, -45.0}, /* or from the roll it was asked for */
        {12.0, 0.9, 0.0, NAN, 25.0},    /* 2 / (0.9 * 4): 33.7 degrees */
    };
    for (int i = 0; i < 5; i++) {
        bst_ctx ctx = {0};
        make_mount(&g, 5.0);
        pass p = {&g, cases[i].miss_deg};
        const bst_pointing_feasibility_problem problem = {
            .look = look, .user = &p, .mount = &g.mount, .limit_fraction = cases[i].share};
        g.mount.roll.angle_rad = cases[i].from_deg * DEG;
        g.roll_given = !isnan(cases[i].given_deg);
        g.roll_rad = g.roll_given ? cases[i].given_deg * DEG : 1.0;
        bool found = false;
        bst_assert_ok(&ctx, bst_guidance_choose_roll(&ctx, &g, &problem, 80.0, &found));
        assert_true(found && g.roll_given);
        bst_assert_close(g.roll_rad / DEG, cases[i].chosen_deg, 1e-9); /* rounding */
    }
}

static void without_a_way_the_roll_stays(void **state) {
    (void)state;
    static bst_guidance g;
    bst_ctx ctx = {0};
    pass p = {&g, 12.0};
    bst_pointing_feasibility_problem problem = {
        .look = look, .user = &p, .mount = &g.mount, .limit_fraction = 1.0};
    for (int given = 0; given < 2; given++) {
        make_mount(&g, 2.0); /* slower than the target, whatever the roll */
        g.roll_given = given == 1;
        g.roll_rad = 0.125;
        bool found = true;
        bst_assert_ok(&ctx, bst_guidance_choose_roll(&ctx, &g, &problem, 80.0, &found));
        assert_false(found);
        assert_int_equal(g.roll_given, given == 1);
        assert_true(g.roll_rad == 0.125);
    }
    /* 85 degrees on either side of the pole are not enough, 90 just are: the axis
     * turns at 2 deg/s there, at 2.008 deg/s five degrees before, and 0.8 of the limit are 2.004 */
    make_mount(&g, 2.505);
    p.miss_deg = 0.0;
    bool least;
    bst_assert_ok(&ctx, bst_guidance_choose_roll(&ctx, &g, &problem, 80.0, &least));
    assert_true(least);
    bst_assert_close(fabs(g.roll_rad) / DEG, 90.0, 1e-9); /* rounding */
    /* a body that does not roll, or of which nothing is known */
    for (int i = 0; i < 2; i++) {
        make_mount(&g, 5.0);
        if (i == 0) {
            g.mount.roll.axis_body = (bst_vec3){0, 0, 0};
        } else {
            g.mount_known = false;
        }
        bool found = true;
        bst_assert_ok(&ctx, bst_guidance_choose_roll(&ctx, &g, &problem, 80.0, &found));
        assert_false(found || g.roll_given);
    }
}

/* Every direction can be reached and no axis is too slow, but the outer one comes to the end of its
 * travel and has to go round by a turn: that is a loss, and a roll about the outer axis moves it
 * out of the pass. */
static bst_status look_round(void *user, bst_ctx *ctx, double seconds,
                             bst_pointing_feasibility_look *out) {
    const pass *p = user;
    (void)ctx;
    double o = (150.0 + 0.4 * seconds) * DEG; /* 150 to 198 degrees in 120 s */
    *out = (bst_pointing_feasibility_look){
        .valid = true,
        .direction_gcrf = turned((bst_vec3){cos(0.2) * sin(o), -sin(0.2), cos(0.2) * cos(o)},
                                 (bst_vec3){0, 1, 0}, -p->g->roll_rad),
        .q_body_from_gcrf = BST_QUAT_IDENTITY};
    return BST_OK;
}

static void a_turn_of_the_outer_axis_is_a_loss(void **state) {
    (void)state;
    static bst_guidance g;
    bst_ctx ctx = {0};
    make_mount(&g, 5.0);
    g.mount.roll.axis_body = (bst_vec3){0, 1, 0};
    g.mount.axis[0].min_rad = -180 * DEG;
    g.mount.axis[0].max_rad = 180 * DEG;
    pass p = {&g, 0.0};
    const bst_pointing_feasibility_problem problem = {
        .look = look_round, .user = &p, .mount = &g.mount, .limit_fraction = 1.0};
    bool found;
    bst_assert_ok(&ctx, bst_guidance_choose_roll(&ctx, &g, &problem, 120.0, &found));
    assert_true(found);
    /* the pass ends at 198 degrees: 20 more than 18, in steps of 5 */
    bst_assert_close(g.roll_rad / DEG, 20.0, 1e-9); /* rounding */
}

/* The pass of look(), which begins at 5 s, for a body that turns as guidance predicts. */
static bst_status aim(void *user, bst_ctx *ctx, int64_t tick, bool *valid, bst_vec3 *direction) {
    const pass *p = user;
    (void)ctx;
    double m = p->miss_deg * DEG, a = 2.0 * DEG * ((double)tick / 1000.0 - 45.0);
    *direction = (bst_vec3){cos(a) * sin(m), cos(a) * cos(m), -sin(a)};
    *valid = true;
    return BST_OK;
}

/* The event of a roll gives its length from the roll that was asked for before, or else from where
 * the body is, positive about its axis. */
static void the_event_has_the_length_of_the_roll(void **state) {
    (void)state;
    static bst_guidance g;
    const struct {
        double miss_deg, from_deg, given_deg, chosen_deg, length_deg;
    } cases[] = {
        {12.0, 0.0, NAN, 20.0, 20.0},   {-12.0, 0.0, NAN, -20.0, -20.0},
        {12.0, -5.0, NAN, 20.0, 25.0},  {-12.0, -5.0, NAN, -20.0, -15.0},
        {12.0, 5.0, -10.0, 20.0, 30.0},
    };
    for (int i = 0; i < 5; i++) {
        bst_ctx ctx = {0};
        pass p = {.miss_deg = cases[i].miss_deg};
        make_mount(&g, 5.0);
        g.config.limit_fraction = 1.0;
        g.config.prediction_horizon_s = 80.0;
        g.config.body_roll = true;
        g.env.tick_rate_hz = 1000.0;
        g.env.aim = aim;
        g.env.user = &p;
        g.nav.position_gcrf_m = (bst_vec3){7e6, 0, 0};
        g.nav.velocity_gcrf_mps = (bst_vec3){0, 7500, 0};
        g.told_from_s = g.told_until_s = INFINITY;
        g.mount.tick = 5000;
        g.mount.roll.angle_rad = cases[i].from_deg * DEG;
        g.mount.roll.rate_limit_radps = 2.0 * DEG;
        g.mount.roll.accel_limit_radps2 = 1.0 * DEG;
        g.mount.q_body_from_gcrf = bst_quat_from_rotvec((bst_vec3){0, 0, -cases[i].from_deg * DEG});
        g.roll_given = !isnan(cases[i].given_deg);
        g.roll_rad = g.roll_given ? cases[i].given_deg * DEG : 0.0;
        bst_assert_ok(&ctx, bst_guidance_look_ahead(&ctx, &g, 5000));
        assert_int_equal(g.event_count, 1);
        assert_int_equal(g.events[0].kind, BST_GUIDANCE_ROLL);
        bst_assert_close(g.roll_rad / DEG, cases[i].chosen_deg, 1e-9); /* rounding */
        bst_assert_close(g.events[0].length_rad / DEG, cases[i].length_deg, 1e-9);
        char text[200];
        bst_guidance_describe(&g.events[0], text, sizeof text);
        char begins[40];
        snprintf(begins, sizeof begins, "the body rolls by %.1f deg", cases[i].length_deg);
        assert_memory_equal(text, begins, strlen(begins));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_event_has_the_length_of_the_roll),
        cmocka_unit_test(the_roll_is_where_its_limits_have_it),
        cmocka_unit_test(the_least_roll_that_is_enough_is_taken),
        cmocka_unit_test(without_a_way_the_roll_stays),
        cmocka_unit_test(a_turn_of_the_outer_axis_is_a_loss),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
