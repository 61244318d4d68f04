/* Defects of a frame: found where they are, stars are none, and fitted beside them. */
#include "sim/process/twin/twin_defects.h"

#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

enum { STARS = 4 };

static double scatter_of(int i) {
    double s = sin(12.9898 * i + 4.1) * 43758.5453;
    return 2.0 * (s - floor(s)) - 1.0;
}

/* A hot pixel, one below the others, a pair in a column, and one in a corner. */
static const bst_twin_defect given[] = {
    {0, 0, 90.0}, {30, 4, 400.0}, {7, 20, -70.0}, {12, 33, 80.0}, {12, 34, -65.0}};
enum { GIVEN = sizeof given / sizeof *given };

/* A frame with noise of 3 e- RMS, the defects, and a star that the model lacks. */
static bst_twin make(bst_twin_star *stars, float *data, float *variance, double missing_e) {
    static double frame[BST_TEST_PIXELS];
    bst_twin t = {.model = bst_test_twin_model(stars, STARS), .data_e = data};
    bst_test_frame(&t.model, frame);
    bst_twin_star missing = stars[0];
    missing.flux_e = missing_e;
    bst_test_add_star(&t.model, &missing, 9.0, 6.0, frame);
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        data[i] = (float)(frame[i] + 3.0 * sqrt(3.0) * scatter_of(i));
    }
    for (int k = 0; k < GIVEN; k++) {
        data[given[k].y * BST_TEST_NX + given[k].x] += (float)given[k].level_e;
    }
    t.model.data_e = data;
    t.model.variance_e2 = variance;
    t.model.noise_e = 3.0;
    t.model.form_error = 0.0;
    return t;
}

static const bst_twin_defect *at(const bst_twin *t, int x, int y) {
    for (int i = 0; i < t->defect_count; i++) {
        if (t->defects[i].x == x && t->defects[i].y == y) {
            return &t->defects[i];
        }
    }
    return NULL;
}

static void defects_are_found_and_streaks_are_none(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin t = make(stars, data, variance, 2500.0);
    bst_assert_ok(&ctx, bst_twin_find_defects(&ctx, &t));
    for (int k = 0; k < GIVEN; k++) {
        const bst_twin_defect *d = at(&t, given[k].x, given[k].y);
        assert_non_null(d);
        /* uniform noise of at most 5.2 e- */
        bst_assert_close(d->level_e, given[k].level_e, 5.3);
    }
    /* the missing star lights more than 50 pixels beyond 5 sigma */
    assert_int_equal(t.defect_count, GIVEN);
    free(t.defects);
}

/* Half of what a point in the middle of a pixel leaves in its eight neighbours, as the integral of
 * a Gaussian by the midpoint rule. */
static void neighbours_of_a_point(void **state) {
    (void)state;
    enum { N = 200 };
    for (int k = 0; k < 4; k++) {
        double sigma = 0.4 + 0.3 * k, strip[2] = {0.0, 0.0};
        for (int i = 0; i < N; i++) {
            double u = (i + 0.5) / N - 0.5;
            strip[0] += exp(-0.5 * u * u / (sigma * sigma));
            strip[1] += exp(-0.5 * (u + 1.0) * (u + 1.0) / (sigma * sigma));
        }
        double side = strip[1] / strip[0], corner = side * side;
        const bst_twin_psf psf = {.sigma_px = sigma, .ratio = 2.0, .wide = 0.2};
        bst_assert_close(bst_twin_defect_neighbours(&psf), 0.5 * (4.0 * side + 4.0 * corner) / 8.0,
                         1e-4);
    }
}

static void error_of_the_psf_is_no_defect(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS];
    bst_twin t = make(stars, data, variance, 0.0);
    static float light[BST_TEST_PIXELS];
    int brightest = 0;
    bst_assert_ok(&ctx, bst_twin_model_render(&ctx, &t.model, NULL, light));
    for (int i = 0; i < BST_TEST_PIXELS; i++) {
        brightest = light[i] > light[brightest] ? i : brightest;
    }
    int x = brightest % BST_TEST_NX, y = brightest / BST_TEST_NX;
    double noise = sqrt(9.0 + (double)light[brightest]);
    data[brightest] += (float)(8.0 * noise);
    bst_assert_ok(&ctx, bst_twin_find_defects(&ctx, &t));
    assert_non_null(at(&t, x, y));
    t.model.form_error = 2.0 * noise / (double)light[brightest];
    bst_assert_ok(&ctx, bst_twin_find_defects(&ctx, &t));
    assert_null(at(&t, x, y));
    assert_int_equal(t.defect_count, GIVEN);
    free(t.defects);
}

static bst_status fit_fluxes(bst_ctx *ctx, bst_twin *t) {
    static const bst_twin_freedom fluxes = {.iterations = 3};
    double loss;
    return bst_twin_model_fit(ctx, &t->model, &fluxes, NULL, &loss);
}

static void fit_is_the_one_without_these_pixels(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS], others[BST_TEST_PIXELS], variance[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin_star stars[STARS], plain[STARS];
    bst_twin t = make(stars, data, variance, 0.0), u = make(plain, others, variance, 0.0);
    bst_assert_ok(&ctx, bst_twin_find_defects(&ctx, &t));
    bst_assert_ok(&ctx, bst_twin_fit_defects(&ctx, &t, fit_fluxes));
    assert_ptr_equal(t.model.data_e, data);
    for (int k = 0; k < GIVEN; k++) {
        others[given[k].y * BST_TEST_NX + given[k].x] = NAN;
    }
    bst_assert_ok(&ctx, fit_fluxes(&ctx, &u));
    for (int i = 0; i < STARS; i++) {
        bst_assert_close(stars[i].flux_e, plain[i].flux_e, 1e-9 * plain[i].flux_e);
    }
    for (int k = 0; k < GIVEN; k++) {
        bst_assert_close(at(&t, given[k].x, given[k].y)->level_e, given[k].level_e, 6.5);
    }

    static float dark[BST_TEST_PIXELS];
    bst_twin_defect_map(&t, 68.0, dark);
    bst_assert_close((double)dark[1], 68.0, 0.0);
    bst_assert_close((double)dark[4 * BST_TEST_NX + 30], 68.0 + at(&t, 30, 4)->level_e, 1e-4);
    /* a pixel has no less than no charge */
    double low = 68.0 + at(&t, 7, 20)->level_e;
    bst_assert_close((double)dark[20 * BST_TEST_NX + 7], low > 0.0 ? low : 0.0, 1e-4);
    bst_twin_defect_map(&t, 0.0, dark);
    bst_assert_close((double)dark[20 * BST_TEST_NX + 7], 0.0, 0.0);
    free(t.defects);
}

static void sharpness_follows_the_psf(void **state) {
    (void)state;
    const bst_twin_psf narrow = {.sigma_px = 0.3}, wide = {.sigma_px = 4.0};
    /* nothing beside the pixel; as much beside it as in it, of which half is allowed */
    bst_assert_close(bst_twin_defect_neighbours(&narrow), 0.0, 0.03);
    bst_assert_close(bst_twin_defect_neighbours(&wide), 0.5, 0.03);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(defects_are_found_and_streaks_are_none),
                                       cmocka_unit_test(neighbours_of_a_point),
                                       cmocka_unit_test(error_of_the_psf_is_no_defect),
                                       cmocka_unit_test(fit_is_the_one_without_these_pixels),
                                       cmocka_unit_test(sharpness_follows_the_psf)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
