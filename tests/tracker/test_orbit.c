/* Orbits from angles: textbook examples, arcs from a minute to a day, noise, hard geometries. */
#include "sim/astro/sgp4_fit.h"
#include "tests/tracker/orbit_scene.h"

#define ARCSEC BST_ARCSEC_RAD

/* About the Earth's velocity in June. */
static const bst_vec3 EARTH = {21000.0, -18500.0, -8000.0};
static const bst_vec3 NOWHERE = {0.0, 0.0, 0.0}; /* the Earth at rest */

static bst_od_state leo_eye(void) {
    return from_elements(7.155e6, 0.001, 98.5, 40.0, 80.0, 10.0); /* as NEOSSat's */
}

/* 99.99 % of chi-square with 6 degrees of freedom: a few dozen draws below stay within it. */
static const double FAR = 27.86;

/* Squared distance from the truth in units of the stated covariance. */
static double nees(const scene *s, const bst_od_solution *got) {
    bst_od_state truth = truth_at(s, got->state.time_s);
    double e[6];
    difference(&got->state, &truth, e);
    return normalised(e, (const double(*)[6])got->covariance);
}

static bst_od_state geo(void) {
    return from_elements(42164e3, 1e-4, 0.05, 20.0, 0.0, 35.0);
}
static bst_od_state gto(void) {
    return from_elements(24400e3, 0.72, 7.0, 100.0, 170.0, 150.0);
}
static bst_od_state leo(void) {
    return from_elements(7.8e6, 0.01, 65.0, 60.0, 20.0, 100.0);
}
static bst_od_state geo_eye(void) {
    return from_elements(42164e3, 0.0, 0.1, 20.0, 0.0, 5.0);
}

typedef struct named_scene {
    const char *name;
    scene s;
    double most_km; /* one standard deviation of the range; from the information in the geometry */
} named_scene;

