/* Gooding's iteration on three directions of an orbit that is integrated here, light time included,
 * from ranges that are wrong by a tenth to a third. */
#include "tests/test_support.h"
#include "tracker/orbit/orbit_initial.h"

static const double LIGHT_MPS = 299792458.0;

typedef struct motion {
    bst_vec3 r, v;
} motion;

static bst_vec3 pull(bst_vec3 r) {
    double n = bst_vec3_norm(r);
    return bst_vec3_scale(r, -3.986004418e14 / (n * n * n));
}

/* Two-body motion by Runge and Kutta's fourth-order rule in steps of 2 s or less. */
static motion moved(motion m, double seconds) {
    int steps = 1 + (int)(fabs(seconds) / 2.0);
    double h = seconds / steps;
    for (int i = 0; i < steps; i++) {
        bst_vec3 v[4] = {m.v}, a[4] = {pull(m.r)};
        for (int k = 1; k < 4; k++) {
            double part = k < 3 ? 0.5 * h : h;
            v[k] = bst_vec3_axpy(m.v, part, a[k - 1]);
            a[k] = pull(bst_vec3_axpy(m.r, part, v[k - 1]));
        }
        for (int k = 0; k < 4; k++) {
            double w = h / (k % 3 ? 3.0 : 6.0);
            m.r = bst_vec3_axpy(m.r, w, v[k]);
            m.v = bst_vec3_axpy(m.v, w, a[k]);
        }
    }
    return m;
}

static void orbits_come_back(void **state) {
    (void)state;
    static const struct {
        motion at_middle;
        double times[3], wrong[2];
    } rows[] = {{{{7.4e6, -2.1e6, 1.3e6}, {2.3e3, 6.2e3, 3.1e3}}, {-140, 20, 190}, {1.12, 0.9}},
                {{{-1.9e7, 1.7e7, 9e6}, {-2.2e3, -2.4e3, 1.9e3}}, {-700, 0, 900}, {0.8, 0.85}},
                {{{3.9e7, 1.4e7, -5e6}, {-1.1e3, 2.8e3, 0.6e3}}, {-3600, 600, 2500}, {1.3, 1.25}}};
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        bst_od_observation o[3] = {{.cov_11 = 1e-12, .cov_22 = 1e-12},
                                   {.cov_11 = 1e-12, .cov_22 = 1e-12},
                                   {.cov_11 = 1e-12, .cov_22 = 1e-12}};
        double range[3];
        for (int i = 0; i < 3; i++) {
            double t = rows[k].times[i];
            motion eye = moved((motion){{1e6, 6.6e6, -2.2e6}, {-7.1e3, 1.0e3, 0.9e3}}, t);
            o[i].observer.time_s = 5000.0 + t;
            o[i].observer.position_m = eye.r;
            o[i].observer.velocity_mps = eye.v;
            double late = 0.0;
            for (int n = 0; n < 4; n++) {
                motion then = moved(rows[k].at_middle, t - rows[k].times[1] - late);
                bst_vec3 line = bst_vec3_sub(then.r, eye.r);
                range[i] = bst_vec3_norm(line);
                late = range[i] / LIGHT_MPS;
                o[i].direction = bst_vec3_unit(line);
            }
        }
        bst_ctx ctx = {0};
        bst_od_state got;
        const bst_lambert_way way = {.long_way = false}; /* arcs of less than half a turn */
        bst_assert_ok(&ctx, bst_od_gooding(&ctx, o, way, rows[k].wrong[0] * range[0],
                                           rows[k].wrong[1] * range[2], &got));
        bst_assert_close(got.time_s, 5000.0 + rows[k].times[1], 1e-9);
        /* directions are rounded to 1e-16, and short arcs magnify it */
        double off = bst_vec3_norm(bst_vec3_sub(got.position_m, rows[k].at_middle.r));
        bst_assert_close(off / bst_vec3_norm(rows[k].at_middle.r), 0.0, 1e-7);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(got.velocity_mps, rows[k].at_middle.v)) /
                             bst_vec3_norm(rows[k].at_middle.v),
                         0.0, 1e-6);
    }
}

/* Directions of a body that is integrated here, seen by a moving observer that stands still in the
 * barycentre's axes, light time included.
 *
 * Returned:  the time of emission, s from the middle */
