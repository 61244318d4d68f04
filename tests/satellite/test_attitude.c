/* Attitude laws, and free rotation with its conserved quantities. */
#include "sim/satellite/attitude_table.h"
#include "sim/satellite/body_attitude.h"
#include "sim/satellite/commanded_attitude.h"
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
    /* inertial: the axes of GCRF, wherever the body and the Sun are */
    c.law = BST_ATTITUDE_INERTIAL;
    q = attitude_at(&c, 1, &s);
    bst_assert_close(fabs(q.w), 1, 1e-12);
    c = (bst_attitude_config){
        .from_s = -1e9, .law = BST_ATTITUDE_INERTIAL, .quaternion = {0.5, 0.5, 0.5, 0.5}};
    q = attitude_at(&c, 1, &s);
    bst_assert_close(
        bst_vec3_angle(bst_quat_rotate(q, x), bst_quat_rotate((bst_quat){0.5, 0.5, 0.5, 0.5}, x)),
        0, 1e-7);
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

/* A body's attitude, turned by an angle about an axis of its own: where it sees a star. */
static bst_vec3 seen_after(bst_quat q, bst_vec3 axis, double angle, bst_vec3 star) {
    bst_vec3 v = bst_quat_rotate(q, star);
    /* Rodrigues' formula by -angle */
    bst_vec3 out =
        bst_vec3_axpy(bst_vec3_scale(v, cos(angle)), -sin(angle), bst_vec3_cross(axis, v));
    return bst_vec3_axpy(out, (1.0 - cos(angle)) * bst_vec3_dot(axis, v), axis);
}

static const bst_vec3 star = {0.36, -0.48, 0.8};

/* About a principal axis, and any axis of a body of equal moments, it turns evenly, also before
 * time 0; a rate that is off by 1e-6 makes no more difference than that. */
static void spins_are_even(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static const double equal[3] = {80, 80, 80};
    static const struct {
        bst_vec3 axis;
        const double *inertia;
    } cases[] = {{{1, 0, 0}, inertia},  {{0, 0, 1}, inertia},        {{0, 0, -1}, inertia},
                 {{-1, 0, 0}, inertia}, {{0.6, 0.48, -0.64}, equal}, {{0, -1, 0}, equal}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        for (int off = 0; off < 2; off++) {
            bst_tumbling *t;
            bst_vec3 w = bst_vec3_scale(cases[k].axis, 0.2);
            w.y += off ? 2e-7 : 0.0;
            bst_assert_ok(&ctx, bst_tumbling_create(&ctx, cases[k].inertia, w, &t));
            for (double s = -40.0; s < 60.0; s += 7.0) {
                bst_vec3 got = bst_quat_rotate(bst_tumbling_at(t, s, NULL), star);
                bst_vec3 want = seen_after(BST_QUAT_IDENTITY, cases[k].axis, 0.2 * s, star);
                bst_assert_close(bst_vec3_angle(got, want), 0.0, off ? 2e-5 : 1e-7);
            }
            bst_tumbling_free(t);
        }
    }
}

/* Rows at uneven times, one of them with the other sign: turned evenly between them, held outside;
 * the fastest within a minute. */
static void rows_are_followed_at_even_rates(void **state) {
    (void)state;
    const bst_vec3 axis = {2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0};
    const double at_s[5] = {10.0, 20.0, 50.0, 55.0, 500.0}, turned[5] = {0, 0.2, 0.5, 0.9, 1.0};
    bst_quat start = bst_quat_unit((bst_quat){0.3, -0.1, 0.5, 0.8});
    bst_attitude_row rows[5];
    for (int i = 0; i < 5; i++) {
        bst_quat q = bst_quat_unit(bst_quat_turn_frame(start, bst_vec3_scale(axis, turned[i])));
        double sign = i == 2 ? -1.0 : 1.0;
        rows[i] = (bst_attitude_row){at_s[i], {sign * q.x, sign * q.y, sign * q.z, sign * q.w}};
    }
    const double when[][2] = {{0.0, 0.0},   {10.0, 0.0}, {14.0, 0.08},  {20.0, 0.2},  {35.0, 0.35},
                              {52.0, 0.66}, {55.0, 0.9}, {277.5, 0.95}, {500.0, 1.0}, {900.0, 1.0}};
    for (size_t k = 0; k < sizeof when / sizeof *when; k++) {
        bst_vec3 got = bst_quat_rotate(bst_attitude_table_at(rows, 5, when[k][0]), star);
        bst_assert_close(bst_vec3_angle(got, seen_after(start, axis, when[k][1], star)), 0.0, 1e-7);
    }
    bst_vec3 one = bst_quat_rotate(bst_attitude_table_at(rows, 1, 700.0), star);
    bst_assert_close(bst_vec3_angle(one, bst_quat_rotate(start, star)), 0.0, 1e-7);
    /* 0.02, 0.01, 0.08 and 0.1 / 445 rad/s */
    const double rates[][2] = {{-45.0, 0.02}, {-51.0, 0.0},  {-11.0, 0.02},        {-10.0, 0.08},
                               {30.0, 0.08},  {114.0, 0.08}, {116.0, 0.1 / 445.0}, {561.0, 0.0}};
    for (size_t k = 0; k < sizeof rates / sizeof *rates; k++) {
        bst_assert_close(bst_attitude_table_rate_radps(rows, 5, rates[k][0]), rates[k][1], 1e-7);
    }
}

