/* A PSF with coma that changes over the field and wings comes back from noisy stars.
 *
 * Usage: test_effective_psf [DRAWS]   stars drawn so many times; the standard errors are judged by
 * all of them (1; ./dev slow: 12) */
#include "tests/test_support.h"

#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"

#include "sim/analysis/camera/effective_psf.h"

enum { HALF = 10, STAMP = 2 * HALF + 1, STARS = 120, OVER = BST_EFFECTIVE_PSF_OVERSAMPLING };
enum { SIDE = 2 * HALF * OVER + 1, SAMPLES = SIDE * SIDE, LOBES = 3 };
static const double NOISE_E = 10.0;

static uint64_t state_of_draws;

static double uniform(void) {
    state_of_draws = state_of_draws * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return ((double)(state_of_draws >> 12) + 0.5) / 4503599627370496.0;
}

static double normal(void) {
    return sqrt(-2.0 * log(uniform())) * cos(2.0 * BST_PI * uniform());
}

/* Core, coma to the lower right that grows along the field, and a halo: share, place, sigma. */
typedef struct lobe {
    double share, x, y, sigma;
} lobe;

static void lobes_at(double field_x, lobe out[LOBES]) {
    double coma = 0.1 + 0.2 * field_x;
    out[0] = (lobe){0.95 - coma, 0.0, 0.0, 0.75};
    out[1] = (lobe){coma, 1.1, 0.5, 1.1};
    out[2] = (lobe){0.05, 0.0, 0.0, 2.8};
}

static double part(double at, double sigma) {
    return 0.5 * (erf((at + 0.5) / (sigma * sqrt(2.0))) - erf((at - 0.5) / (sigma * sqrt(2.0))));
}

/* Share of a star's light in the pixel at (x, y) from its place. */
static double effective(const lobe l[LOBES], double x, double y) {
    double sum = 0.0;
    for (int k = 0; k < LOBES; k++) {
        sum += l[k].share * part(x - l[k].x, l[k].sigma) * part(y - l[k].y, l[k].sigma);
    }
    return sum;
}

/* The same before integration over the pixel. */
static double before_pixel(const lobe l[LOBES], double x, double y) {
    double sum = 0.0;
    for (int k = 0; k < LOBES; k++) {
        double s2 = l[k].sigma * l[k].sigma;
        double r2 = (x - l[k].x) * (x - l[k].x) + (y - l[k].y) * (y - l[k].y);
        sum += l[k].share / (2.0 * BST_PI * s2) * exp(-0.5 * r2 / s2);
    }
    return sum;
}

/* Middle of the light within 3 px, where the fit puts the star's place. */
static void middle_of(const lobe l[LOBES], double *x, double *y) {
    *x = *y = 0.0;
    for (int pass = 0; pass < 20; pass++) {
        double sum = 0.0, u = 0.0, v = 0.0;
        for (int k = 0; k < SAMPLES; k++) {
            double dx = (k % SIDE - SIDE / 2) / (double)OVER,
                   dy = (k / SIDE - SIDE / 2) / (double)OVER;
            double e = hypot(dx, dy) <= 3.0 ? effective(l, *x + dx, *y + dy) : 0.0;
            sum += e;
            u += e * dx;
            v += e * dy;
        }
        *x += u / sum;
        *y += v / sum;
    }
}

/* Stars whose PSF is mixed between those of the field's two sides, each about its middle, as the
 * renderer mixes them. */
static void draw(int turn, bst_effective_psf_star *stars, float *pixels) {
    lobe side[2][LOBES];
    double c[2][2];
    for (int n = 0; n < 2; n++) {
        lobes_at(n, side[n]);
        middle_of(side[n], &c[n][0], &c[n][1]);
    }
    state_of_draws = UINT64_C(7) + UINT64_C(1000003) * (uint64_t)turn;
    for (int i = 0; i < STARS; i++) {
        double u = uniform(), light = 2e4 * pow(40.0, uniform()), level = 300.0 * uniform();
        double x = uniform() - 0.5, y = uniform() - 0.5;
        float *to = pixels + (size_t)i * STAMP * STAMP;
        for (int k = 0; k < STAMP * STAMP; k++) {
            double dx = k % STAMP - HALF - x, dy = k / STAMP - HALF - y;
            double e = light * ((1.0 - u) * effective(side[0], c[0][0] + dx, c[0][1] + dy) +
                                u * effective(side[1], c[1][0] + dx, c[1][1] + dy));
            to[k] = (float)(e + level + sqrt(NOISE_E * NOISE_E + e) * normal());
        }
        to[i % (STAMP * STAMP)] = i % 3 == 0 ? NAN : 4e4F; /* bad pixels and hits */
        stars[i] = (bst_effective_psf_star){.pixels = to,
                                            .x_px = x + 0.1 * normal(),
                                            .y_px = y + 0.1 * normal(),
                                            .field_x = u,
                                            .field_y = uniform(),
                                            .noise_e = NOISE_E,
                                            .part = i % BST_EFFECTIVE_PSF_PARTS};
    }
}

/* Draws, and the errors of the samples within 3 px over their standard errors. */
typedef struct trial {
    int draws;
    double off2, in;
} trial;