static void arcs_of_all_lengths(void **state) {
    (void)state;
    const bst_od_state round_geo = from_elements(42164e3, 0.0, 0.0, 0.0, 0.0, 75.0);
    const bst_od_state molniya = from_elements(26560e3, 0.74, 63.4, 200.0, 270.0, 170.0);
    const bst_od_state sso = from_elements(7.3e6, 0.002, 98.0, 55.0, 0.0, 110.0);
    const bst_od_state slow_geo = from_elements(42300e3, 0.01, 5.0, 10.0, 0.0, 35.0);
    const bst_od_state beyond = from_elements(1.5e8, 0.6, 30.0, 10.0, 80.0, 120.0);
    const double s1 = ARCSEC;
    const named_scene scenes[] = {
        {"GEO from LEO, 1 min", {{0}, geo(), leo_eye(), EARTH, 0, 60, 60, s1}, 5000.0},
        {"GEO from LEO, 5 min", {{0}, geo(), leo_eye(), EARTH, 0, 300, 300, s1}, 100.0},
        {"GEO from LEO, 30 min", {{0}, geo(), leo_eye(), EARTH, 0, 1800, 180, s1}, 10.0},
        {"GEO from LEO, a day", {{0}, geo(), leo_eye(), EARTH, 0, 86400, 200, s1}, 0.1},
        {"round GEO from LEO, 2 h", {{0}, round_geo, leo_eye(), EARTH, 0, 7200, 100, s1}, 1.0},
        {"GTO from LEO, 20 min", {{0}, gto(), leo_eye(), EARTH, 0, 1200, 120, s1}, 20.0},
        {"GTO from LEO, a day", {{0}, gto(), leo_eye(), EARTH, 0, 86400, 150, s1}, 0.1},
        {"Molniya from LEO, 15 min", {{0}, molniya, leo_eye(), EARTH, 0, 900, 90, s1}, 30.0},
        {"LEO from LEO, 1 min", {{0}, leo(), leo_eye(), EARTH, 0, 60, 60, s1}, 100.0},
        {"LEO from LEO, 10 min", {{0}, leo(), leo_eye(), EARTH, 0, 600, 60, s1}, 1.0},
        {"LEO from LEO, 3 h", {{0}, leo(), leo_eye(), EARTH, 0, 10800, 150, s1}, 0.02},
        {"LEO from LEO, a day", {{0}, leo(), leo_eye(), EARTH, 0, 86400, 300, s1}, 0.02},
        {"LEO from LEO, a day, 12 sights", {{0}, leo(), leo_eye(), EARTH, 0, 86400, 12, s1}, 0.2},
        {"SSO from SSO, 10 min", {{0}, sso, leo_eye(), EARTH, 0, 600, 100, s1}, 1.0},
        {"GEO from GEO, 12 h", {{0}, slow_geo, geo_eye(), EARTH, 0, 43200, 200, s1}, 1.0},
        {"LEO from GEO, 20 min", {{0}, leo(), geo_eye(), EARTH, 0, 1200, 100, s1}, 2.0},
        {"LEO from GEO, 5 h", {{0}, leo(), geo_eye(), EARTH, 0, 18000, 200, s1}, 0.2},
        {"150,000 km from LEO, a day", {{0}, beyond, leo_eye(), EARTH, 0, 86400, 200, s1}, 5.0},
        {"10 arcsec, GEO from LEO, 2 h",
         {{0}, geo(), leo_eye(), EARTH, 0, 7200, 200, 10 * s1},
         50.0},
    };
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++) {
        const scene *s = &scenes[k].s;
        static bst_od_observation items[400];
        bst_ctx ctx = {0};
        bst_od_solution got;
        bst_od_report report;
        observe(s, (int)k, items);
        bst_status status =
            bst_od_determine(&ctx, items, s->count, &(bst_od_options){0}, NULL, &got, &report);
        if (status != BST_OK) {
            fail_msg("%s: %s", scenes[k].name, ctx.message);
        }
        double off = nees(s, &got);
        print_message("%-30s range %8.0f +- %8.3f km, chi2/dof %4.2f, %4.1f off, %s\n",
                      scenes[k].name, 1e-3 * got.range_m, 1e-3 * got.range_sigma_m,
                      got.chi2 / got.dof, off, bst_od_method_name(report.method));
        assert_true(off < FAR);
        assert_true(1e-3 * got.range_sigma_m < scenes[k].most_km);
        /* five standard deviations of chi2 / dof */
        bst_assert_close(got.chi2 / got.dof, 1.0, 5.0 * sqrt(2.0 / got.dof));
        assert_int_equal(got.used, s->count);
    }
}

/* Normalised error squared over its dimension, mean of many draws. */
static double consistency(const scene *s, int runs) {
    static bst_od_observation items[400];
    double sum = 0.0;
    for (int run = 0; run < runs; run++) {
        bst_ctx ctx = {0};
        bst_od_solution got;
        observe(s, run, items);
        bst_assert_ok(
            &ctx, bst_od_fit(&ctx, items, s->count, &(bst_od_options){0}, &s->body, NULL, &got));
        sum += nees(s, &got) / (6.0 * runs);
    }
    return sum;
}

static void covariance_is_true(void **state) {
    (void)state;
    const named_scene scenes[] = {
        {"GEO from LEO, 5 min", {{0}, geo(), leo_eye(), EARTH, 0, 300, 60, ARCSEC}, 0},
        {"LEO from LEO, 1 min", {{0}, leo(), leo_eye(), EARTH, 0, 60, 30, ARCSEC}, 0},
        {"LEO from LEO, a day", {{0}, leo(), leo_eye(), EARTH, 0, 86400, 40, ARCSEC}, 0},
        {"GTO from LEO, a day", {{0}, gto(), leo_eye(), EARTH, 0, 86400, 40, ARCSEC}, 0},
    };
    enum { RUNS = 400 };
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++) {
        double ratio = consistency(&scenes[k].s, RUNS);
        print_message("%-20s NEES / 6 = %.3f (one sigma of the mean %.3f)\n", scenes[k].name, ratio,
                      sqrt(2.0 / (6.0 * RUNS)));
        /* the figure asked for; 3.5 sigma of 400 draws */
        bst_assert_close(ratio, 1.0, 0.1);
    }
}

