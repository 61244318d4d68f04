/* Orbits from angles where the object moves by SGP4: the state and its covariance against SGP4's
 * own places, over many draws. */
#include <stdlib.h>

#include "sim/astro/sgp4_fit.h"
#include "tests/tracker/orbit_scene.h"

enum { RUNS = 20, MOST = 240 };

static const bst_vec3 EARTH = {21000.0, -18500.0, -8000.0};

typedef struct fixture {
    bst_ctx ctx;
    bst_astro_eop *eop;
    bst_sky_clock *clock;
    bst_time epoch;
    bst_gravity *gravity;
    bst_sgp4 *eye;
    double eye_offset_s;
} fixture;

static fixture fx;

static bst_elements elements_of(int norad) {
    const bst_elements_options only = {.norad = norad};
    bst_elements *set, out;
    int count;
    bst_assert_ok(&fx.ctx, bst_elements_load(&fx.ctx, "scenarios/catalogue_2022-06.tle", &only,
                                             &set, &count));
    out = *set;
    free(set);
    return out;
}

static bst_sgp4 *open_set(int norad, double *offset_s) {
    bst_elements set = elements_of(norad);
    bst_time epoch;
    bst_sgp4 *out;
    bst_assert_ok(&fx.ctx,
                  bst_time_from_utc_jd(&fx.ctx, set.epoch_utc_jd1, set.epoch_utc_jd2, &epoch));
    *offset_s = bst_time_diff(fx.epoch, epoch);
    bst_assert_ok(&fx.ctx, bst_sgp4_create(&fx.ctx, &set, BST_SGP4_WGS72, BST_SGP4_IMPROVED, &out));
    return out;
}

/* SGP4's place in GCRF. */
static bst_vec3 place(const bst_sgp4 *sgp4, double offset_s, double t) {
    double r[3], v[3];
    bst_sky_rotation sky;
    assert_int_equal(bst_sgp4_propagate(sgp4, (offset_s + t) / 60.0, r, v), BST_SGP4_OK);
    bst_assert_ok(&fx.ctx, bst_sky_clock_at(&fx.ctx, fx.clock, bst_time_add(fx.epoch, t), &sky));
    return bst_vec3_scale(
        bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, (bst_vec3){r[0], r[1], r[2]}), 1e3);
}

/* Place, and its derivative by Richardson's extrapolation: 1e-6 m/s. */
static bst_od_state state_at(const bst_sgp4 *sgp4, double offset_s, double t) {
    bst_vec3 d[2];
    for (int i = 0; i < 2; i++) {
        double h = i ? 2.0 : 1.0;
        d[i] = bst_vec3_scale(
            bst_vec3_sub(place(sgp4, offset_s, t + h), place(sgp4, offset_s, t - h)), 0.5 / h);
    }
    return (bst_od_state){
        .time_s = t,
        .position_m = place(sgp4, offset_s, t),
        .velocity_mps = bst_vec3_axpy(bst_vec3_scale(d[0], 4.0 / 3.0), -1.0 / 3.0, d[1])};
}

static void sight(const bst_sgp4 *body, double offset_s, double t, int run, int i, double sigma_rad,
                  bst_od_observation *out) {
    bst_od_state here = state_at(fx.eye, fx.eye_offset_s, t);
    bst_vec3 line = {0};
    double tau = 0.0, noise[2];
    for (int k = 0; k < 5; k++) {
        bst_vec3 there = place(body, offset_s, t - tau);
        line = bst_vec3_axpy(bst_vec3_sub(there, here.position_m), -tau, EARTH);
        tau = bst_vec3_norm(line) / BST_LIGHT_SPEED_MPS;
    }
    bst_vec3 d = bst_vec3_unit(line);
    bst_rng_normal2(bst_rng_make_key(11, (uint64_t)run, "test", "sgp4"), (uint64_t)i, 0, noise);
    bst_tangent axes = bst_tangent_at(d);
    out[i] = (bst_od_observation){
        .observer = {t, here.position_m, here.velocity_mps, EARTH},
        .direction = bst_tangent_exp(
            d, bst_tangent_vector(&axes, sigma_rad * noise[0], sigma_rad * noise[1])),
        .cov_11 = sigma_rad * sigma_rad,
        .cov_22 = sigma_rad * sigma_rad};
}

