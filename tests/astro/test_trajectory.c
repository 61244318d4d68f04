/* Integrated orbits against closed forms and an integrator of another kind. */
#include "sim/astro/trajectory.h"

#include <stdlib.h>
#include <threads.h>

#include "sim/astro/atmosphere.h"
#include "sim/astro/bodies.h"
#include "sim/astro/kepler.h"
#include "tests/test_support.h"

typedef struct orbit_state {
    bst_vec3 r, v;
} orbit_state;

typedef struct fixture {
    bst_ctx ctx;
    bst_gravity *point, *zonal, *field;
    bst_astro_eop *eop;
    bst_time epoch;
} fixture;

static fixture fx;

static int set_up(void **state) {
    (void)state;
    bst_assert_ok(&fx.ctx, bst_gravity_point(&fx.ctx, BST_EARTH_MU_M3PS2, &fx.point));
    bst_assert_ok(&fx.ctx, bst_gravity_builtin(&fx.ctx, 6, 0, &fx.zonal));
    bst_assert_ok(&fx.ctx, bst_gravity_builtin(&fx.ctx, 20, 20, &fx.field));
    bst_assert_ok(&fx.ctx, bst_astro_eop_builtin(&fx.ctx, &fx.eop));
    bst_assert_ok(&fx.ctx, bst_time_from_utc(&fx.ctx, "2022-06-16T22:10:00Z", &fx.epoch));
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    bst_gravity_free(fx.point);
    bst_gravity_free(fx.zonal);
    bst_gravity_free(fx.field);
    bst_astro_eop_free(fx.eop);
    return 0;
}

/* Perigee radius, eccentricity, inclination, true anomaly. */
static orbit_state conic(double q, double e, double inclination, double nu) {
    double p = q * (1 + e), r = p / (1 + e * cos(nu)), w = sqrt(BST_EARTH_MU_M3PS2 / p);
    double vx = -w * sin(nu), vy = w * (e + cos(nu)), c = cos(inclination), s = sin(inclination);
    return (orbit_state){{r * cos(nu), r * sin(nu) * c, r * sin(nu) * s}, {vx, vy * c, vy * s}};
}

static bst_force_model everything(void) {
    return (bst_force_model){.gravity = fx.field,
                             .eop = fx.eop,
                             .sun = true,
                             .moon = true,
                             .solar_pressure = true,
                             .drag = true,
                             .density_scale = 1,
                             .spacecraft = {500, 4, 2.2, 4, 1.3}};
}

static bst_trajectory *make(bst_force_model forces, double at_s, orbit_state s,
                            const bst_astro_thrust *burns, int count) {
    bst_trajectory_options o = {.forces = forces,
                                .epoch = fx.epoch,
                                .at_s = at_s,
                                .position_m = s.r,
                                .velocity_mps = s.v,
                                .burns = burns,
                                .burn_count = count};
    bst_trajectory *t;
    bst_assert_ok(&fx.ctx, bst_trajectory_create(&fx.ctx, &o, &t));
    return t;
}

static bst_trajectory *two_body(double at_s, orbit_state s, const bst_astro_thrust *burns,
                                int count) {
    return make((bst_force_model){.gravity = fx.point}, at_s, s, burns, count);
}

static orbit_state at(const bst_trajectory *t, double seconds) {
    orbit_state s;
    bst_assert_ok(&fx.ctx, bst_trajectory_state(&fx.ctx, t, seconds, &s.r, &s.v));
    return s;
}

static double distance(bst_vec3 a, bst_vec3 b) {
    return bst_vec3_norm(bst_vec3_sub(a, b));
}

