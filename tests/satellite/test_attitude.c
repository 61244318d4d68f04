/* Attitude laws, and free rotation with its conserved quantities. */
#include "sim/satellite/body_attitude.h"
#include "sim/satellite/tumbling.h"
#include "tests/test_support.h"

static const double inertia[3] = {100, 250, 300};

static void tumbling_keeps_energy_and_momentum(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static const bst_vec3 rates[] = {
        {0.1, 0.02, -0.05}, {0.01, 0.02, 0.2}, {0, 0, 0.3}, {0.2, 1e-3, 0}, {1e-9, 0.1, 1e-9}};
    for (int r = 0; r < 5; r++) {
        bst_tumbling *t;
        bst_assert_ok(&ctx, bst_tumbling_create(&ctx, inertia, rates[r], &t));
        bst_vec3 w = rates[r];
        double energy = inertia[0] * w.x * w.x + inertia[1] * w.y * w.y + inertia[2] * w.z * w.z;
        bst_vec3 l = {inertia[0] * w.x, inertia[1] * w.y, inertia[2] * w.z};
        for (int i = 0; i < 40; i++) {
            double seconds = i < 20 ? 17.3 * i : r == 4 ? 900.0 * (i - 20) : 1e5 * (i - 30);
            bst_quat q = bst_tumbling_at(t, seconds, &w);
            double now = inertia[0] * w.x * w.x + inertia[1] * w.y * w.y + inertia[2] * w.z * w.z;
            bst_assert_close(now, energy, 1e-9 * energy); /* Runge-Kutta over a period */
            bst_vec3 body = {inertia[0] * w.x, inertia[1] * w.y, inertia[2] * w.z};
            bst_vec3 start = bst_quat_rotate(bst_quat_conj(q), body);
            bst_assert_close(bst_vec3_norm(bst_vec3_sub(start, l)), 0, 1e-8 * bst_vec3_norm(l));
        }
        bst_tumbling_free(t);
    }
}

/* A symmetric top precesses about its momentum at L / I1 and turns about its axis: closed form. */
static void symmetric_top_has_its_closed_form(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double top[3] = {100, 100, 30};
    bst_vec3 w = {0.3, 0, 0.5}, l = {30, 0, 15};
    bst_tumbling *t;
    bst_assert_ok(&ctx, bst_tumbling_create(&ctx, top, w, &t));
    for (int i = 0; i < 50; i++) {
        double s = 123.4 * i;
        /* R(t) = rotation about L by L t / I1, then about the axis by w3 (1 - I3 / I1) t */
        bst_quat about_l = bst_quat_from_rotvec(bst_vec3_scale(l, s / 100));
        bst_quat about_axis = bst_quat_from_rotvec((bst_vec3){0, 0, 0.5 * (1 - 0.3) * s});
        bst_quat start_from_body = bst_quat_mul(about_l, about_axis);
        bst_quat q = bst_quat_mul(bst_tumbling_at(t, s, NULL), start_from_body);
        bst_assert_close(bst_vec3_norm(bst_quat_to_rotvec(q)), 0, 1e-6);
    }
    bst_tumbling_free(t);
}

/* Files relative to the working folder; no frame updates. */
static const bst_attitude_source from = {.base_dir = ""};

static bst_quat attitude_at(const bst_attitude_config *c, int count, const bst_attitude_state *s) {
    bst_ctx ctx = {0};
    bst_body_attitude *a;
    bst_config_list list = {(void *)c, count};
    bst_assert_ok(&ctx, bst_body_attitude_create(&ctx, &list, &from, &a));
    int phase = 0;
    double seconds;
    while (bst_body_attitude_next_start(a, &phase, &seconds)) {
        bst_attitude_state start = *s;
        start.seconds = seconds;
        bst_body_attitude_start(a, phase, &start);
    }
    bst_quat q = bst_body_attitude_at(a, s);
    bst_body_attitude_free(a);
    return q;
}