/* The same with gravity to degree 8, Sun and Moon, in a scene where they move the object by
 * kilometres. */
static void integrated_motion(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_gravity *gravity;
    bst_assert_ok(&ctx, bst_gravity_builtin(&ctx, 8, 8, &gravity));
    const bst_force_model forces = {.gravity = gravity, .sun = true, .moon = true};
    scene s = {{.forces = &forces}, leo(), leo_eye(), EARTH, 0, 20000, 100, ARCSEC};
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, "2022-06-16T22:10:00Z", &s.motion.epoch));
    static bst_od_observation items[400];
    bst_od_solution got;
    observe(&s, 3, items);
    const bst_od_options options = {.motion = s.motion, .scale_variance = true};
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, s.count, &options, NULL, &got, NULL));
    assert_true(nees(&s, &got) < FAR);
    bst_assert_close(got.chi2 / got.dof, 1.0, 5.0 * sqrt(2.0 / got.dof)); /* five sigma */
    bst_assert_close(got.variance_factor, 1.0, 5.0 * sqrt(2.0 / got.dof));
    /* two bodies do not explain that arc, and say so by the factor on their covariance */
    const bst_od_options plain = {.scale_variance = true};
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, s.count, &plain, NULL, &got, NULL));
    assert_true(got.variance_factor > 100.0);
    bst_gravity_free(gravity);
}

/* An error that all directions of an arc share is part of the covariance where it is stated. */
static void shared_errors_count(void **state) {
    (void)state;
    enum { RUNS = 60 };
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 900, 100, 0.2 * ARCSEC};
    const double shared[2] = {0.1 * ARCSEC, 0.06 * ARCSEC};
    static bst_od_observation items[100];
    double sum[2] = {0.0};
    for (int run = 0; run < RUNS; run++) {
        bst_ctx ctx = {0};
        double draw[2];
        observe(&s, 3000 + run, items);
        bst_rng_normal2(bst_rng_make_key(5, 0, "test", "shared"), (uint64_t)run, 0, draw);
        for (int stated = 0; stated < 2; stated++) {
            for (int i = 0; i < s.count; i++) {
                bst_tangent axes = bst_tangent_at(items[i].direction);
                for (int k = 0; k < 2; k++) {
                    items[i].shared_rad[k][k] = stated ? shared[k] : 0.0;
                }
                items[i].cov_11 += stated ? shared[0] * shared[0] : 0.0;
                items[i].cov_22 += stated ? shared[1] * shared[1] : 0.0;
                if (!stated) {
                    items[i].direction = bst_tangent_exp(
                        items[i].direction,
                        bst_tangent_vector(&axes, shared[0] * draw[0], shared[1] * draw[1]));
                }
            }
            bst_od_solution got;
            bst_assert_ok(
                &ctx, bst_od_fit(&ctx, items, s.count, &(bst_od_options){0}, &s.body, NULL, &got));
            sum[stated] += nees(&s, &got) / (6.0 * RUNS);
        }
    }
    print_message("NEES / 6: %.2f, stated %.3f\n", sum[0], sum[1]);
    assert_true(sum[0] > 1.5);
    bst_assert_close(sum[1], 1.0, 4.0 * sqrt(2.0 / (6.0 * RUNS))); /* four sigma */
}

/* Shared errors that change along the arc: a first-order autoregressive sequence (Box, Jenkins and
 * Reinsel, 3.2.3). Taken for ones that stay, which move rates less, or for independent ones, they
 * make the covariance too small. */