/* Errors over the standard errors as the file of samples has them. */
static void add_errors(const bst_effective_psf *psf, int node, const double *truth, trial *t) {
    static double sigma[SAMPLES], pooled[SAMPLES];
    for (int k = 0; k < SAMPLES; k++) {
        double without[BST_EFFECTIVE_PSF_PARTS];
        for (int p = 0; p < BST_EFFECTIVE_PSF_PARTS; p++) {
            without[p] = psf->without[(size_t)(2 * p + node) * SAMPLES + (size_t)k];
        }
        sigma[k] = bst_effective_psf_standard_error(without);
    }
    bst_effective_psf_pool_errors(sigma, SIDE, pooled);
    for (int k = 0; k < SAMPLES; k++) {
        if (hypot(k % SIDE - SIDE / 2, k / SIDE - SIDE / 2) < 3.0 * OVER) {
            double error = psf->value[(size_t)node * SAMPLES + (size_t)k] - truth[k];
            t->off2 += error * error / (pooled[k] * pooled[k]);
            t->in += 1.0;
        }
    }
}

static void come_back(int turn, trial *total) {
    static float pixels[STARS * STAMP * STAMP];
    static bst_effective_psf_star stars[STARS];
    static double before[SAMPLES], truth[SAMPLES], effective_truth[SAMPLES];
    bst_ctx ctx = {0};
    bst_effective_psf psf;
    draw(turn, stars, pixels);
    const bst_effective_psf_options options = {.columns = 2, .rows = 1, .half_px = HALF};
    bst_assert_ok(&ctx, bst_effective_psf_fit(&ctx, stars, STARS, &options, &psf));
    assert_int_equal(psf.side, SIDE);
    assert_in_range(psf.stars, STARS - 20, STARS);
    /* 3,400 pixels of cores: a standard deviation of 0.02; the samples that are fitted to them take
     * a tenth: 0.87 to 0.92 in four draws */
    bst_assert_close(psf.chi_squared, 0.92, 0.1);
    for (int node = 0; node < 2; node++) {
        lobe l[LOBES];
        double cx, cy, peak = 0.0, worst = 0.0;
        lobes_at(node, l);
        middle_of(l, &cx, &cy);
        const double *plane = psf.value + (size_t)node * SAMPLES;
        for (int k = 0; k < SAMPLES; k++) {
            double x = (k % SIDE - SIDE / 2) / (double)OVER,
                   y = (k / SIDE - SIDE / 2) / (double)OVER;
            double true_value = effective(l, cx + x, cy + y);
            effective_truth[k] = true_value;
            truth[k] = before_pixel(l, cx + x, cy + y);
            peak = fmax(peak, true_value);
            worst = fmax(worst, fabs(plane[k] - true_value));
        }
        add_errors(&psf, node, effective_truth, total);
        if (turn > 0) {
            continue;
        }
        /* noise of a sample is 0.3 % of the peak, and smoothing bends its sharpest part by 0.5 % */
        assert_true(worst < 0.012 * peak);
        bst_assert_ok(&ctx, bst_effective_psf_undo_pixel(&ctx, plane, SIDE, before));
        bst_effective_psf_figures f = bst_effective_psf_measure(before, SIDE),
                                  t = bst_effective_psf_measure(truth, SIDE);
        /* 1 % of the moments: noise 0.3 %; the level of the outermost ring takes 0.1 % of the
         * light */
        bst_assert_close(f.xx_px2, t.xx_px2, 0.01 * t.xx_px2);
        bst_assert_close(f.yy_px2, t.yy_px2, 0.01 * t.yy_px2);
        bst_assert_close(f.xy_px2, t.xy_px2, 0.01 * t.xx_px2);
        for (int r = 0; r < BST_EFFECTIVE_PSF_RADII; r++) {
            bst_assert_close(f.encircled[r], t.encircled[r], 0.004);
        }
    }
    bst_effective_psf_free(&psf);
}

static void test_coma_and_wings_come_back(void **state) {
    trial *t = *state;
    for (int turn = 0; turn < t->draws; turn++) {
        come_back(turn, t);
    }
    /* some 100 independent samples a draw, with what smoothing bends: of single draws of 160 stars
     * 0.91 to 1.16 */
    bst_assert_close(sqrt(t->off2 / t->in), 1.0, t->draws < 10 ? 0.25 : 0.1);
}

static void test_too_few_stars(void **state) {
    (void)state;
    static float pixels[STARS * STAMP * STAMP];
    static bst_effective_psf_star stars[STARS];
    bst_ctx ctx = {0};
    bst_effective_psf psf;
    draw(0, stars, pixels);
    const bst_effective_psf_options options = {.columns = 2, .rows = 1, .half_px = HALF};
    assert_int_equal(bst_effective_psf_fit(&ctx, stars, 19, &options, &psf), BST_ERR_RANGE);
    assert_non_null(strstr(
        ctx.message, "stars are too few for a PSF at 2 places of the field (allowed: at least"));
    /* of all but 18 there is only noise: light of 1.6 standard deviations, of which 10 are needed
     */
    static float kept[STARS * STAMP * STAMP];
    memcpy(kept, pixels, sizeof kept);
    for (int k = 18 * STAMP * STAMP; k < STARS * STAMP * STAMP; k++) {
        pixels[k] = (float)(100.0 + normal());
    }
    assert_int_equal(bst_effective_psf_fit(&ctx, stars, STARS, &options, &psf), BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message, "stars are too few for a PSF at 2 places"));
    memcpy(pixels, kept, sizeof kept);
    for (int i = 0; i < STARS; i++) {
        stars[i].field_x *= 0.005;
    }
    assert_int_equal(bst_effective_psf_fit(&ctx, stars, STARS, &options, &psf), BST_ERR_RANGE);
    assert_non_null(strstr(ctx.message, "are near the node of the field in column 1, row 0"));
}

int main(int argc, char **argv) {
    trial t = {.draws = argc > 1 ? atoi(argv[1]) : 1};
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_prestate(test_coma_and_wings_come_back, &t),
        cmocka_unit_test(test_too_few_stars),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