/* Largest distance from the closed form between two times, at odd instants. */
static void against_closed_form(orbit_state start, double from_s, double to_s, double tolerance_m,
                                double tolerance_mps) {
    bst_trajectory *t = two_body(0, start, NULL, 0);
    for (int i = 0; i <= 997; i++) {
        double seconds = from_s + (to_s - from_s) * i / 997;
        orbit_state a = at(t, seconds), b;
        bst_assert_ok(&fx.ctx, bst_kepler_propagate(&fx.ctx, BST_EARTH_MU_M3PS2, start.r, start.v,
                                                    seconds, &b.r, &b.v));
        bst_assert_close(distance(a.r, b.r), 0, tolerance_m);
        bst_assert_close(distance(a.v, b.v), 0, tolerance_mps);
    }
    bst_trajectory_free(t);
}

/* The figure wanted is 1 mm; rounding of either side leaves 1e-6 m. */
static void a_day_of_two_bodies_is_the_closed_form(void **state) {
    (void)state;
    against_closed_form(conic(6.9e6, 0.01, 0.9, 0.3), 0, 86400, 1e-5, 1e-8);
    against_closed_form(conic(6.6e6, 0.73, 0.1, 2.0), 0, 86400, 1e-5, 1e-8);
    against_closed_form(conic(6.6e6, 0.73, 0.1, 2.0), 0, -86400, 1e-5, 1e-8);
    against_closed_form(conic(4.2164e7, 1e-4, 0, 0), -86400, 86400, 1e-5, 1e-9);
}

static void hard_conics_are_closed_form_too(void **state) {
    (void)state;
    /* e = 0.99 through the perigee twice: 5.9e6 s around; the perigee magnifies rounding of the
     * apogee's velocity a hundredfold */
    against_closed_form(conic(7e6, 0.99, 0.4, -2.5), 0, 6.5e6, 1e-3, 1e-6);
    /* straight over the pole */
    against_closed_form(conic(6.8e6, 0.02, BST_PI / 2, 0), 0, 20000, 1e-5, 1e-8);
    /* hyperbola from 1e8 m in and out again: rounding far out is magnified by the perigee */
    against_closed_form(conic(6.7e6, 1.8, 1.0, -2.05), -20000, 60000, 1e-4, 1e-7);
    /* far out, steps of 6 hours */
    against_closed_form(conic(3e8, 0.3, 0.2, 1.0), -1e6, 3e6, 1e-4, 1e-9);
}

static double energy(const bst_gravity *g, orbit_state s) {
    return 0.5 * bst_vec3_dot(s.v, s.v) - bst_gravity_potential(g, s.r);
}

static void energy_is_kept_for_ten_days(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        bst_gravity *g = k < 2 ? fx.point : fx.zonal;
        orbit_state start = k % 2 ? conic(6.6e6, 0.73, 0.5, 2.0) : conic(6.9e6, 0.01, 1.7, 0.3);
        /* without Earth orientation the axes of GCRF are the Earth's, and a zonal field keeps
         * energy and the angular momentum about the pole */
        bst_trajectory *t = make((bst_force_model){.gravity = g}, 0, start, NULL, 0);
        double e0 = energy(g, start), h0 = bst_vec3_cross(start.r, start.v).z;
        for (int i = 1; i <= 100; i++) {
            orbit_state s = at(t, 8640.0 * i);
            /* the figure wanted is 1e-11; rounding of the states leaves 1e-14 */
            bst_assert_close(energy(g, s) / e0, 1, 1e-13);
            bst_assert_close(bst_vec3_cross(s.r, s.v).z / h0, 1, 1e-13);
        }
        bst_trajectory_free(t);
    }
}

static void there_and_back_is_where_it_was(void **state) {
    (void)state;
    orbit_state start = conic(6.95e6, 0.01, 1.7, 0.3);
    bst_trajectory *t = make(everything(), 0, start, NULL, 0);
    orbit_state end = at(t, 4 * 86400.0);
    bst_trajectory *back = make(everything(), 4 * 86400.0, end, NULL, 0);
    /* rounding and the edges of 120 shadows, to 1e-4 s of a push of 5e-8 m/s^2, four days long */
    bst_assert_close(distance(at(back, 0).r, start.r), 0, 1e-2);
    for (double day = 3.5; day > 0; day -= 1.5) {
        bst_assert_close(distance(at(back, day * 86400).r, at(t, day * 86400).r), 0, 1e-2);
    }
    bst_trajectory_free(t);
    bst_trajectory_free(back);
}