static void shared_errors_change(void **state) {
    (void)state;
    enum { RUNS = 60, COUNT = 100 };
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 900, COUNT, 0.2 * ARCSEC};
    const double shared = 0.1 * ARCSEC, change = 0.1, kept = exp(-change);
    static bst_od_observation items[COUNT];
    double sum[3] = {0.0};
    for (int run = 0; run < RUNS; run++) {
        bst_ctx ctx = {0};
        double now[2] = {0.0};
        observe(&s, 4000 + run, items);
        for (int i = 0; i < COUNT; i++) {
            bst_tangent axes = bst_tangent_at(items[i].direction);
            bst_rng_key key = bst_rng_make_key((uint64_t)run, 0, "test", "change");
            double draw[2], fresh = i > 0 ? sqrt(1.0 - kept * kept) : 1.0;
            bst_rng_normal2(key, (uint64_t)i, 0, draw);
            for (int k = 0; k < 2; k++) {
                now[k] = kept * now[k] + fresh * draw[k];
                items[i].shared_rad[k][k] = shared;
            }
            items[i].cov_11 += shared * shared;
            items[i].cov_22 += shared * shared;
            items[i].direction = bst_tangent_exp(
                items[i].direction, bst_tangent_vector(&axes, shared * now[0], shared * now[1]));
        }
        for (int as = 0; as < 3; as++) { /* as it is, as if it stayed, as if it were independent */
            for (int i = 0; i < COUNT; i++) {
                items[i].shared_change = as == 0 ? change : 0.0;
                items[i].shared_rad[0][0] = items[i].shared_rad[1][1] = as == 2 ? 0.0 : shared;
            }
            bst_od_solution got;
            bst_assert_ok(
                &ctx, bst_od_fit(&ctx, items, COUNT, &(bst_od_options){0}, &s.body, NULL, &got));
            sum[as] += nees(&s, &got) / (6.0 * RUNS);
        }
    }
    print_message("NEES / 6: %.3f, as if it stayed %.2f, as if independent %.2f\n", sum[0], sum[1],
                  sum[2]);
    bst_assert_close(sum[0], 1.0, 4.0 * sqrt(2.0 / (6.0 * RUNS))); /* four sigma */
    assert_true(sum[1] > 1.5 && sum[2] > 1.5);
}

/* ------------------------------------------------------------------ textbook examples */

static void assert_orbit(const bst_od_state *s, double a_km, double e, double i_deg,
                         double node_deg, double a_tolerance_km, double e_tolerance,
                         double tolerance_deg) {
    bst_astro_kepler_elements k =
        bst_astro_kepler_elements_of(BST_EARTH_MU_M3PS2, s->position_m, s->velocity_mps);
    print_message("a %.3f km, e %.5f, i %.4f, node %.4f deg\n", 1e-3 * k.semi_major_axis_m,
                  k.eccentricity, k.inclination_rad / BST_DEG_RAD, k.raan_rad / BST_DEG_RAD);
    bst_assert_close(1e-3 * k.semi_major_axis_m, a_km, a_tolerance_km);
    bst_assert_close(k.eccentricity, e, e_tolerance);
    bst_assert_close(k.inclination_rad / BST_DEG_RAD, i_deg, tolerance_deg);
    bst_assert_close(k.raan_rad / BST_DEG_RAD, node_deg, tolerance_deg);
}

static bst_od_observation sight(double t, double ra_deg, double dec_deg, bst_vec3 observer_m) {
    const double variance = ARCSEC * ARCSEC;
    return (bst_od_observation){
        .observer = {.time_s = t, .position_m = observer_m},
        .direction = bst_vec3_from_radec(ra_deg * BST_DEG_RAD, dec_deg * BST_DEG_RAD),
        .cov_11 = variance,
        .cov_22 = variance};
}

/* Vallado, Fundamentals of Astrodynamics and Applications, example 7-2: three of his sights. They
 * were made of an orbit with a = 12,246.023 km, e = 0.2, i = 40 and node 330 degrees, without light
 * time. */
