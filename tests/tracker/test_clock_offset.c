/* Offset of the onboard clock: closed forms, the distribution of its error in random passes whose
 * orbits and positions have the stated errors, and geometries that show nothing. */
#include "boresight/rng.h"
#include "sim/astro/bodies.h"
#include "tests/test_support.h"
#include "tracker/clock_offset.h"

#define AS BST_ARCSEC_RAD

/* A circular orbit. */
typedef struct orbit {
    double radius_m, inclination, node, argument;
} orbit;

/* Axes of it at a time: radial, along, across. */
static void axes_at(const orbit *o, double t, bst_vec3 axes[3]) {
    double n = sqrt(BST_EARTH_MU_M3PS2 / o->radius_m) / o->radius_m, u = o->argument + n * t;
    double ci = cos(o->inclination), si = sin(o->inclination), cn = cos(o->node), sn = sin(o->node);
    bst_vec3 p = {cn, sn, 0.0}, q = {-sn * ci, cn * ci, si};
    axes[0] = bst_vec3_axpy(bst_vec3_scale(p, cos(u)), sin(u), q);
    axes[1] = bst_vec3_axpy(bst_vec3_scale(p, -sin(u)), cos(u), q);
    axes[2] = bst_vec3_cross(axes[0], axes[1]);
}

static bst_vec3 position_at(const orbit *o, double t, const double error_m[3]) {
    bst_vec3 axes[3];
    axes_at(o, t, axes);
    bst_vec3 r = bst_vec3_scale(axes[0], o->radius_m);
    for (int i = 0; i < 3; i++) {
        r = bst_vec3_axpy(r, error_m[i], axes[i]);
    }
    return r;
}

static bst_vec3 velocity_at(const orbit *o, double t) {
    bst_vec3 axes[3];
    axes_at(o, t, axes);
    return bst_vec3_scale(axes[1], sqrt(BST_EARTH_MU_M3PS2 / o->radius_m));
}

static const double exact[3];

static bst_clock_sight sight_at(int32_t object, const orbit *eye, const orbit *seen, double t,
                                double corrected_s) {
    bst_clock_sight s = {.object = object,
                         .object_m = position_at(seen, t, exact),
                         .object_mps = velocity_at(seen, t),
                         .observer_m = position_at(eye, t, exact),
                         .observer_mps = velocity_at(eye, t),
                         .corrected_s = corrected_s};
    bst_vec3 line = bst_vec3_sub(s.object_m, s.observer_m);
    s.range_m = bst_vec3_norm(line);
    s.direction = bst_vec3_unit(line);
    return s;
}

static bst_sky_measurement measured(bst_vec3 direction, double sigma_rad) {
    return (bst_sky_measurement){
        .direction = direction, .cov_11 = sigma_rad * sigma_rad, .cov_22 = sigma_rad * sigma_rad};
}

static const orbit low = {6.9e6, 1.7, 0.3, 0.4}, high = {42.164e6, 0.01, 0.2, 0.6};

/* One measurement of one object across its motion's plane: the weighted mean of prior and
 * measurement, whose error is that of the object and the observer in the direction of motion. */
static void one_measurement_is_a_weighted_mean(void **state) {
    (void)state;
    const bst_clock_params p = {1e-2, 150.0, 1.0, 40.0};
    const double sigma = 2.0 * AS, clock_s = 4e-3;
    bst_clock c = {.started = false};
    bst_clock_predict(&c, &p, 100.0);
    bst_clock_sight s = sight_at(3, &low, &high, 100.0 + clock_s, 0.0);
    bst_vec3 real = sight_at(3, &low, &high, 100.0, 0.0).direction;
    const bst_sky_measurement m = measured(real, sigma);
    assert_true(bst_clock_measure(&c, &p, &s, &m));
    bst_vec3 v = bst_vec3_sub(s.object_mps, s.observer_mps);
    double rate = bst_vec3_norm(bst_tangent_project(s.direction, v)) / s.range_m;
    double variance = (pow(150.0, 2) + pow(40.0, 2)) / pow(s.range_m, 2) + sigma * sigma;
    double expected = 1.0 / (1e4 + rate * rate / variance);
    bst_assert_close(bst_clock_sigma_s(&c, &p), sqrt(expected), 1e-6 * sqrt(expected));
    bst_assert_close(c.state[0], clock_s * expected * rate * rate / variance, 1e-6 * clock_s);
    assert_int_equal(c.measurements, 1);
}