/* Classical Runge-Kutta, step h, with a thrust in turning axes between two times. */
typedef struct rocket {
    bst_forces *forces;
    bst_vec3 thrust_rtn;
    double from_s, to_s;
} rocket;

static orbit_state rate(const rocket *k, double t, orbit_state s) {
    bst_vec3 a;
    bst_assert_ok(&fx.ctx, bst_forces_at(&fx.ctx, k->forces, t, s.r, s.v, &a));
    if (t >= k->from_s && t <= k->to_s) {
        bst_vec3 r = bst_vec3_unit(s.r), n = bst_vec3_unit(bst_vec3_cross(s.r, s.v));
        bst_vec3 u = bst_vec3_cross(n, r), c = k->thrust_rtn;
        a = bst_vec3_axpy(bst_vec3_axpy(bst_vec3_axpy(a, c.x, r), c.y, u), c.z, n);
    }
    return (orbit_state){s.v, a};
}

static orbit_state moved(orbit_state s, double h, orbit_state d) {
    return (orbit_state){bst_vec3_axpy(s.r, h, d.r), bst_vec3_axpy(s.v, h, d.v)};
}

static orbit_state runge_kutta(const rocket *k, orbit_state s, double from_s, double to_s,
                               int steps) {
    double h = (to_s - from_s) / steps;
    for (int i = 0; i < steps; i++) {
        double t = from_s + h * i, inside = 1e-9; /* edges fall on steps: stay on one side */
        orbit_state a = rate(k, t + inside, s), b = rate(k, t + h / 2, moved(s, h / 2, a));
        orbit_state c = rate(k, t + h / 2, moved(s, h / 2, b));
        orbit_state d = rate(k, t + h - inside, moved(s, h, c));
        s.r = bst_vec3_axpy(
            s.r, h / 6,
            bst_vec3_add(bst_vec3_add(a.r, d.r), bst_vec3_scale(bst_vec3_add(b.r, c.r), 2)));
        s.v = bst_vec3_axpy(
            s.v, h / 6,
            bst_vec3_add(bst_vec3_add(a.v, d.v), bst_vec3_scale(bst_vec3_add(b.v, c.v), 2)));
    }
    return s;
}

static void all_forces_and_a_long_burn_agree_with_runge_kutta(void **state) {
    (void)state;
    orbit_state start = conic(6.75e6, 0.001, 0.9, 0.3);
    bst_force_model model = everything();
    rocket k = {NULL, {0.01, -0.02, 0.03}, 1000, 1600};
    bst_assert_ok(&fx.ctx, bst_forces_create(&fx.ctx, &model, fx.epoch, &k.forces));
    bst_astro_thrust burn = {1000, 600, {6, -12, 18}};
    bst_trajectory *t = make(model, 0, start, &burn, 1);
    /* an hour and a half, through the shadow: steps of 1 s leave (n h)^4 of it, 1e-5 m */
    orbit_state expected = runge_kutta(&k, start, 0, 5400, 5400);
    orbit_state s = at(t, 5400);
    bst_assert_close(distance(s.r, expected.r), 0, 2e-4);
    bst_assert_close(distance(s.v, expected.v), 0, 2e-7);
    /* in the middle of the burn */
    expected = runge_kutta(&k, start, 0, 1300, 1300);
    bst_assert_close(distance(at(t, 1300).r, expected.r), 0, 2e-4);
    bst_trajectory_free(t);
    bst_forces_free(k.forces);
}