static void vallado_example_7_2(void **state) {
    (void)state;
    const bst_od_observation items[3] = {sight(86400 * 0.4864351851851852, 0.939913, 18.667717,
                                               (bst_vec3){4054881, 2748195, 4074237}),
                                         sight(86400 * 0.49199074074074073, 45.025748, 35.664741,
                                               (bst_vec3){3956224, 2888232, 4074364}),
                                         sight(86400 * 0.4947685185185185, 67.886655, 36.996583,
                                               (bst_vec3){3905073, 2956935, 4074430})};
    bst_ctx ctx = {0};
    bst_od_solution got;
    bst_od_candidate first[BST_OD_CANDIDATES];
    int found;
    bst_assert_ok(&ctx, bst_od_initial(&ctx, items, 3, first, &found));
    assert_int_equal(first[0].method, BST_OD_GAUSS);
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, 3, &(bst_od_options){0}, NULL, &got, NULL));
    assert_int_equal(got.dof, 0);
    /* places printed to 1 m, angles to 4 mas; light time of 15 ms moves the body by 0.1 km, which
     * is 1 km in a */
    assert_orbit(&got.state, 12246.023, 0.2, 40.0, 330.0, 3.0, 2e-4, 0.01);
}

/* Curtis, Orbital Mechanics for Engineering Students, examples 5.11 and 5.12: a = 10,000 km, e =
 * 0.1, i = 30, node 270 degrees, with angles of five digits. */
static void curtis_example_5_12(void **state) {
    (void)state;
    static const double ra[3] = {43.537, 54.420, 64.318}, dec[3] = {-8.7833, -12.074, -15.105};
    static const double t[3] = {0.0, 118.10, 237.58}, lst[3] = {44.506, 45.000, 45.499};
    bst_od_observation items[3];
    for (int i = 0; i < 3; i++) {
        /* his site, 40 degrees north and 1 km high: 3489.8 km off the axis, 4078.5 km north */
        const double lift = lst[i] * BST_DEG_RAD;
        items[i] = sight(t[i], ra[i], dec[i],
                         (bst_vec3){4893.40e3 * cos(lift), 4893.40e3 * sin(lift), 4078.51e3});
    }
    bst_ctx ctx = {0};
    bst_od_candidate first[BST_OD_CANDIDATES];
    bst_od_solution got;
    int found;
    bst_assert_ok(&ctx, bst_od_initial(&ctx, items, 3, first, &found));
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, 3, &(bst_od_options){0}, NULL, &got, NULL));
    /* five digits of an angle are 0.5 mdeg: 5 km in 500 of the arc's curvature */
    assert_orbit(&got.state, 10000.0, 0.1, 30.0, 270.0, 60.0, 5e-3, 0.1);
}

/* ------------------------------------------------------------------ hard cases */

static void three_sights_in_the_orbits_plane(void **state) {
    (void)state;
    /* observer and body in one plane: three directions leave an orbit open, fifty do not */
    const scene s = {{0},
                     from_elements(9e6, 0.05, 50.0, 30.0, 10.0, 60.0),
                     from_elements(7e6, 0.001, 50.0, 30.0, 0.0, 20.0),
                     NOWHERE,
                     0,
                     1500,
                     50,
                     ARCSEC};
    static bst_od_observation items[50];
    bst_ctx ctx = {0};
    bst_od_solution got;
    observe(&s, 1, items);
    const bst_od_observation three[3] = {items[0], items[24], items[49]};
    assert_int_equal(bst_od_determine(&ctx, three, 3, &(bst_od_options){0}, NULL, &got, NULL),
                     BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "observ"));
    bst_assert_ok(&ctx,
                  bst_od_determine(&ctx, items, s.count, &(bst_od_options){0}, NULL, &got, NULL));
    assert_true(nees(&s, &got) < FAR);
}

static void a_companion_has_no_range(void **state) {
    (void)state;
    /* 2 km ahead on the observer's own orbit: its direction does not tell how far */
    const scene s = {{0},
                     from_elements(7e6, 0.0, 50.0, 30.0, 0.0, 20.02),
                     from_elements(7e6, 0.0, 50.0, 30.0, 0.0, 20.0),
                     NOWHERE,
                     0,
                     1500,
                     50,
                     ARCSEC};
    static bst_od_observation items[50];
    bst_ctx ctx = {0};
    bst_od_solution got;
    observe(&s, 1, items);
    assert_int_equal(bst_od_determine(&ctx, items, s.count, &(bst_od_options){0}, NULL, &got, NULL),
                     BST_ERR_NUMERIC);
    print_message("%s\n", ctx.message);
}

