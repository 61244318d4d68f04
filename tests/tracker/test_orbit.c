/* Orbits from angles: textbook examples, arcs from a minute to a day, noise, hard geometries. */
#include "tests/tracker/orbit_scene.h"

#define ARCSEC BST_ARCSEC_RAD

/* Relatively fast towards nobody in particular: the Earth's speed. */
static const bst_vec3 EARTH = {21000.0, -18500.0, -8000.0};

static bst_od_state leo_eye(void) {
    return from_elements(7.155e6, 0.001, 98.5, 40.0, 80.0, 10.0); /* as NEOSSat's */
}

static double kilometres(const bst_od_state *a, const bst_od_state *b) {
    return 1e-3 * bst_vec3_norm(bst_vec3_sub(a->position_m, b->position_m));
}

typedef struct named_scene {
    const char *name;
    scene s;
    double sigmas; /* how far from truth: of the stated covariance, 6 degrees of freedom */
} named_scene;

static void arcs_of_all_lengths(void **state) {
    (void)state;
    const bst_od_state geo = from_elements(42164e3, 1e-4, 0.05, 20.0, 0.0, 35.0);
    const bst_od_state round_geo = from_elements(42164e3, 0.0, 0.0, 0.0, 0.0, 75.0);
    const bst_od_state gto = from_elements(24400e3, 0.72, 7.0, 100.0, 170.0, 150.0);
    const bst_od_state molniya = from_elements(26560e3, 0.74, 63.4, 200.0, 270.0, 170.0);
    const bst_od_state leo = from_elements(7.8e6, 0.01, 65.0, 60.0, 20.0, 100.0);
    const bst_od_state sso = from_elements(7.3e6, 0.002, 98.0, 55.0, 0.0, 110.0);
    const bst_od_state geo_eye = from_elements(42164e3, 0.0, 0.1, 20.0, 0.0, 5.0);
    const named_scene scenes[] = {
        {"GEO from LEO, 5 min", {{0}, geo, leo_eye(), EARTH, 0, 300, 300, 1.0 * ARCSEC}, 0},
        {"GEO from LEO, 30 min", {{0}, geo, leo_eye(), EARTH, 0, 1800, 180, 1.0 * ARCSEC}, 0},
        {"GEO from LEO, a day", {{0}, geo, leo_eye(), EARTH, 0, 86400, 200, 1.0 * ARCSEC}, 0},
        {"round GEO from LEO, 2 h",
         {{0}, round_geo, leo_eye(), EARTH, 0, 7200, 100, 1.0 * ARCSEC},
         0},
        {"GTO from LEO, 20 min", {{0}, gto, leo_eye(), EARTH, 0, 1200, 120, 1.0 * ARCSEC}, 0},
        {"GTO from LEO, a day", {{0}, gto, leo_eye(), EARTH, 0, 86400, 150, 1.0 * ARCSEC}, 0},
        {"Molniya from LEO, 15 min", {{0}, molniya, leo_eye(), EARTH, 0, 900, 90, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, 1 min", {{0}, leo, leo_eye(), EARTH, 0, 60, 60, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, 10 min", {{0}, leo, leo_eye(), EARTH, 0, 600, 60, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, 3 h", {{0}, leo, leo_eye(), EARTH, 0, 10800, 150, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, a day", {{0}, leo, leo_eye(), EARTH, 0, 86400, 300, 1.0 * ARCSEC}, 0},
        {"SSO from SSO, 10 min", {{0}, sso, leo_eye(), EARTH, 0, 600, 100, 1.0 * ARCSEC}, 0},
        {"GEO from GEO, 12 h",
         {{0}, from_elements(42300e3, 0.01, 5.0, 10.0, 0.0, 35.0), geo_eye, EARTH, 0, 43200, 200,
          1.0 * ARCSEC},
         0},
        {"GEO from GEO, 6 h", {{0}, geo, geo_eye, EARTH, 0, 21600, 200, 1.0 * ARCSEC}, 0},
        {"LEO from GEO, 20 min", {{0}, leo, geo_eye, EARTH, 0, 1200, 100, 1.0 * ARCSEC}, 0},
        {"LEO from GEO, 5 h", {{0}, leo, geo_eye, EARTH, 0, 18000, 200, 1.0 * ARCSEC}, 0},
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
            print_message("%-28s %s\n", scenes[k].name, ctx.message);
            continue;
        }
        bst_od_state truth = truth_at(s, got.state.time_s);
        double e[6];
        difference(&got.state, &truth, e);
        print_message(
            "%-28s %9.3f km off, range %8.0f +- %8.3f km, chi2/dof %5.2f, nees %5.1f, %s, "
            "%d tried, other %.3g of %.3g\n",
            scenes[k].name, kilometres(&got.state, &truth), 1e-3 * got.range_m,
            1e-3 * got.range_sigma_m, got.chi2 / got.dof,
            normalised(e, (const double(*)[6])got.covariance), bst_od_method_name(report.method),
            report.candidates, report.other_chi2, report.first_chi2);
    }
}

static void scratch_monte_carlo(void **state) {
    (void)state;
    const bst_od_state geo = from_elements(42164e3, 1e-4, 0.05, 20.0, 0.0, 35.0);
    const bst_od_state gto = from_elements(24400e3, 0.72, 7.0, 100.0, 170.0, 150.0);
    const bst_od_state leo = from_elements(7.8e6, 0.01, 65.0, 60.0, 20.0, 100.0);
    const named_scene scenes[] = {
        {"GEO from LEO, 5 min", {{0}, geo, leo_eye(), EARTH, 0, 300, 300, 1.0 * ARCSEC}, 0},
        {"GEO from LEO, 30 min", {{0}, geo, leo_eye(), EARTH, 0, 1800, 60, 1.0 * ARCSEC}, 0},
        {"GEO from LEO, a day", {{0}, geo, leo_eye(), EARTH, 0, 86400, 100, 1.0 * ARCSEC}, 0},
        {"GTO from LEO, a day", {{0}, gto, leo_eye(), EARTH, 0, 86400, 100, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, 1 min", {{0}, leo, leo_eye(), EARTH, 0, 60, 60, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, 10 min", {{0}, leo, leo_eye(), EARTH, 0, 600, 60, 1.0 * ARCSEC}, 0},
        {"LEO from LEO, a day", {{0}, leo, leo_eye(), EARTH, 0, 86400, 100, 1.0 * ARCSEC}, 0},
    };
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++) {
        const scene *s = &scenes[k].s;
        static bst_od_observation items[400];
        double sum = 0.0, chi = 0.0;
        int runs = 10, fails = 0;
        for (int run = 0; run < runs; run++) {
            bst_ctx ctx = {0};
            bst_od_solution got;
            observe(s, run, items);
            if (bst_od_fit(&ctx, items, s->count, &(bst_od_options){0}, &s->body, NULL, &got) !=
                BST_OK) {
                fails++;
                continue;
            }
            bst_od_state truth = truth_at(s, got.state.time_s);
            double e[6];
            difference(&got.state, &truth, e);
            sum += normalised(e, (const double(*)[6])got.covariance);
            chi += got.chi2 / got.dof;
        }
        print_message("%-28s nees/6 %.3f (+- %.3f), chi2/dof %.3f, %d failed\n", scenes[k].name,
                      sum / 6 / (runs - fails), sqrt(2.0 / 6 / runs), chi / (runs - fails), fails);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(arcs_of_all_lengths),
        cmocka_unit_test(scratch_monte_carlo),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