static void a_finer_tolerance_changes_little(void **state) {
    (void)state;
    const orbit_state starts[3] = {conic(7e6, 0.001, 1.7, 0.3), conic(6.62e6, 0.73, 0.3, 1.0),
                                   conic(4.2164e7, 1e-4, 0, 0)};
    for (int k = 0; k < 3; k++) {
        bst_trajectory_options o = {.forces = everything(),
                                    .epoch = fx.epoch,
                                    .position_m = starts[k].r,
                                    .velocity_mps = starts[k].v};
        bst_trajectory *usual, *fine;
        bst_assert_ok(&fx.ctx, bst_trajectory_create(&fx.ctx, &o, &usual));
        o.tolerance = 1e-11;
        bst_assert_ok(&fx.ctx, bst_trajectory_create(&fx.ctx, &o, &fine));
        for (int i = 0; i <= 300; i++) {
            double seconds = 86400.0 * i / 300;
            /* a day; 1e-5 to 1e-4 m was measured, most of it at the shadow's edges */
            bst_assert_close(distance(at(usual, seconds).r, at(fine, seconds).r), 0, 1e-3);
        }
        bst_trajectory_free(usual);
        bst_trajectory_free(fine);
    }
}

static void impulses_act_right_when_they_are_due(void **state) {
    (void)state;
    orbit_state start = conic(7e6, 0.01, 0.9, 0.3);
    const bst_astro_thrust burns[2] = {{500, 0, {1, 2, 3}}, {500, 0, {0, 10, 0}}};
    bst_trajectory *plain = two_body(0, start, NULL, 0), *burnt = two_body(0, start, burns, 2);
    orbit_state before = at(plain, 500), after = at(burnt, 500);
    /* rounding */
    bst_assert_close(distance(before.r, after.r), 0, 1e-7);
    bst_vec3 r = bst_vec3_unit(before.r), n = bst_vec3_unit(bst_vec3_cross(before.r, before.v));
    bst_vec3 t = bst_vec3_cross(n, r), dv = bst_vec3_sub(after.v, before.v);
    bst_assert_close(bst_vec3_dot(dv, r), 1, 1e-9);
    /* the second in the axes that the first has turned by 3 / 7600 */
    bst_assert_close(bst_vec3_dot(dv, t), 2 + 10 * cos(3.0 / 7600), 1e-5);
    bst_assert_close(bst_vec3_dot(dv, n), 3 + 10 * sin(3.0 / 7600), 1e-4);
    double just_before = nextafter(500, 0);
    bst_assert_close(distance(at(burnt, just_before).v, at(plain, just_before).v), 0, 1e-9);
    /* one at the very time of the initial state comes after it */
    const bst_astro_thrust now = {0, 0, {0, 5, 0}};
    bst_trajectory *t0 = two_body(0, start, &now, 1);
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(at(t0, 0).v, start.v)), 5, 1e-9);
    bst_assert_close(distance(at(t0, -100).r, at(plain, -100).r), 0, 1e-7);
    bst_trajectory_free(plain);
    bst_trajectory_free(burnt);
    bst_trajectory_free(t0);
}