static void what_cannot_be_solved_is_said(void **state) {
    (void)state;
    scene s = {{0}, leo(), leo_eye(), NOWHERE, 0, 600, 30, ARCSEC};
    static bst_od_observation items[30], same[30];
    bst_ctx ctx = {0};
    bst_od_solution got;
    const bst_od_options plain = {0};
    observe(&s, 1, items);
    assert_int_equal(bst_od_determine(&ctx, items, 2, &plain, NULL, &got, NULL), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "too few"));
    for (int i = 0; i < 30; i++) {
        same[i] = items[0];
    }
    assert_int_equal(bst_od_determine(&ctx, same, 30, &plain, NULL, &got, NULL), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "times"));
    same[0] = items[1];
    assert_int_equal(bst_od_fit(&ctx, same, 30, &plain, &s.body, NULL, &got), BST_ERR_ARGUMENT);
    /* one direction at three times, from an observer that moves: whatever it is, no orbit nearby */
    for (int i = 0; i < 3; i++) {
        same[i] = items[10 * i];
        same[i].direction = items[0].direction;
    }
    bst_status status = bst_od_determine(&ctx, same, 3, &plain, NULL, &got, NULL);
    assert_true(status == BST_OK || status == BST_ERR_NUMERIC);
    items[4].cov_22 = -1.0;
    assert_int_equal(bst_od_fit(&ctx, items, 30, &plain, &s.body, NULL, &got), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "observation 4"));
    /* an arc of two seconds */
    s.to_s = 2.0;
    observe(&s, 1, items);
    assert_int_equal(bst_od_determine(&ctx, items, 30, &plain, NULL, &got, NULL), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "do not determine the range"));
}

static void hyperbolas_are_refused(void **state) {
    (void)state;
    bst_od_state fast = leo();
    fast.velocity_mps = bst_vec3_scale(fast.velocity_mps, 1.6); /* 1.414 is escape */
    const scene s = {{0}, fast, leo_eye(), NOWHERE, 0, 1500, 80, ARCSEC};
    static bst_od_observation items[80];
    bst_ctx ctx = {0};
    bst_od_solution got;
    observe(&s, 1, items);
    bst_status status = bst_od_determine(&ctx, items, 80, &(bst_od_options){0}, NULL, &got, NULL);
    if (status == BST_OK) { /* the nearest ellipse does not explain it */
        assert_true(got.chi2 / got.dof > 1e3);
    } else {
        assert_int_equal(status, BST_ERR_NUMERIC);
        assert_non_null(strstr(ctx.message, "hyperbol"));
    }
}

static void through_the_pole_and_over_zero_hours(void **state) {
    (void)state;
    /* the line from one polar orbit to another turns through the pole; the other scene crosses
     * right ascension 0 */
    const scene scenes[] = {{{0},
                             from_elements(7.5e6, 0.001, 90.0, 0.5, 0.0, -10.0),
                             from_elements(7.1e6, 0.001, 90.0, 0.0, 0.0, -50.0),
                             EARTH,
                             0,
                             1500,
                             150,
                             ARCSEC},
                            {{0},
                             from_elements(12e6, 0.01, 20.0, 272.0, 0.0, 60.0),
                             from_elements(7e6, 0.001, 60.0, 302.0, 0.0, 10.0),
                             EARTH,
                             0,
                             1800,
                             150,
                             ARCSEC}};
    static bst_od_observation items[150];
    bool pole = false, wrap = false;
    for (int k = 0; k < 2; k++) {
        bst_ctx ctx = {0};
        bst_od_solution got;
        observe(&scenes[k], 3, items);
        double before = NAN;
        for (int i = 0; i < 150; i++) {
            double ra, dec;
            bst_vec3_to_radec(items[i].direction, &ra, &dec);
            pole = pole || fabs(dec) > 88.0 * BST_DEG_RAD;
            wrap = wrap || (k == 1 && fabs(ra - before) > 6.0);
            before = ra;
        }
        bst_assert_ok(&ctx,
                      bst_od_determine(&ctx, items, 150, &(bst_od_options){0}, NULL, &got, NULL));
        assert_true(nees(&scenes[k], &got) < FAR);
    }
    assert_true(pole && wrap);
}

