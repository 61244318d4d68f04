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

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(orbits_come_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