typedef struct sums {
    double nees, chi2, dof;
} sums;

/* Draws of one arc, fitted with a motion from the true state on. */
static sums fit_all(int runs, int norad, double span_s, int count, double sigma_arcsec,
                    const bst_od_motion *motion) {
    static bst_od_observation items[MOST];
    sums out = {0};
    double offset_s;
    bst_sgp4 *body = open_set(norad, &offset_s);
    for (int run = 0; run < runs; run++) {
        for (int i = 0; i < count; i++) {
            sight(body, offset_s, span_s * i / (count - 1.0), run, i, sigma_arcsec * BST_ARCSEC_RAD,
                  items);
        }
        const bst_od_options options = {.motion = *motion, .scale_variance = true};
        bst_od_state first = state_at(body, offset_s, 0.5 * span_s);
        bst_od_solution got;
        bst_assert_ok(&fx.ctx, bst_od_fit(&fx.ctx, items, count, &options, &first, NULL, &got));
        bst_od_state truth = state_at(body, offset_s, got.state.time_s);
        double e[6];
        difference(&got.state, &truth, e);
        out.nees += normalised(e, (const double(*)[6])got.covariance);
        out.chi2 += got.chi2;
        out.dof += got.dof;
    }
    bst_sgp4_free(body);
    return out;
}

/* Within the central 95 % of chi-square (Wilson and Hilferty 1931: to 1e-3 of it here). */
static void assert_in_band(double chi2, double dof) {
    double d = 2.0 / (9.0 * dof), root = cbrt(chi2 / dof);
    assert_true(fabs(root - (1.0 - d)) < 1.96 * sqrt(d));
}

static void the_covariance_is_true(void **state) {
    (void)state;
    static const struct {
        const char *name;
        int norad, count;
        double span_s, sigma_arcsec;
    } cases[] = {{"GEO", 44801, 100, 4.0 * 3600.0, 0.2},
                 {"GPS", 26360, 100, 2.0 * 3600.0, 0.2},
                 {"LEO", 25544, 100, 1200.0, 1.0}};
    for (int k = 0; k < 3; k++) {
        bst_od_sgp4 sgp4 = {.clock = fx.clock, .bstar = elements_of(cases[k].norad).bstar};
        const bst_od_motion motion = {.sgp4 = &sgp4, .epoch = fx.epoch};
        sums s = fit_all(RUNS, cases[k].norad, cases[k].span_s, cases[k].count,
                         cases[k].sigma_arcsec, &motion);
        print_message("%s: NEES %.1f of %d, chi2 %.0f of %.0f\n", cases[k].name, s.nees, 6 * RUNS,
                      s.chi2, s.dof);
        assert_in_band(s.nees, 6 * RUNS);
        assert_in_band(s.chi2, s.dof);
    }
    /* what forces make of the same directions: in deep space SGP4 is tens of metres from them */
    const bst_force_model forces = {
        .gravity = fx.gravity, .eop = fx.eop, .sun = true, .moon = true};
    const bst_od_motion motion = {.forces = &forces, .epoch = fx.epoch};
    sums s = fit_all(2, 44801, cases[0].span_s, cases[0].count, cases[0].sigma_arcsec, &motion);
    print_message("GEO by forces: NEES %.1f of 12\n", s.nees);
    assert_true(s.nees > 60.0); /* 1e-7 of chance */
}

static int open_sky(void **state) {
    (void)state;
    bst_assert_ok(&fx.ctx, bst_astro_eop_builtin(&fx.ctx, &fx.eop));
    bst_assert_ok(&fx.ctx, bst_sky_clock_create(&fx.ctx, fx.eop, &fx.clock));
    bst_assert_ok(&fx.ctx, bst_gravity_builtin(&fx.ctx, 20, 20, &fx.gravity));
    bst_assert_ok(&fx.ctx, bst_time_from_utc(&fx.ctx, "2022-06-16T22:10:00Z", &fx.epoch));
    fx.eye = open_set(39089, &fx.eye_offset_s);
    return 0;
}

static int close_sky(void **state) {
    (void)state;
    bst_sgp4_free(fx.eye);
    bst_gravity_free(fx.gravity);
    bst_sky_clock_free(fx.clock);
    bst_astro_eop_free(fx.eop);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_covariance_is_true),
    };
    return cmocka_run_group_tests(tests, open_sky, close_sky);
}