static void wrong_observations_are_left_out(void **state) {
    (void)state;
    const scene s = {{0}, leo(), leo_eye(), EARTH, 0, 900, 100, ARCSEC};
    static bst_od_observation items[100];
    double chi2[100];
    bst_ctx ctx = {0};
    bst_od_solution got;
    observe(&s, 1, items);
    for (int i = 5; i < 100; i += 20) {
        bst_tangent axes = bst_tangent_at(items[i].direction);
        items[i].direction =
            bst_tangent_exp(items[i].direction, bst_tangent_vector(&axes, 40.0 * ARCSEC, 1e-4));
    }
    const bst_od_options options = {.reject_chi2 = 25.0, .scale_variance = true};
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, 100, &options, chi2, &got, NULL));
    assert_int_equal(got.rejected, 5);
    assert_int_equal(got.used, 95);
    assert_true(chi2[5] > 100.0 && chi2[6] < 25.0);
    assert_true(nees(&s, &got) < FAR);
    bst_assert_close(got.variance_factor, 1.0, 5.0 * sqrt(2.0 / got.dof)); /* five sigma */
}

/* Without noise the orbit comes out as it went in. */
static void exact_directions_give_the_orbit_back(void **state) {
    (void)state;
    const scene s = {{0}, gto(), leo_eye(), EARTH, 0, 7200, 60, ARCSEC};
    static bst_od_observation items[60];
    bst_ctx ctx = {0};
    bst_od_solution got;
    observe(&s, -1, items);
    bst_assert_ok(&ctx, bst_od_determine(&ctx, items, 60, &(bst_od_options){0}, NULL, &got, NULL));
    bst_od_state truth = truth_at(&s, got.state.time_s);
    double off = bst_vec3_norm(bst_vec3_sub(got.state.position_m, truth.position_m));
    print_message("exact: %.3g m off\n", off);
    /* the iteration ends when nothing above 1e-3 of a sigma is to gain: of some hundred metres */
    assert_true(off < 1.0);
}

/* ------------------------------------------------------------------ prediction */

static void prediction_and_its_covariance(void **state) {
    (void)state;
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 600, 60, ARCSEC};
    static bst_od_observation items[60];
    scene later = s;
    bst_od_observation then[2];
    later.from_s = 1200.0;
    later.to_s = 1210.0;
    later.count = 2;
    observe(&later, -1, then);
    double sum = 0.0;
    enum { RUNS = 300 };
    for (int run = 0; run < RUNS; run++) {
        bst_ctx ctx = {0};
        bst_od_solution got;
        bst_od_sight seen, next;
        double p[4][4], q[4][4];
        observe(&s, run, items);
        bst_assert_ok(&ctx,
                      bst_od_fit(&ctx, items, s.count, &(bst_od_options){0}, &s.body, NULL, &got));
        bst_assert_ok(
            &ctx, bst_od_predict(&ctx, &s.motion, &got.state, (const double(*)[6])got.covariance,
                                 &then[0].observer, &seen, p));
        bst_assert_ok(
            &ctx, bst_od_predict(&ctx, &s.motion, &got.state, (const double(*)[6])got.covariance,
                                 &then[1].observer, &next, q));
        bst_tangent axes = bst_tangent_at(seen.direction);
        bst_vec3 off = bst_tangent_log(seen.direction, then[0].direction);
        double a = bst_vec3_dot(axes.e1, off), b = bst_vec3_dot(axes.e2, off);
        double det = p[0][0] * p[1][1] - p[0][1] * p[0][1];
        sum += (p[1][1] * a * a - 2.0 * p[0][1] * a * b + p[0][0] * b * b) / det / (2.0 * RUNS);
        /* the rate is the direction's change: over 10 s its own change, 5e-8 rad/s^2, is 2.5e-6 */
        bst_vec3 middle = bst_vec3_scale(bst_vec3_add(seen.rate_radps, next.rate_radps), 0.5);
        bst_vec3 change = bst_vec3_scale(bst_vec3_sub(next.direction, seen.direction), 0.1);
        assert_true(bst_vec3_norm(bst_vec3_sub(middle, change)) < 1e-9);
    }
    print_message("prediction: NEES / 2 = %.3f\n", sum);
    bst_assert_close(sum, 1.0, 0.2); /* 3.5 sigma of 300 draws of 2 */
}

