/* Orbits from angles over many random scenes, and covariances over many draws. Takes ten seconds.
 */
#include "tests/tracker/orbit_scene.h"

static const bst_vec3 EARTH = {21000.0, -18500.0, -8000.0};

static double nees(const scene *s, const bst_od_solution *got) {
    bst_od_state truth = truth_at(s, got->state.time_s);
    double e[6];
    difference(&got->state, &truth, e);
    return normalised(e, (const double(*)[6])got->covariance);
}

static double uniform(int k, int d) {
    return bst_rng_uniform(bst_rng_make_key(99, 0, "test", "scene"), (uint64_t)k, (uint64_t)d);
}

/* GEO, eccentric and low orbits, seen from low orbits for 100 s to 22 h in 20 to 120 sights of 1
 * arcsec. The Earth may be in between: directions are what is tested. */
static scene random_scene(int k) {
    double height = k % 4 == 0   ? 36186e3
                    : k % 4 == 1 ? 400e3 + 20e6 * uniform(k, 1)
                                 : 400e3 + 1.5e6 * uniform(k, 2);
    double a = 6378e3 + height, e = (k % 4 == 1 ? 0.5 : 0.01) * uniform(k, 3);
    a = fmax(a, 6600e3 / (1.0 - e));
    return (scene){
        .body = from_elements(a, e, 108.0 * uniform(k, 4), 360.0 * uniform(k, 5),
                              360.0 * uniform(k, 6), 360.0 * uniform(k, 7)),
        .eye = from_elements(6878e3 + 800e3 * uniform(k, 8), 0.002, 1.0 + 98.0 * uniform(k, 9),
                             360.0 * uniform(k, 10), 0.0, 360.0 * uniform(k, 11)),
        .earth_mps = EARTH,
        .to_s = pow(10.0, 2.0 + 2.9 * uniform(k, 12)),
        .count = 20 + (int)(100.0 * uniform(k, 13)),
        .sigma_rad = BST_ARCSEC_RAD};
}

static void random_scenes(void **state) {
    (void)state;
    enum { SCENES = 400 };
    static bst_od_observation items[120];
    int refused = 0, solved = 0, bent = 0;
    double sum = 0.0;
    for (int k = 0; k < SCENES; k++) {
        scene s = random_scene(k);
        bst_ctx ctx = {0};
        bst_od_solution got;
        observe(&s, 5000 + k, items);
        if (bst_od_determine(&ctx, items, s.count, &(bst_od_options){0}, NULL, &got, NULL) !=
            BST_OK) {
            print_message("scene %d, %.0f s, %d sights: %s\n", k, s.to_s, s.count, ctx.message);
            refused++;
            continue;
        }
        double off = nees(&s, &got);
        /* short arcs, where the valley is bent, are reported */
        if (got.bend > 0.5) {
            print_message(
                "scene %d, %.0f s, %d sights, range %.0f +- %.0f km: bend %.2g, NEES %.3g\n", k,
                s.to_s, s.count, 1e-3 * got.range_m, 1e-3 * got.range_sigma_m, got.bend, off);
            bent++;
            continue;
        }
        assert_true(off < 40.0); /* one in 2 million draws of a normal error */
        /* seven sigma: it is an orbit that fits, whatever is left open along the range */
        assert_true(got.chi2 / got.dof < 1.0 + 7.0 * sqrt(2.0 / got.dof));
        sum += off / 6.0;
        solved++;
    }
    print_message("%d solved, %d bent, %d refused, NEES / 6 = %.3f\n", solved, bent, refused,
                  sum / solved);
    assert_true(refused <= 4);
    assert_true(bent <= 8);
    /* four sigma of 400 draws of chi-square with 6 degrees of freedom */
    bst_assert_close(sum / solved, 1.0, 4.0 * sqrt(2.0 / (6.0 * SCENES)));
}

static void covariance_over_many_draws(void **state) {
    (void)state;
    enum { RUNS = 3000 };
    static bst_od_observation items[60];
    const bst_od_state eye = from_elements(7.155e6, 0.001, 98.5, 40.0, 80.0, 10.0);
    const scene scenes[] = {{.body = from_elements(42164e3, 1e-4, 0.05, 20.0, 0.0, 35.0),
                             .eye = eye,
                             .earth_mps = EARTH,
                             .to_s = 300.0,
                             .count = 60,
                             .sigma_rad = BST_ARCSEC_RAD},
                            {.body = from_elements(7.8e6, 0.01, 65.0, 60.0, 20.0, 100.0),
                             .eye = eye,
                             .earth_mps = EARTH,
                             .to_s = 60.0,
                             .count = 30,
                             .sigma_rad = BST_ARCSEC_RAD}};
    for (int k = 0; k < 2; k++) {
        double sum = 0.0;
        for (int run = 0; run < RUNS; run++) {
            bst_ctx ctx = {0};
            bst_od_solution got;
            observe(&scenes[k], 100000 + run, items);
            bst_assert_ok(&ctx, bst_od_fit(&ctx, items, scenes[k].count, &(bst_od_options){0},
                                           &scenes[k].body, NULL, &got));
            sum += nees(&scenes[k], &got) / (6.0 * RUNS);
        }
        print_message("scene %d: NEES / 6 = %.4f\n", k, sum);
        bst_assert_close(sum, 1.0, 4.0 * sqrt(2.0 / (6.0 * RUNS))); /* four sigma */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_scenes),
        cmocka_unit_test(covariance_over_many_draws),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