/* Correlated errors of a measurement: any axes give the same. */
static void covariance_of_a_measurement_counts_whole(void **state) {
    (void)state;
    const bst_clock_params p = {1e-2, 20.0, 1.0, 10.0};
    bst_clock c = {.started = false};
    bst_clock_predict(&c, &p, 0.0);
    bst_clock_sight s = sight_at(0, &low, &high, 0.0, 0.0);
    const double a = pow(9.0 * AS, 2), b = pow(1.0 * AS, 2);
    bst_vec3 v = bst_vec3_sub(s.object_mps, s.observer_mps);
    bst_vec3 rate = bst_vec3_scale(bst_tangent_project(s.direction, v), 1.0 / s.range_m);
    bst_tangent at = bst_tangent_at(s.direction);
    double r1 = bst_vec3_dot(at.e1, rate), r2 = bst_vec3_dot(at.e2, rate), r = hypot(r1, r2);
    /* the long axis of the errors at 35 degrees from the motion */
    double turn = atan2(r2, r1) + 35.0 * BST_DEG_RAD, cs = cos(turn), sn = sin(turn);
    const bst_sky_measurement m = {.direction = s.direction,
                                   .cov_11 = a * cs * cs + b * sn * sn,
                                   .cov_12 = (a - b) * cs * sn,
                                   .cov_22 = a * sn * sn + b * cs * cs};
    assert_true(bst_clock_measure(&c, &p, &s, &m));
    double place = (20.0 * 20.0 + 10.0 * 10.0) / pow(s.range_m, 2);
    double along = pow(cos(35.0 * BST_DEG_RAD), 2) / (a + place) +
                   pow(sin(35.0 * BST_DEG_RAD), 2) / (b + place);
    double expected = 1.0 / (1e4 + r * r * along);
    bst_assert_close(bst_clock_sigma_s(&c, &p), sqrt(expected), 1e-6 * sqrt(expected));
}

typedef struct source {
    bst_rng_key key;
    uint64_t next;
} source;

static double uniform(source *s, double a, double b) {
    return a + (b - a) * bst_rng_uniform(s->key, 1, s->next++);
}
static double normal(source *s) {
    return bst_rng_normal(s->key, 2, s->next++);
}

/* An object that rises within 3000 km, or a distant one. */
static orbit any_orbit(source *s) {
    double kind = uniform(s, 0.0, 3.0);
    for (;;) {
        orbit o = {kind < 1.0   ? uniform(s, 42.0e6, 42.3e6)
                   : kind < 2.0 ? uniform(s, 2.6e7, 2.7e7)
                                : uniform(s, 7.3e6, 8.5e6),
                   uniform(s, 0.0, 2.0), uniform(s, 0.0, 6.28), uniform(s, 0.0, 6.28)};
        bst_vec3 eye = position_at(&low, 0.0, exact), seen = position_at(&o, 0.0, exact);
        double range = bst_vec3_norm(bst_vec3_sub(seen, eye));
        if (kind >= 2.0 ? range < 3e6 && range > 4e5 : bst_vec3_dot(eye, seen) > 0.0) {
            return o;
        }
    }
}

/* A pass of random objects, whose errors are drawn as stated. Returns the error of the offset in
 * units of its sigma. */
static double random_pass(uint64_t run, const bst_clock_params *p, double *sigma_s) {
    enum { MOST = 6, SECONDS = 60 };
    source s = {bst_rng_make_key(11, run, "test", "clock"), 0};
    const int count = 1 + (int)uniform(&s, 0.0, 6.0);
    const double clock_s = p->sigma_s * normal(&s), noise = 1.0 * AS;
    double error[MOST][3], own[3], used_s = 0.0;
    orbit orbits[MOST];
    for (int k = 0; k < count; k++) {
        orbits[k] = any_orbit(&s);
        for (int i = 0; i < 3; i++) {
            error[k][i] = p->object_sigma_m * normal(&s);
        }
    }
    for (int i = 0; i < 3; i++) {
        own[i] = p->observer_sigma_m * normal(&s);
    }
    bst_clock c = {.started = false};
    for (int t = 0; t < SECONDS; t++) {
        bst_clock_predict(&c, p, t);
        for (int k = 0; k < count; k++) {
            for (int i = 0; t > 0 && i < 3; i++) { /* random walks as stated */
                error[k][i] += sqrt(p->object_sigma_m * p->object_sigma_mps) * normal(&s);
                own[i] += k == 0 ? p->observer_sigma_m / sqrt(600.0) * normal(&s) : 0.0;
            }
            bst_vec3 line =
                bst_vec3_sub(position_at(&orbits[k], t, error[k]), position_at(&low, t, own));
            bst_vec3 d = bst_vec3_unit(line);
            bst_tangent at = bst_tangent_at(d);
            d = bst_tangent_exp(d, bst_tangent_vector(&at, noise * normal(&s), noise * normal(&s)));
            const bst_sky_measurement m = measured(d, noise);
            const bst_clock_sight sight =
                sight_at(k, &low, &orbits[k], t + clock_s - used_s, used_s);
            bst_clock_measure(&c, p, &sight, &m);
        }
        *sigma_s = bst_clock_sigma_s(&c, p);
        used_s = fabs(c.state[0] - used_s) > *sigma_s / 3.0 ? c.state[0] : used_s;
    }
    return (c.state[0] - clock_s) / *sigma_s;
}

/* The error has the stated variance: catalogued orbits and ones known to 10 m, offsets of seconds
 * and milliseconds. Limits: 99.9 % of chi-square with as many degrees of freedom as runs. */
