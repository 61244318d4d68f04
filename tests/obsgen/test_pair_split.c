/* Pairs that image processing finds by a likelihood ratio: chi-square, errors and light of both
 * against sums over fine pixels and numerical derivatives. Linked with wraps of the tail of
 * chi-square, which keeps what it is asked, and of the generator's draws. */
#include "boresight/vec.h"
#include "obsgen/generator_internal.h"
#include "sim/core/chi_square.h"
#include "tests/test_support.h"

enum { FINE = 4, REACH = 14, ONE = 3, BOTH = 6 }; /* cells per px; px about the pair */

static double asked[2][2]; /* x and d of the calls */
static int calls;
static double answers[2] = {1.0, 1.0}, draw = 0.5; /* of the tail: near and far; of the draw */

double __wrap_bst_chi_square3_tail(double x, double d);
double __wrap_bst_chi_square3_tail(double x, double d) {
    if (calls < 2) {
        asked[calls][0] = x;
        asked[calls][1] = d;
    }
    return answers[calls++ > 0];
}

double __wrap_bst_generator_uniform(const bst_generator *g, uint64_t which);
double __wrap_bst_generator_uniform(const bst_generator *g, uint64_t which) {
    (void)g;
    (void)which;
    return draw;
}

/* A source as the test sees it: light and place, px. */
typedef struct light {
    double v[ONE];
} light;

typedef struct pair_scene {
    double sigma, length, c, s, noise2, excess; /* path of the streaks along (c, s) */
    light source[2];
} pair_scene;

/* Light per px^2 of a source at a place. */
static double image_at(const pair_scene *p, const double *v, double x, double y) {
    double dx = x - v[1], dy = y - v[2];
    double along = p->c * dx + p->s * dy, across = p->c * dy - p->s * dx, one;
    double bell =
        exp(-0.5 * across * across / (p->sigma * p->sigma)) / (p->sigma * sqrt(2.0 * BST_PI));
    if (p->length > 0.0) {
        double root = sqrt(2.0) * p->sigma, half = 0.5 * p->length;
        one = 0.5 * (erf((along + half) / root) - erf((along - half) / root)) / p->length;
    } else {
        one = exp(-0.5 * along * along / (p->sigma * p->sigma)) / (p->sigma * sqrt(2.0 * BST_PI));
    }
    return v[0] * one * bell;
}

/* Inverse of a symmetric matrix by Gauss and Jordan. */
static void invert(int n, double a[BOTH][BOTH]) {
    for (int i = 0; i < n; i++) {
        double pivot = a[i][i];
        a[i][i] = 1.0;
        for (int k = 0; k < n; k++) {
            a[i][k] /= pivot;
        }
        for (int r = 0; r < n; r++) {
            double f = a[r][i];
            if (r != i) {
                a[r][i] = 0.0;
                for (int k = 0; k < n; k++) {
                    a[r][k] -= f * a[i][k];
                }
            }
        }
    }
}

/* Information of the parameters v of n / 3 sources at their values, right side of a step towards
 * the image of the pair, and chi-square of the difference. */
static double sums_of(const pair_scene *p, int n, const double *v, double a[BOTH][BOTH],
                      double b[BOTH]) {
    double chi = 0.0, middle[2] = {0.5 * (p->source[0].v[1] + p->source[1].v[1]),
                                   0.5 * (p->source[0].v[2] + p->source[1].v[2])};
    int cells = 2 * REACH * FINE;
    memset(a, 0, sizeof(double[BOTH][BOTH]));
    memset(b, 0, sizeof(double[BOTH]));
    for (int i = 0; i < cells * cells; i++) {
        double x = middle[0] - REACH + (i % cells + 0.5) / FINE,
               y = middle[1] - REACH + (i / cells + 0.5) / FINE;
        double truth = image_at(p, p->source[0].v, x, y) + image_at(p, p->source[1].v, x, y);
        double w = 1.0 / (FINE * FINE) / (p->noise2 + p->excess * truth), model = 0.0, j[BOTH];
        for (int k = 0; k < n; k++) {
            double high[ONE], low[ONE], h = k % ONE ? 1e-4 : 1e-3 * v[k];
            const double *own = v + k / ONE * ONE;
            memcpy(high, own, sizeof high);
            memcpy(low, own, sizeof low);
            high[k % ONE] += h;
            low[k % ONE] -= h;
            j[k] = (image_at(p, high, x, y) - image_at(p, low, x, y)) / (2.0 * h);
            model += k % ONE ? 0.0 : image_at(p, own, x, y);
        }
        chi += w * (truth - model) * (truth - model);
        for (int k = 0; k < n; k++) {
            for (int l = 0; l < n; l++) {
                a[k][l] += w * j[k] * j[l];
            }
            b[k] += w * j[k] * (truth - model);
        }
    }
    return chi;
}