static double observe(const motion *body, const motion *eye, double t, bst_od_observation *out) {
    const motion now = moved(*eye, t);
    double late = 0.0;
    *out = (bst_od_observation){.cov_11 = 1e-12, .cov_22 = 1e-12};
    for (int n = 0; n < 4; n++) {
        bst_vec3 line = bst_vec3_sub(moved(*body, t - late).r, now.r);
        late = bst_vec3_norm(line) / LIGHT_MPS;
        out->direction = bst_vec3_unit(line);
    }
    out->observer.time_s = 5000.0 + t;
    out->observer.position_m = now.r;
    out->observer.velocity_mps = now.v;
    return t - late;
}

/* Candidates of the admissible region have the direction and the rate of one of the observations
 * for any range, so that a wrong axis shows in all of them; the rate is that of the polynomial
 * through the arc, right to its fourth order. RMS residuals are as directions integrated here give
 * them, per axis, over ten of the observations. */
static void candidates_have_direction_and_rate(void **state) {
    (void)state;
    enum { COUNT = 10 };
    const motion body = {{-1.9e7, 1.7e7, 9e6}, {-2.2e3, -2.4e3, 1.9e3}};
    const motion eye = {{1e6, 6.6e6, -2.2e6}, {-7.1e3, 1.0e3, 0.9e3}};
    bst_od_observation o[COUNT];
    bst_ctx ctx = {0};
    bst_od_candidate all[BST_OD_CANDIDATES];
    int found, admissible = 0;
    for (int i = 0; i < COUNT; i++) {
        observe(&body, &eye, -60.0 + 13.0 * i + (i % 3), &o[i]);
    }
    bst_assert_ok(&ctx, bst_od_initial(&ctx, o, COUNT, all, &found));
    for (int n = 0; n < found; n++) {
        const motion m = {all[n].state.position_m, all[n].state.velocity_mps};
        double sum = 0.0;
        for (int i = 0; i < COUNT; i++) {
            bst_od_observation seen;
            const motion there = moved(m, 5000.0 - all[n].state.time_s); /* at the middle */
            observe(&there, &eye, o[i].observer.time_s - 5000.0, &seen);
            sum += pow(bst_vec3_angle(seen.direction, o[i].direction), 2);
        }
        /* rounding of directions, and steps of the integration */
        bst_assert_close(all[n].rms_rad, sqrt(sum / (2.0 * COUNT)), 1e-3 * all[n].rms_rad + 1e-9);
        assert_true(n == 0 || all[n].rms_rad >= all[n - 1].rms_rad);
        if (all[n].method != BST_OD_ADMISSIBLE) {
            continue;
        }
        admissible++;
        int of = -1;
        for (int i = 0; i < COUNT; i++) {
            double range = bst_vec3_norm(bst_vec3_sub(m.r, o[i].observer.position_m));
            if (fabs(all[n].state.time_s + range / LIGHT_MPS - o[i].observer.time_s) < 1e-6) {
                of = i;
            }
        }
        assert_true(of >= 0);
        bst_vec3 line = bst_vec3_sub(m.r, o[of].observer.position_m);
        bst_vec3 v = bst_vec3_sub(m.v, o[of].observer.velocity_mps);
        bst_vec3 q = bst_vec3_unit(line);
        bst_assert_close(bst_vec3_angle(q, o[of].direction), 0.0, 1e-6);
        bst_vec3 rate =
            bst_vec3_scale(bst_vec3_axpy(v, -bst_vec3_dot(v, q), q), 1.0 / bst_vec3_norm(line));
        bst_od_observation side[2];
        double t = o[of].observer.time_s - 5000.0;
        observe(&body, &eye, t + 1.0, &side[0]);
        observe(&body, &eye, t - 1.0, &side[1]);
        bst_vec3 truth = bst_vec3_scale(bst_vec3_sub(side[0].direction, side[1].direction), 0.5);
        /* the rate of directions, which is that of the body at emission to v / c */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(rate, truth)) / bst_vec3_norm(truth), 0.0,
                         1e-3);
    }
    print_message("%d candidates, %d of the admissible region\n", found, admissible);
    assert_true(admissible >= 3);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(orbits_come_back),
                                       cmocka_unit_test(candidates_have_direction_and_rate)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
