/* Images in single precision against those in double precision, which test_psf.c checks. */
#include <stdlib.h>

#include "imgproc/measure/source_profile.h"
#include "tests/test_support.h"

enum { SIDE = 90 };

typedef struct fixture {
    bst_ctx ctx;
    bst_imgproc_gauss psf;
    bst_source_profiles profiles;
    float *scratch;
    float planes[4 * SIDE * (SIDE + BST_LANES)];
    double exact[4][SIDE * SIDE];
} fixture;

static int setup(void **state) {
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_imgproc_gauss_init(&f->psf);
    bst_assert_ok(&f->ctx, bst_source_profiles_create(&f->ctx, NULL, &f->profiles));
    f->scratch = calloc(bst_source_profile_scratch(SIDE), sizeof(float));
    assert_non_null(f->scratch);
    *state = f;
    return 0;
}
static int teardown(void **state) {
    fixture *f = *state;
    bst_source_profiles_free(&f->profiles);
    free(f->scratch);
    free(f);
    return 0;
}

static void compare(fixture *f, const bst_imgproc_shape *s, const bst_imgproc_stamp *stamp) {
    double peak[4] = {0}, worst[4] = {0};
    bst_imgproc_gauss_render(&f->psf, s, stamp, f->exact[0], f->exact[1], f->exact[2], f->exact[3]);
    bst_source_profiles_set(&f->profiles, &f->psf, s->sigma_px);
    bst_source_profile_render(&f->profiles, &f->psf, s, stamp, f->scratch, f->planes);
    int stride = bst_simd_layout_round_up(stamp->width);
    for (int part = 0; part < 4; part++) {
        for (int j = 0; j < stamp->height; j++) {
            for (int i = 0; i < stamp->width; i++) {
                double e = f->exact[part][j * stamp->width + i];
                double got = (double)f->planes[(part * stamp->height + j) * stride + i];
                peak[part] = fmax(peak[part], fabs(e));
                worst[part] = fmax(worst[part], fabs(got - e));
            }
        }
        /* the header's bound for shares; derivatives bend more between the tabulated places and
         * the nodes: by 1 / sigma */
        double allowed = part == 0 ? 2e-4 : part < 3 ? 1e-3 : 4e-3;
        if (!(worst[part] <= allowed * fmax(peak[part], 1e-3))) {
            fail_msg("part %d of a path of (%g, %g), sigma %g: %g of the peak", part, s->dx_px,
                     s->dy_px, s->sigma_px, worst[part] / peak[part]);
        }
    }
}

static void agrees_with_double_precision(void **state) {
    static const double paths[][4] = {{0, 0, 0, 0},     {1.5, 0, 0, 0},    {2.1, -2.2, 0, 0},
                                      {-6, 5, 0, 0},    {0.2, -20, 0, 0},  {22, 13, 0, 0},
                                      {8, 0, 1.3, 0.4}, {40, 40, 0.5, 0.1}};
    static const double sigmas[] = {0.5, 0.85, 1.2, 1.9, 3.3};
    for (size_t c = 0; c < sizeof paths / sizeof *paths; c++) {
        for (size_t k = 0; k < sizeof sigmas / sizeof *sigmas; k++) {
            bst_imgproc_shape s = {143.27 + 0.13 * (double)k,
                                   157.41 - 0.21 * (double)c,
                                   paths[c][0],
                                   paths[c][1],
                                   paths[c][2],
                                   paths[c][3],
                                   sigmas[k],
                                   NULL};
            bst_imgproc_stamp stamp = {100, 115, SIDE, 84};
            compare(*state, &s, &stamp);
        }
    }
}

/* A stamp that the source lies beside or reaches over, and small ones. */
static void stamps_may_cut_the_source(void **state) {
    static const bst_imgproc_stamp stamps[] = {{40, 50, 9, 9},   {47, 50, 3, 14}, {50, 44, 16, 17},
                                               {53, 57, 33, 20}, {0, 0, 20, 20},  {51, 53, 1, 1}};
    for (size_t c = 0; c < sizeof stamps / sizeof *stamps; c++) {
        bst_imgproc_shape point = {50.3, 52.8, 0, 0, 0, 0, 0.85, NULL},
                          streak = {50.3, 52.8, 6, -9, 0, 0, 0.85, NULL};
        compare(*state, &point, &stamps[c]);
        compare(*state, &streak, &stamps[c]);
    }
    bst_imgproc_shape far = {1e9, -1e9, 3, 4, 0, 0, 0.85, NULL};
    compare(*state, &far, &stamps[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(agrees_with_double_precision, setup, teardown),
        cmocka_unit_test_setup_teardown(stamps_may_cut_the_source, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