static void a_short_burn_is_an_impulse_in_the_limit(void **state) {
    (void)state;
    orbit_state start = conic(7e6, 0.01, 0.9, 0.3);
    /* in the plane, whose axes it does not turn */
    const bst_astro_thrust impulse = {500, 0, {1, 2, 0}};
    bst_trajectory *expected = two_body(0, start, &impulse, 1);
    for (double duration = 1e-12; duration < 10; duration *= 1e3) {
        const bst_astro_thrust burn = {500 - duration / 2, duration, {1, 2, 0}};
        bst_trajectory *t = two_body(0, start, &burn, 1);
        /* a centred burn differs in the second order: n^2 d^2 of 4 m/s over 1000 s, and by the
         * rounding of its place in time */
        bst_assert_close(distance(at(t, 1500).r, at(expected, 1500).r), 0,
                         1e-5 + 1e-2 * duration * duration);
        bst_trajectory_free(t);
    }
    /* a burn without effect, and one in two halves with another across them */
    const bst_astro_thrust nothing[2] = {{500, 100, {0, 0, 0}}, {700, 0, {0, 0, 0}}};
    bst_trajectory *same = two_body(0, start, nothing, 2), *plain = two_body(0, start, NULL, 0);
    bst_assert_close(distance(at(same, 3000).r, at(plain, 3000).r), 0, 1e-7);
    const bst_astro_thrust whole[2] = {{500, 200, {2, 4, 6}}, {550, 100, {1, 0, 0}}};
    const bst_astro_thrust halves[3] = {
        {550, 100, {1, 0, 0}}, {600, 100, {1, 2, 3}}, {500, 100, {1, 2, 3}}};
    bst_trajectory *a = two_body(0, start, whole, 2), *b = two_body(0, start, halves, 3);
    bst_assert_close(distance(at(a, 3000).r, at(b, 3000).r), 0, 1e-6);
    bst_trajectory_free(a);
    bst_trajectory_free(b);
    bst_trajectory_free(same);
    bst_trajectory_free(plain);
    bst_trajectory_free(expected);
}

static void burns_are_undone_on_the_way_back(void **state) {
    (void)state;
    orbit_state start = conic(7e6, 0.01, 0.9, 0.3);
    const bst_astro_thrust burns[5] = {{500, 0, {10, -20, 30}},
                                       {500, 0, {-7, 40, 90}}, /* in the axes after the first */
                                       {1000, 300, {5, 6, -7}},
                                       {2000, 0, {0, -16000, 50}}, /* turns the orbit round */
                                       {2500, 0, {-3, 2, 1}}};
    bst_trajectory *t = two_body(0, start, burns, 5);
    for (double from = 450; from < 3000; from += 800) {
        bst_trajectory *back = two_body(from, at(t, from), burns, 5);
        for (double seconds = 0; seconds < 3000; seconds += 100) {
            if (seconds > from && from < 2000) {
                continue; /* and forward again, checked by the others */
            }
            /* rounding, magnified by two burns' axes */
            bst_assert_close(distance(at(back, seconds).r, at(t, seconds).r), 0, 1e-5);
            bst_assert_close(distance(at(back, seconds).v, at(t, seconds).v), 0, 1e-7);
        }
        bst_trajectory_free(back);
    }
    bst_trajectory_free(t);
}

enum { QUERIES = 400 };
static double query(int i) { /* all over 40 days, both ways of the start */
    return 86400.0 * (((i * 7919) % 1009) / 1009.0 * 50.0 - 10.0) + (i % 3 == 0 ? 0.125 : 0.0);
}

static void states_do_not_depend_on_the_order_of_questions(void **state) {
    (void)state;
    orbit_state start = conic(2e7, 0.2, 0.9, 0.3);
    const bst_astro_thrust burns[3] = {
        {-86400, 0, {1, 0, 0}}, {86400, 3600, {0, 1, 0}}, {2e6, 0, {0, 0, 1}}};
    bst_trajectory *jumps = two_body(0, start, burns, 3), *run = two_body(0, start, burns, 3);
    orbit_state *ordered = calloc(1009, sizeof *ordered);
    assert_non_null(ordered);
    /* in order first, on another trajectory */
    for (int rank = 0; rank < 1009; rank++) {
        for (int i = 0; i < QUERIES; i++) {
            if ((i * 7919) % 1009 == rank) {
                ordered[i] = at(run, query(i));
            }
        }
    }
    for (int i = 0; i < QUERIES; i++) {
        orbit_state s = at(jumps, query(i));
        assert_memory_equal(&s, &ordered[i], sizeof s);
    }
    free(ordered);
    bst_trajectory_free(jumps);
    bst_trajectory_free(run);
}