static void a_track_at_an_assumed_range(void **state) {
    (void)state;
    const scene s = {{0}, geo(), leo_eye(), EARTH, 0, 600, 2, ARCSEC};
    bst_od_observation items[2];
    observe(&s, -1, items);
    bst_od_state truth = truth_at(&s, 0.0), got;
    bst_od_sight seen, again;
    bst_ctx ctx = {0};
    bst_od_see(&truth, &items[0].observer, &seen);
    /* two ways to one direction: the iteration of the scene, and this one's series */
    assert_true(bst_vec3_norm(bst_vec3_sub(seen.direction, items[0].direction)) < 1e-14);
    double sky[4][4] = {{0}}, p[6][6], back[4][4];
    for (int i = 0; i < 4; i++) {
        sky[i][i] = i < 2 ? ARCSEC * ARCSEC : 1e-4 * ARCSEC * ARCSEC;
    }
    const bst_orbit_range range = {seen.range_m, 1e6, seen.range_rate_mps, 500.0};
    bst_od_from_track(&items[0].observer, seen.direction, seen.rate_radps, (const double(*)[4])sky,
                      &range, &got, p);
    /* what the light time leaves out: 0.5 a tau^2, 2 mm, and a tau, 0.03 m/s */
    assert_true(bst_vec3_norm(bst_vec3_sub(got.position_m, truth.position_m)) < 0.01);
    assert_true(bst_vec3_norm(bst_vec3_sub(got.velocity_mps, truth.velocity_mps)) < 0.05);
    bst_assert_ok(&ctx, bst_od_predict(&ctx, &s.motion, &got, (const double(*)[6])p,
                                       &items[0].observer, &again, back));
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) {
            /* at once it is the track again: the Earth's speed over that of light, squared */
            bst_assert_close(back[i][k], sky[i][k], 1e-3 * sqrt(sky[i][i] * sky[k][k]));
        }
    }
    /* ten minutes later the range's error shows, and the true place lies within */
    bst_assert_ok(&ctx, bst_od_predict(&ctx, &s.motion, &got, (const double(*)[6])p,
                                       &items[1].observer, &again, back));
    assert_true(sqrt(back[0][0] + back[1][1]) > 100.0 * ARCSEC);
    assert_true(bst_vec3_angle(again.direction, items[1].direction) < ARCSEC);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(arcs_of_all_lengths),
        cmocka_unit_test(covariance_is_true),
        cmocka_unit_test(integrated_motion),
        cmocka_unit_test(shared_errors_count),
        cmocka_unit_test(shared_errors_change),
        cmocka_unit_test(vallado_example_7_2),
        cmocka_unit_test(curtis_example_5_12),
        cmocka_unit_test(three_sights_in_the_orbits_plane),
        cmocka_unit_test(a_companion_has_no_range),
        cmocka_unit_test(what_cannot_be_solved_is_said),
        cmocka_unit_test(hyperbolas_are_refused),
        cmocka_unit_test(through_the_pole_and_over_zero_hours),
        cmocka_unit_test(wrong_observations_are_left_out),
        cmocka_unit_test(exact_directions_give_the_orbit_back),
        cmocka_unit_test(prediction_and_its_covariance),
        cmocka_unit_test(a_track_at_an_assumed_range),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