static void stated_variance_is_that_of_the_error(void **state) {
    (void)state;
    enum { RUNS = 300 };
    const bst_clock_params cases[] = {
        {1.0, 1000.0, 0.5, 10.0}, {0.05, 10.0, 0.01, 5.0}, {3.0, 30.0, 0.01, 10.0}};
    for (int n = 0; n < 3; n++) {
        double sum = 0.0, mean_s = 0.0;
        for (int i = 0; i < RUNS; i++) {
            double sigma_s;
            double e = random_pass((uint64_t)(1000 * n + i), &cases[n], &sigma_s);
            sum += e * e;
            mean_s += sigma_s / RUNS;
        }
        printf("prior %g s, orbits %g m: mean sigma %.3g s, mean square of error/sigma %.3f\n",
               cases[n].sigma_s, cases[n].object_sigma_m, mean_s, sum / RUNS);
        assert_true(sum / RUNS > 0.75 && sum / RUNS < 1.29);
        assert_true(mean_s < 0.5 * cases[n].sigma_s);
    }
}

/* A neighbour on the same orbit hardly moves: the offset stays unknown, however long it is seen. */
static void what_does_not_move_shows_nothing(void **state) {
    (void)state;
    const bst_clock_params p = {0.5, 1000.0, 0.5, 10.0};
    const orbit next = {42.164e6, 0.01, 0.2, 0.61};
    bst_clock c = {.started = false};
    for (int t = 0; t < 3600; t++) {
        bst_clock_predict(&c, &p, t);
        const bst_clock_sight s = sight_at(0, &high, &next, t, 0.0);
        const bst_sky_measurement m = measured(s.direction, AS);
        assert_true(bst_clock_measure(&c, &p, &s, &m));
    }
    assert_true(bst_clock_sigma_s(&c, &p) > 0.49);
}

/* A day at one measurement a second: the covariance stays positive, and long tracking makes the
 * error of an object's orbit no smaller than what the geometry shows. */
static void covariance_stays_positive_for_a_day(void **state) {
    (void)state;
    const bst_clock_params p = {2.0, 50.0, 0.01, 10.0};
    bst_clock c = {.started = false};
    double start_s = 0.0;
    for (int t = 0; t < 86400; t += 2) {
        bst_clock_predict(&c, &p, t);
        int object = t / 600 % 40; /* more than have room */
        const orbit seen = {42.164e6, 0.01 + 0.001 * object, 0.2, 0.6 + 0.1 * object};
        const bst_clock_sight s = sight_at(object, &low, &seen, t + 0.3, 0.3);
        const bst_sky_measurement m = measured(s.direction, 0.3 * AS);
        bool used = bst_clock_measure(&c, &p, &s, &m);
        start_s = t == 600 ? c.state[0] : start_s;
        assert_true(used || t < 10);
    }
    static double l[BST_CLOCK_STATES][BST_CLOCK_STATES];
    for (int i = 0; i < BST_CLOCK_STATES; i++) { /* Cholesky, in units of each state's sigma */
        for (int k = 0; k <= i; k++) {
            double sum = c.covariance[i][k] / sqrt(c.covariance[i][i] * c.covariance[k][k]);
            for (int n = 0; n < k; n++) {
                sum -= l[i][n] * l[k][n];
            }
            assert_true(i != k || sum > 0.0);
            l[i][k] = i == k ? sqrt(sum) : sum / l[k][k];
        }
    }
    bst_assert_close(c.state[0], 0.3, 3.0 * bst_clock_sigma_s(&c, &p));
}

static void degenerate_sights_are_not_used(void **state) {
    (void)state;
    const bst_clock_params p = {0.5, 1000.0, 0.5, 10.0};
    bst_clock c = {.started = false};
    bst_clock_predict(&c, &p, 0.0);
    const bst_clock before = c;
    bst_clock_sight s = sight_at(0, &low, &high, 0.0, 0.0);
    bst_sky_measurement m = measured(s.direction, AS);
    bst_clock_sight near = s, falling = s;
    near.range_m = 1e4; /* 10 sigma */
    assert_false(bst_clock_measure(&c, &p, &near, &m));
    falling.object_mps = bst_vec3_scale(falling.object_m, 1e-4);
    assert_false(bst_clock_measure(&c, &p, &falling, &m));
    m.direction = bst_vec3_scale(s.direction, -1.0);
    assert_false(bst_clock_measure(&c, &p, &s, &m));
    m = measured(s.direction, 0.0);
    assert_false(bst_clock_measure(&c, &p, &s, &m));
    bst_tangent at = bst_tangent_at(s.direction);
    m = measured(bst_tangent_exp(s.direction, bst_vec3_scale(at.e1, BST_DEG_RAD)), AS);
    assert_false(bst_clock_measure(&c, &p, &s, &m)); /* another object's */
    bst_assert_close(c.state[0], before.state[0], 0.0);
    bst_assert_close(c.covariance[0][0], before.covariance[0][0], 0.0);
    assert_int_equal(c.measurements, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_measurement_is_a_weighted_mean),
        cmocka_unit_test(covariance_of_a_measurement_counts_whole),
        cmocka_unit_test(stated_variance_is_that_of_the_error),
        cmocka_unit_test(what_does_not_move_shows_nothing),
        cmocka_unit_test(covariance_stays_positive_for_a_day),
        cmocka_unit_test(degenerate_sights_are_not_used),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