typedef struct asker {
    const bst_trajectory *trajectory;
    int first;
    orbit_state answers[QUERIES];
    bst_status status;
} asker;

static int ask(void *user) {
    asker *a = user;
    bst_ctx ctx = {0};
    for (int i = 0; i < QUERIES && a->status == BST_OK; i++) {
        int k = (i + a->first) % QUERIES;
        a->status = bst_trajectory_state(&ctx, a->trajectory, query(k) / 50, &a->answers[k].r,
                                         &a->answers[k].v);
    }
    return 0;
}

static void threads_may_share_one(void **state) {
    (void)state;
    enum { THREADS = 4 };
    bst_trajectory *t = make(everything(), 0, conic(7e6, 0.01, 0.9, 0.3), NULL, 0);
    asker *askers = calloc(THREADS, sizeof *askers);
    assert_non_null(askers);
    thrd_t threads[THREADS];
    for (int i = 0; i < THREADS; i++) {
        askers[i].trajectory = t;
        askers[i].first = i * QUERIES / THREADS;
        assert_int_equal(thrd_create(&threads[i], ask, &askers[i]), thrd_success);
    }
    for (int i = 0; i < THREADS; i++) {
        thrd_join(threads[i], NULL);
        assert_int_equal(askers[i].status, BST_OK);
        assert_memory_equal(askers[i].answers, askers[0].answers, sizeof askers[0].answers);
    }
    free(askers);
    bst_trajectory_free(t);
}

static void an_orbit_that_decays_ends(void **state) {
    (void)state;
    orbit_state start = conic(6378137 + 150e3, 0.0005, 0.9, 0.3);
    bst_trajectory *t = make(everything(), 0, start, NULL, 0);
    double low = 0, high = 86400 * 3;
    orbit_state s;
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, high, &s.r, &s.v), BST_ERR_NUMERIC);
    double end_s;
    assert_int_equal(
        sscanf(fx.ctx.message, "the orbit passes below 80 km, %lf s after the epoch", &end_s), 1);
    while (high - low > 1e-3) {
        double middle = 0.5 * (low + high);
        if (bst_trajectory_state(&fx.ctx, t, middle, &s.r, &s.v) == BST_OK) {
            low = middle;
        } else {
            high = middle;
        }
    }
    bst_assert_close(low, end_s, 0.06); /* as printed */
    s = at(t, low);
    /* found to 1e-4 s of a fall of 100 m/s and more */
    bst_assert_close(bst_astro_height_m(s.r), 80e3, 1);
    /* what was before is still there, in any order */
    orbit_state first = at(t, 1000);
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, 1e7, &s.r, &s.v), BST_ERR_NUMERIC);
    orbit_state again = at(t, 1000);
    assert_memory_equal(&first, &again, sizeof first);
    bst_trajectory_free(t);
    /* an orbit that rose from the ground has no state before that */
    t = two_body(0, conic(6.2e6, 0.2, 0.3, 2.0), NULL, 0);
    (void)at(t, 0);
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, -86400, &s.r, &s.v), BST_ERR_NUMERIC);
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, 86400, &s.r, &s.v), BST_ERR_NUMERIC);
    bst_trajectory_free(t);
}

static void before_the_table_of_the_earth_s_rotation_there_is_nothing(void **state) {
    (void)state;
    bst_trajectory *t = make(everything(), -7.755e7, conic(7e6, 0.01, 0.9, 0.3), NULL, 0);
    orbit_state s; /* the table begins on 2020-01-01, 7.758e7 s before the epoch */
    (void)at(t, -7.7555e7);
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, -7.87e7, &s.r, &s.v), BST_ERR_RANGE);
    (void)at(t, -7.7555e7);
    bst_trajectory_free(t);
}