/* Chi-square of the best single source from the centre of the light. */
static double best_of_one(const pair_scene *p) {
    const double *s = p->source[0].v, *t = p->source[1].v;
    double all = s[0] + t[0], a[BOTH][BOTH], b[BOTH], chi = 0.0;
    double v[ONE] = {all, (s[0] * s[1] + t[0] * t[1]) / all, (s[0] * s[2] + t[0] * t[2]) / all};
    for (int round = 0; round < 8; round++) {
        chi = sums_of(p, ONE, v, a, b);
        invert(ONE, a);
        for (int k = 0; k < ONE; k++) {
            for (int l = 0; l < ONE; l++) {
                v[k] += a[k][l] * b[l];
            }
        }
    }
    return chi;
}

/* What the pair test says of a pair: both sources of the generator. */
static void split(const pair_scene *p, generator_source out[2]) {
    static bst_generator g;
    generator_rank ranks[2] = {{20.0, 0}, {10.0, 1}};
    g = (bst_generator){.settings = {.false_splits = 0.01},
                        .binning = 1,
                        .width = 120,
                        .height = 90,
                        .total_sigma = p->sigma,
                        .fitted_sigma = 0.9,
                        .noise_e = sqrt(p->noise2),
                        .excess = p->excess,
                        .sources = out,
                        .ranks = ranks,
                        .rank_count = 2,
                        .source_count = 2};
    for (int k = 0; k < 2; k++) {
        out[k] = (generator_source){.x = p->source[k].v[1],
                                    .y = p->source[k].v[2],
                                    .flux_e = p->source[k].v[0],
                                    .length = p->length,
                                    .path = {p->length * p->c, p->length * p->s},
                                    .as_streak = p->length > 0.0,
                                    .found = k == 0,
                                    .head = k == 0 ? -1 : 0,
                                    .partner = -1,
                                    .name = (uint64_t)k,
                                    .peak = 20.0};
    }
    calls = 0;
    bst_generator_split_pairs(&g);
}

/* Probability that a fit finds the pair farther apart than a full width at half maximum, from the
 * covariance of both places. */
static double share_far(const pair_scene *p, double inverse[BOTH][BOTH]) {
    double d[2] = {p->source[1].v[1] - p->source[0].v[1], p->source[1].v[2] - p->source[0].v[2]},
           apart = hypot(d[0], d[1]), variance = 0.0;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 2; k++) {
            double own = inverse[1 + i][1 + k] + inverse[4 + i][4 + k],
                   shared = inverse[1 + i][4 + k] + inverse[4 + i][1 + k];
            variance += d[i] * d[k] / (apart * apart) * (own - shared);
        }
    }
    double fwhm = 2.0 * sqrt(2.0 * log(2.0)) * p->sigma;
    return 0.5 * erfc(-(apart - fwhm) / sqrt(2.0 * variance));
}

/* Chi-square to 1e-3 and the errors' ratios to 2e-3: the generator's grid has half a sigma and ends
 * at four; the test's has 1/4 px and ends far outside. */