static void laws_point_their_axes(void **state) {
    (void)state;
    bst_attitude_state s = {{7e6, 1e5, -2e5}, {-100, 7000, 2000}, {0.36, 0.48, 0.8}, 100};
    bst_vec3 down = bst_vec3_scale(bst_vec3_unit(s.position_m), -1), z = {0, 0, 1}, x = {1, 0, 0};
    bst_attitude_config c = {.from_s = -1e9, .law = BST_ATTITUDE_NADIR};
    bst_quat back = bst_quat_conj(attitude_at(&c, 1, &s));
    bst_vec3 normal = bst_vec3_unit(bst_vec3_cross(s.position_m, s.velocity_mps));
    bst_assert_close(bst_vec3_angle(bst_quat_rotate(back, z), down), 0, 1e-7);
    bst_assert_close(bst_vec3_dot(bst_quat_rotate(back, (bst_vec3){0, 1, 0}), normal), -1, 1e-12);
    c.law = BST_ATTITUDE_SUN;
    back = bst_quat_conj(attitude_at(&c, 1, &s));
    bst_assert_close(bst_vec3_angle(bst_quat_rotate(back, z), s.sun), 0, 1e-7);
    c.law = BST_ATTITUDE_VELOCITY;
    back = bst_quat_conj(attitude_at(&c, 1, &s));
    bst_assert_close(bst_vec3_angle(bst_quat_rotate(back, x), s.velocity_mps), 0, 1e-7);
    c.law = BST_ATTITUDE_NADIR_SUN;
    bst_quat q = attitude_at(&c, 1, &s);
    bst_vec3 sun = bst_quat_rotate(q, s.sun);
    bst_assert_close(sun.y, 0, 1e-12);
    assert_true(sun.x > 0);
    /* 90 degrees about x: what was y is now z, so that the body's y shows nadir */
    c = (bst_attitude_config){.from_s = -1e9, .law = BST_ATTITUDE_NADIR, .rotation_deg = {90}};
    back = bst_quat_conj(attitude_at(&c, 1, &s));
    bst_assert_close(bst_vec3_angle(bst_quat_rotate(back, (bst_vec3){0, 1, 0}), down), 0, 1e-7);
    /* about x by 20, then about the new y by 30, then about the new z by 50 degrees: the last
     * row of R1(20) R2(30) R3(50) is what the body has of nadir */
    c = (bst_attitude_config){
        .from_s = -1e9, .law = BST_ATTITUDE_NADIR, .rotation_deg = {20, 30, 50}};
    const double x_turn = 20 * BST_DEG_RAD, y_turn = 30 * BST_DEG_RAD, z_turn = 50 * BST_DEG_RAD;
    bst_vec3 seen = bst_quat_rotate(attitude_at(&c, 1, &s), down);
    bst_assert_close(seen.x, -cos(x_turn) * sin(y_turn) * cos(z_turn) + sin(x_turn) * sin(z_turn),
                     1e-12);
    bst_assert_close(seen.y, cos(x_turn) * sin(y_turn) * sin(z_turn) + sin(x_turn) * cos(z_turn),
                     1e-12);
    bst_assert_close(seen.z, cos(x_turn) * cos(y_turn), 1e-12);
}

/* It loses its attitude at 90 s and turns from there. */
static void a_phase_continues_the_one_before(void **state) {
    (void)state;
    bst_attitude_config c[2] = {
        {.from_s = -1e9, .law = BST_ATTITUDE_NADIR},
        {.from_s = 90, .law = BST_ATTITUDE_SPIN, .rate_body_deg_per_s = {0, 0, 3}}};
    bst_attitude_state s = {{7e6, 1e5, -2e5}, {-100, 7000, 2000}, {0.36, 0.48, 0.8}, 100};
    bst_quat before = attitude_at(c, 1, &s), after = attitude_at(c, 2, &s);
    bst_vec3 turn = bst_quat_to_rotvec(bst_quat_mul(before, bst_quat_conj(after)));
    bst_assert_close(turn.z, 30 * BST_DEG_RAD, 1e-9);
    bst_assert_close(hypot(turn.x, turn.y), 0, 1e-9);
    s.seconds = 89.9;
    turn = bst_quat_to_rotvec(bst_quat_mul(before, bst_quat_conj(attitude_at(c, 2, &s))));
    bst_assert_close(bst_vec3_norm(turn), 0, 1e-9);
}

static void wrong_attitudes_are_refused(void **state) {
    (void)state;
    static const bst_attitude_config wrong[] = {
        {.law = BST_ATTITUDE_TUMBLE, .inertia_kg_m2 = {1, 1, 3}},
        {.law = BST_ATTITUDE_SPIN, .quaternion = {1, 1, 0, 0}},
        {.law = BST_ATTITUDE_TABLE},
        {.law = BST_ATTITUDE_TABLE, .file = "/no/such/file"}};
    static const char *const reasons[] = {"inertia_kg_m2", "quaternion", "file", "file"};
    for (int i = 0; i < 4; i++) {
        bst_ctx ctx = {0};
        bst_body_attitude *a;
        bst_config_list list = {(void *)&wrong[i], 1};
        assert_int_equal(bst_body_attitude_create(&ctx, &list, &from, &a), BST_ERR_CONFIG);
        assert_null(a);
        assert_non_null(strstr(ctx.message, reasons[i]));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tumbling_keeps_energy_and_momentum),
        cmocka_unit_test(symmetric_top_has_its_closed_form),
        cmocka_unit_test(laws_point_their_axes),
        cmocka_unit_test(a_phase_continues_the_one_before),
        cmocka_unit_test(wrong_attitudes_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