static void wrong_arguments_are_refused(void **state) {
    (void)state;
    orbit_state start = conic(7e6, 0.01, 0.9, 0.3);
    const bst_trajectory_options good = {.forces = {.gravity = fx.point},
                                         .epoch = fx.epoch,
                                         .position_m = start.r,
                                         .velocity_mps = start.v};
    bst_trajectory *t;
    bst_trajectory_options o = good;
    o.velocity_mps.y = NAN;
    assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
    assert_null(t);
    o = good;
    o.position_m = (bst_vec3){6378137 + 79e3, 0, 0};
    assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
    assert_string_equal(fx.ctx.message,
                        "the initial state lies at a height of 79.0 km, orbits end below 80 km");
    o = good;
    o.tolerance = 1e-12;
    assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
    assert_string_equal(fx.ctx.message, "tolerance 1e-12 of an orbit (allowed: 1e-11 to 1e-3)");
    o = good;
    const bst_astro_thrust none = {0, 0, {0, 0, 0}};
    const bst_astro_thrust wrong[] = {{0, -1, {0, 0, 0}},        {0, 2e10, {0, 0, 0}},
                                      {-2e10, 0, {0, 0, 0}},     {2e10, 0, {0, 0, 0}},
                                      {0, 0, {NAN, 0, 0}},       {0, 0, {0, INFINITY, 0}},
                                      {0, 0, {0, 0, -INFINITY}}, {NAN, 0, {0, 0, 0}}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        const bst_astro_thrust burns[] = {none, wrong[i]};
        o.burns = burns;
        o.burn_count = 2;
        assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
        assert_int_equal(strncmp(fx.ctx.message, "burn 1:", 7), 0);
    }
    const struct {
        bst_vec3 position_m, velocity_mps;
        double at_s;
    } bad[] = {{{INFINITY, 7e6, 0}, {0, 0, 0}, 0}, {{0, 7e6, NAN}, {0, 0, 0}, 0},
               {{7e6, 0, 0}, {NAN, 0, 0}, 0},      {{7e6, 0, 0}, {0, 0, INFINITY}, 0},
               {{7e6, 0, 0}, {0, 0, 0}, -2e10},    {{7e6, 0, 0}, {0, 0, 0}, NAN}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        o = good;
        o.position_m = bad[i].position_m;
        o.velocity_mps = bad[i].velocity_mps;
        o.at_s = bad[i].at_s;
        assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
        assert_int_equal(strncmp(fx.ctx.message, "the initial state of an orbit", 29), 0);
    }
    o = good;
    o.forces.drag = true;
    assert_int_equal(bst_trajectory_create(&fx.ctx, &o, &t), BST_ERR_ARGUMENT);
    bst_assert_ok(&fx.ctx, bst_trajectory_create(&fx.ctx, &good, &t));
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, NAN, &start.r, &start.v), BST_ERR_ARGUMENT);
    assert_int_equal(bst_trajectory_state(&fx.ctx, t, 2e10, &start.r, &start.v), BST_ERR_ARGUMENT);
    bst_trajectory_free(t);
    bst_trajectory_free(NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_day_of_two_bodies_is_the_closed_form),
        cmocka_unit_test(hard_conics_are_closed_form_too),
        cmocka_unit_test(energy_is_kept_for_ten_days),
        cmocka_unit_test(there_and_back_is_where_it_was),
        cmocka_unit_test(all_forces_and_a_long_burn_agree_with_runge_kutta),
        cmocka_unit_test(a_finer_tolerance_changes_little),
        cmocka_unit_test(impulses_act_right_when_they_are_due),
        cmocka_unit_test(a_short_burn_is_an_impulse_in_the_limit),
        cmocka_unit_test(burns_are_undone_on_the_way_back),
        cmocka_unit_test(states_do_not_depend_on_the_order_of_questions),
        cmocka_unit_test(threads_may_share_one),
        cmocka_unit_test(an_orbit_that_decays_ends),
        cmocka_unit_test(before_the_table_of_the_earth_s_rotation_there_is_nothing),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