static void check(const pair_scene *p) {
    generator_source out[2];
    double a[BOTH][BOTH], b[BOTH], v[BOTH], variance[2], information[2][2][BOTH][BOTH];
    split(p, out);
    assert_true(out[1].found && out[1].head == -1);
    assert_int_equal(out[0].partner, 1);
    assert_int_equal(out[1].partner, 0);
    assert_true(calls > 0);
    double chi = asked[0][1] * asked[0][1];
    bst_assert_close(chi, best_of_one(p), 1e-3 * chi);
    memcpy(v, p->source[0].v, sizeof p->source[0].v);
    memcpy(v + ONE, p->source[1].v, sizeof p->source[1].v);
    (void)sums_of(p, BOTH, v, a, b);
    for (int s = 0; s < 2; s++) {
        for (int k = 0; k < ONE * ONE; k++) {
            information[0][s][k / ONE][k % ONE] = a[ONE * s + k / ONE][ONE * s + k % ONE];
        }
        invert(ONE, information[0][s]);
        variance[s] = information[0][s][1][1] + information[0][s][2][2];
    }
    invert(BOTH, a);
    for (int s = 0; s < 2; s++) {
        int x = ONE * s + 1;
        bst_assert_close(out[s].partner_widen, (a[x][x] + a[x + 1][x + 1]) / variance[s],
                         2e-3 * out[s].partner_widen);
    }
    double least = bst_chi_square3_quantile(0.01);
    if (p->length > 0.0) {
        bst_assert_close(asked[0][0], least + 1.4, 1e-9); /* 2 ln 2: on the path */
        assert_int_equal(calls, 1);
    } else {
        bst_assert_close(asked[0][0], least, 1e-9);
        bst_assert_close(asked[1][0], least + 5.5, 1e-9); /* 2 ln 16: beside the source */
        bst_assert_close(asked[1][1], asked[0][1], 1e-12);
        double far = share_far(p, a);
        assert_true(far > 0.02 && far < 0.98);
        answers[0] = 0.0; /* pairs that are far apart alone */
        draw = far - 0.005;
        split(p, out);
        assert_true(out[1].found);
        draw = far + 0.005;
        split(p, out);
        assert_false(out[1].found);
        answers[0] = 1.0;
        draw = 0.5;
    }
}

static void points_in_all_directions(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        double angle = 0.4 + 1.3 * k, apart = 2.217 + 0.015 * k;
        const pair_scene p = {
            .sigma = 0.95,
            .c = 1.0,
            .noise2 = 144.0,
            .excess = 1.3,
            .source = {{{9000.0, 50.3, 40.8}},
                       {{5000.0, 50.3 + apart * cos(angle), 40.8 + apart * sin(angle)}}}};
        check(&p);
    }
}

static void streaks_in_all_directions(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++) {
        double way = 0.5 + 1.1 * k;
        const pair_scene p = {.sigma = 1.05,
                              .length = 6.0,
                              .c = cos(way),
                              .s = sin(way),
                              .noise2 = 100.0,
                              .excess = 1.0,
                              .source = {{{20000.0, 50.3, 40.8}}, {{12000.0, 51.4, 42.1}}}};
        check(&p);
    }
}

/* Another detection within the pixels that are fitted, along each axis of a slanting path. */
static void others_disturb(void **state) {
    (void)state;
    static bst_generator g;
    /* a path of 12 px along y: half sides of 3.24 and 9.24 px */
    static const struct {
        double dx, dy;
        bool split;
    } cases[] = {{0.0, 9.0, false}, {0.0, 9.5, true}, {3.0, 0.0, false}, {3.5, 0.0, true}};
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        generator_source s[3];
        generator_rank ranks[3] = {{20.0, 0}, {10.0, 1}, {9.0, 2}};
        for (int k = 0; k < 3; k++) {
            s[k] = (generator_source){.x = 50.0 + (k == 2 ? cases[n].dx : 0.3 * k),
                                      .y = 45.0 + (k == 2 ? cases[n].dy : 1.5 * k),
                                      .flux_e = 8000.0,
                                      .length = 12.0,
                                      .path = {0.0, 12.0},
                                      .as_streak = true,
                                      .found = k != 1,
                                      .head = k == 1 ? 0 : -1,
                                      .partner = -1,
                                      .name = (uint64_t)k};
        }
        g = (bst_generator){.settings = {.false_splits = 0.01},
                            .binning = 1,
                            .width = 120,
                            .height = 90,
                            .total_sigma = 0.95,
                            .fitted_sigma = 0.9,
                            .noise_e = 10.0,
                            .excess = 1.0,
                            .sources = s,
                            .ranks = ranks,
                            .rank_count = 3,
                            .source_count = 3};
        bst_generator_split_pairs(&g);
        assert_int_equal(s[1].found, cases[n].split);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(points_in_all_directions),
                                       cmocka_unit_test(streaks_in_all_directions),
                                       cmocka_unit_test(others_disturb)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