/* Rows that a table may not have, each with one beside it that it may. */
static void rows_ascend_and_are_unit_quaternions(void **state) {
    (void)state;
    static const struct {
        const char *row;
        bool good;
    } cases[] = {{"12.5, 0.6, 0, 0, 0.8", true},    {"12, 0.6, 0, 0, 0.8", false},
                 {"11.9, 0.6, 0, 0, 0.8", false},   {"12.5, 0, 0.6, 0.8, 0", true},
                 {"12.5, 0.6, 0, 0, 0.8009", true}, {"12.5, 0.6, 0, 0, 0.8013", false},
                 {"12.5, 0.6, 0, 0, 0.7991", true}, {"12.5, 0.6, 0, 0, 0.7987", false},
                 {"1e9, 0.6, 0, 0, 0.8", true},     {"1.01e9, 0.6, 0, 0, 0.8", false},
                 {"12.5, 0.6, 0, 0", false},        {"12.5, 0.6, 0, 0, 0.8, 1", false},
                 {"12.5, 0.6, nan, 0, 0.8", false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[BST_TEST_PATH];
        bst_test_template(path, "attitude");
        int handle = mkstemp(path);
        assert_true(handle >= 0);
        FILE *file = fdopen(handle, "w");
        assert_non_null(file);
        fprintf(file, "time_s, qx, qy, qz, qw\n12, 0, 0, 1, 0\n%s\n", cases[k].row);
        assert_int_equal(fclose(file), 0);
        bst_ctx ctx = {0};
        bst_attitude_row *rows;
        int count;
        bst_status status = bst_attitude_table_load(&ctx, &from, path, "", &rows, &count);
        (void)remove(path);
        assert_int_equal(status, cases[k].good ? BST_OK : BST_ERR_CONFIG);
        if (cases[k].good) {
            assert_int_equal(count, 2);
            assert_true(rows[1].seconds == strtod(cases[k].row, NULL));
            free(rows);
        } else {
            assert_non_null(strstr(ctx.message, "line 3"));
        }
    }
}

/* From its time on a command turns the body about its own axes, until the next one; of more than
 * there is room for the latest are kept. */
static void commands_hold_until_the_next(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_commanded_attitude *ring;
    bst_assert_ok(&ctx, bst_commanded_attitude_create(&ctx, &ring));
    bst_quat q, first = bst_quat_unit((bst_quat){0.1, 0.2, -0.3, 0.9}),
                second = bst_quat_unit((bst_quat){-0.5, 0.2, 0.1, 0.4});
    const bst_vec3 rates[2] = {{0.02, -0.01, 0.02}, {-0.006, 0.0, 0.008}};
    double rate;
    assert_false(bst_commanded_attitude_at(ring, 5.0, &q, &rate));
    bst_assert_ok(&ctx, bst_commanded_attitude_add(&ctx, ring, 10.0, first, rates[0]));
    bst_assert_ok(&ctx, bst_commanded_attitude_add(&ctx, ring, 30.0, second, rates[1]));
    assert_int_equal(bst_commanded_attitude_add(&ctx, ring, 30.0, first, rates[0]),
                     BST_ERR_ARGUMENT);
    assert_false(bst_commanded_attitude_at(ring, 9.99, &q, &rate));
    for (double t = 10.0; t < 60.0; t += 4.0) {
        bool late = t >= 30.0;
        assert_true(bst_commanded_attitude_at(ring, t, &q, &rate));
        double size = late ? 0.01 : 0.03;
        bst_vec3 axis = bst_vec3_scale(rates[late], 1.0 / size);
        bst_vec3 want =
            seen_after(late ? second : first, axis, size * (t - (late ? 30 : 10)), star);
        bst_assert_close(bst_vec3_angle(bst_quat_rotate(q, star), want), 0.0, 1e-7);
        bst_assert_close(rate, size, 1e-12);
    }
    for (int i = 1; i <= 4096; i++) {
        bst_vec3 about_x = {1e-3 * i, 0.0, 0.0};
        bst_assert_ok(&ctx, bst_commanded_attitude_add(&ctx, ring, 30.0 + i, first, about_x));
    }
    assert_true(bst_commanded_attitude_at(ring, 32.5, &q, &rate));
    bst_assert_close(rate, 2e-3, 1e-12);
    assert_true(bst_commanded_attitude_at(ring, 4126.5, &q, &rate));
    bst_assert_close(rate, 4.096, 1e-12);
    bst_commanded_attitude_free(ring);
}

/* Largest rate of each law: that of a spin, of a tumbling body's energy about its smallest axis, of
 * a command where one holds. */
static void rates_of_the_laws(void **state) {
    (void)state;
    bst_attitude_config c[3] = {
        {.from_s = -1e9, .law = BST_ATTITUDE_SUN},
        {.from_s = 50, .law = BST_ATTITUDE_SPIN, .rate_body_deg_per_s = {1, -2, 2}},
        {.from_s = 90,
         .law = BST_ATTITUDE_TUMBLE,
         .rate_body_deg_per_s = {0, 4, 3},
         .inertia_kg_m2 = {2, 1.6, 2.5}}};
    bst_ctx ctx = {0};
    bst_body_attitude *a;
    const bst_config_list list = {c, 3};
    bst_assert_ok(&ctx, bst_body_attitude_create(&ctx, &list, &from, &a));
    bst_assert_close(bst_body_attitude_rate_radps(a, 49.9), 0.0, 0.0);
    bst_assert_close(bst_body_attitude_rate_radps(a, 50.0), 3.0 * BST_DEG_RAD, 1e-12);
    bst_assert_close(bst_body_attitude_rate_radps(a, 90.0), 5.0 * BST_DEG_RAD * 1.25, 1e-12);
    bst_assert_ok(&ctx, bst_body_attitude_accept(&ctx, a));
    bst_assert_close(bst_body_attitude_rate_radps(a, 95.0), 5.0 * BST_DEG_RAD * 1.25, 1e-12);
    bst_assert_ok(&ctx, bst_commanded_attitude_add(&ctx, bst_body_attitude_commands(a), 92.0,
                                                   BST_QUAT_IDENTITY, (bst_vec3){0.3, 0.4, 0.0}));
    bst_assert_close(bst_body_attitude_rate_radps(a, 95.0), 0.5, 1e-12);
    bst_assert_close(bst_body_attitude_rate_radps(a, 91.0), 5.0 * BST_DEG_RAD * 1.25, 1e-12);
    bst_body_attitude_free(a);
}

/* A steady torque about one body axis, from rest: half of torque over its own moment, times the
 * time squared. */
static bool steady(void *user, const bst_attitude_config *phase, double seconds, bst_quat q,
                   bst_vec3 *torque_nm) {
    (void)seconds;
    (void)q;
    assert_true(phase->torques.drag);
    *torque_nm = *(const bst_vec3 *)user;
    return true;
}

static void torques_turn_by_their_own_moment(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_vec3 torques[3] = {{0.02, 0, 0}, {0, -0.03, 0}, {0, 0, 0.04}};
    for (int axis = 0; axis < 3; axis++) {
        bst_attitude_config c = {.from_s = 10,
                                 .law = BST_ATTITUDE_TUMBLE,
                                 .quaternion = {0, 0, 0, 1},
                                 .inertia_kg_m2 = {100, 250, 300},
                                 .torques = {.drag = true, .tolerance_rad = 1e-4}};
        bst_vec3 torque = torques[axis];
        bst_config_list list = {&c, 1};
        bst_body_attitude *a;
        bst_assert_ok(&ctx, bst_body_attitude_create(&ctx, &list, &from, &a));
        assert_true(bst_body_attitude_has_torques(a));
        bst_assert_ok(&ctx, bst_body_attitude_set_torque(&ctx, a, steady, &torque));
        bst_attitude_state s = {{7e6, 1e5, -2e5}, {-100, 7000, 2000}, {0.36, 0.48, 0.8}, 10 + 60};
        bst_vec3 turn = bst_quat_to_rotvec(bst_body_attitude_at(a, &s));
        const double got[3] = {turn.x, turn.y, turn.z}, moment[3] = {torque.x, torque.y, torque.z};
        for (int k = 0; k < 3; k++) {
            /* a rotation of coordinates: against that of the body; tolerance of a day */
            bst_assert_close(fabs(got[k]), fabs(0.5 * moment[k] / inertia[k] * 60 * 60), 1e-4);
        }
        bst_body_attitude_free(a);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tumbling_keeps_energy_and_momentum),
        cmocka_unit_test(symmetric_top_has_its_closed_form),
        cmocka_unit_test(laws_point_their_axes),
        cmocka_unit_test(a_phase_continues_the_one_before),
        cmocka_unit_test(wrong_attitudes_are_refused),
        cmocka_unit_test(spins_are_even),
        cmocka_unit_test(rows_are_followed_at_even_rates),
        cmocka_unit_test(rows_ascend_and_are_unit_quaternions),
        cmocka_unit_test(commands_hold_until_the_next),
        cmocka_unit_test(rates_of_the_laws),
        cmocka_unit_test(torques_turn_by_their_own_moment),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
