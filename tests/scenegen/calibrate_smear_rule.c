/* Measures the factors of scenegen/smear/smear_rule.c that no formula gives, and the greatest
 * derivatives of a Gaussian that its formulas take.
 *
 * A factor is as large as it must be when the worst measured error of many paths is just below the
 * predicted one. The factors are checked on paths where their term is the greater part of the
 * prediction: fast jitter about a line for NEIGHBOURS, smooth motion for MARGIN, and rows of equal
 * groups on a line for neighbours_part. Prints the ratios of measured and predicted error. */
#include <stdlib.h>

#include "boresight/rng.h"
#include "scenegen/smear/motion.h"
#include "tests/test_support.h"

static const double sigma_px = 0.85;

enum { POINTS = 400, TONES = 12 };

typedef struct path {
    bst_smear_path_point point[POINTS];
    double low[2], high[2];
} path;

/* Light of the path at a place, over that of a point at its centre: of each stretch, straight and
 * uniform, in closed form. */
static double true_image(const path *p, double x, double y) {
    double sum = 0.0;
    for (int k = 0; k + 1 < POINTS; k++) {
        const double *a = p->point[k].p, *b = p->point[k + 1].p;
        double dx = b[0] - a[0], dy = b[1] - a[1], length = hypot(dx, dy);
        double begin = ((a[0] - x) * dx + (a[1] - y) * dy) / length;
        double across = ((a[0] - x) * dy - (a[1] - y) * dx) / length;
        if (across * across > 40.0 * sigma_px * sigma_px) {
            continue;
        }
        double root = sqrt(2.0) * sigma_px;
        double light = erf((begin + length) / root) - erf(begin / root);
        sum += (p->point[k + 1].s - p->point[k].s) * 0.5 * sqrt(BST_PI) * root / length * light *
               exp(-across * across / (root * root));
    }
    return sum;
}

static double node_image(const bst_smear_node_list *list, double x, double y) {
    double sum = 0.0;
    for (int n = 0; n < list->count; n++) {
        const bst_smear_node *node = &list->items[n];
        double dx = x - node->p[0], dy = y - node->p[1];
        double variance = sigma_px * sigma_px + node->variance;
        sum += node->weight * sigma_px * sigma_px / variance *
               exp(-0.5 * (dx * dx + dy * dy) / variance);
    }
    return sum;
}

/* Largest error of the nodes' image, over its peak, over the bound of the groups and over the
 * predicted one. */
static void ratios_of(const path *p, double tolerance, double widest, double ratio[2]) {
    bst_ctx ctx = {0};
    bst_smear_node_list list = {0};
    const bst_smear_node_aim aim = {
        .psf_sigma_px = sigma_px, .tolerance = tolerance, .widest = widest};
    bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, p->point, POINTS, &aim, &list));
    double worst = 0.0, peak = 0.0;
    for (double y = p->low[1] - 2.0; y < p->high[1] + 2.0; y += 0.35) {
        for (double x = p->low[0] - 2.0; x < p->high[0] + 2.0; x += 0.3) {
            double image = true_image(p, x, y);
            peak = fmax(peak, image);
            worst = fmax(worst, fabs(node_image(&list, x, y) - image));
        }
    }
    ratio[0] = worst / peak / bst_smear_nodes_error(list.error, 1.0);
    ratio[1] = worst / peak / bst_smear_nodes_error(list.predicted, 1.0);
    free(list.items);
}

static double uniform(bst_rng_key key, uint64_t a, uint64_t b, double low, double high) {
    return low + (high - low) * bst_rng_uniform(key, a, b);
}

/* A line with jitter of TONES frequencies, or with a bend and an acceleration. */
static void make_path(path *p, int trial, bool jitter) {
    bst_rng_key key = bst_rng_make_key(11, (uint64_t)trial, "test", "calibrate smear rule");
    double length = uniform(key, 0, 0, jitter ? 0.5 : 3.0, jitter ? 6.0 : 12.0);
    double angle = uniform(key, 0, 1, 0.0, 2.0 * BST_PI), c = cos(angle), s = sin(angle);
    double rms = jitter ? uniform(key, 0, 2, 0.1, 0.5) : 0.0;
    double rush = jitter ? 0.0 : uniform(key, 0, 3, -0.8, 0.8);
    double bend = jitter ? 0.0 : uniform(key, 0, 4, -0.15, 0.15);
    p->low[0] = p->low[1] = 1e9;
    p->high[0] = p->high[1] = -1e9;
    for (int k = 0; k < POINTS; k++) {
        double t = (double)k / (POINTS - 1), u = t - 0.5;
        double along = length * (u + rush * u * u), across = 4.0 * bend * length * u * u;
        double at[2] = {along * c - across * s, along * s + across * c};
        for (int i = 0; i < 2 && jitter; i++) {
            for (int f = 0; f < TONES; f++) {
                double phase = uniform(key, 10 + (uint64_t)i, (uint64_t)f, 0.0, 2.0 * BST_PI);
                double hz = uniform(key, 20 + (uint64_t)i, (uint64_t)f, 2.0, 90.0);
                at[i] += rms * sqrt(2.0 / TONES) * sin(2.0 * BST_PI * hz * t + phase);
            }
        }
        p->point[k] = (bst_smear_path_point){{at[0], at[1], 0.0}, t};
        for (int i = 0; i < 2; i++) {
            p->low[i] = fmin(p->low[i], at[i]);
            p->high[i] = fmax(p->high[i], at[i]);
        }
    }
}

static void worst_ratios(bool jitter, int trials, double worst[2]) {
    static path p;
    static const double tolerances[] = {0.1, 0.03, 0.01, 0.003};
    worst[0] = worst[1] = 0.0;
    for (int trial = 0; trial < trials; trial++) {
        make_path(&p, trial, jitter);
        for (int k = 0; k < 4; k++) {
            double ratio[2];
            ratios_of(&p, tolerances[k], jitter ? 1.0 : 0.0, ratio);
            worst[0] = fmax(worst[0], ratio[0]);
            worst[1] = fmax(worst[1], ratio[1]);
        }
    }
}

/* NEIGHBOURS 1.3: not below the least factor that covers the worst path, and no more than a sixth
 * above it. */
static void neighbours_of_jittered_paths(void **state) {
    (void)state;
    double worst[2];
    worst_ratios(true, 36, worst);
    print_message("jitter: worst measured error over its bound %.3f, over the predicted one %.3f\n",
                  worst[0], worst[1]);
    assert_true(worst[0] <= 1.0 && worst[1] <= 1.0);
    assert_true(worst[0] >= 0.85);
}

/* MARGIN 1.08: the same of the quadrature's own error. */
static void margin_of_smooth_paths(void **state) {
    (void)state;
    double worst[2];
    worst_ratios(false, 24, worst);
    print_message("smooth: worst measured error over its bound %.3f, over the predicted one %.3f\n",
                  worst[0], worst[1]);
    assert_true(worst[0] <= 1.0 && worst[1] <= 1.0);
    assert_true(worst[0] >= 0.8);
}

/* Equal groups of three nodes in a row, `length` sigma each, sigma 1: largest error of their image,
 * over the predicted one. */
static double ratio_in_a_row(double length, int groups) {
    bst_ctx ctx = {0};
    double half = 0.5 * length;
    /* a fifth above the error of three nodes, 4 / 175 half^6 over 48: no fewer, and one group */
    const bst_smear_node_aim aim = {.psf_sigma_px = 1.0,
                                    .tolerance = 1.2 * 1.08 * pow(half, 6.0) * 4.0 / 175.0 / 48.0};
    const bst_smear_path_point way[] = {{{-half, 0.0, 0.0}, 0.0}, {{half, 0.0, 0.0}, 1.0}};
    bst_smear_node_list list = {0};
    bst_assert_ok(&ctx, bst_smear_nodes_from_path(&ctx, way, 2, &aim, &list));
    assert_int_equal(list.count, 3);
    double worst = 0.0, light = 0.0, end = half * groups;
    for (double x = 0.0; x < end + 3.0; x += 0.05) {
        double image = sqrt(0.5 * BST_PI) / (2.0 * end) *
                       (erf((x + end) / sqrt(2.0)) - erf((x - end) / sqrt(2.0)));
        double nodes = 0.0;
        for (int g = 0; g < groups; g++) {
            for (int n = 0; n < 3; n++) {
                double d = x - list.items[n].p[0] - (g - 0.5 * (groups - 1)) * length;
                nodes += list.items[n].weight / groups * exp(-0.5 * d * d);
            }
        }
        light = fmax(light, nodes);
        worst = fmax(worst, fabs(nodes - image));
    }
    double predicted = bst_smear_nodes_error(list.predicted, 1.0);
    free(list.items);
    return worst / light / predicted;
}

/* The 8 % by which neighbours add up, and where: just enough for rows of any length. */
static void neighbours_in_a_row(void **state) {
    (void)state;
    double worst = 0.0, at = 0.0;
    for (double length = 1.0; length < 5.5; length += 0.1) {
        for (int groups = 1; groups <= 8; groups++) {
            double ratio = ratio_in_a_row(length, groups);
            at = ratio > worst ? length : at;
            worst = fmax(worst, ratio);
        }
    }
    print_message("rows: worst measured over predicted error %.3f, groups of %.1f sigma\n", worst,
                  at);
    assert_true(worst <= 1.0);
    assert_true(worst >= 0.96);
}

/* Hermite polynomial of order n. */
static double hermite(int n, double x) {
    double before = 1.0, now = x;
    for (int k = 1; k < n; k++) {
        double next = x * now - k * before;
        before = now;
        now = next;
    }
    return n == 0 ? 1.0 : now;
}

/* Greatest derivative of a Gaussian of unit height and sigma, nx times by x and ny times by y. */
static double greatest(int nx, int ny) {
    double most = 0.0;
    for (double y = 0.0; y < 4.0; y += 0.005) {
        for (double x = 0.0; x < 4.0; x += 0.005) {
            double value = hermite(nx, x) * hermite(ny, y) * exp(-0.5 * (x * x + y * y));
            most = fmax(most, fabs(value));
        }
    }
    return most;
}

/* The factors of the Taylor series: moment over factorials, times the greatest derivative. Written
 * in the source with two digits, which rounds by up to 2 %. */
static void taylor_factors(void **state) {
    (void)state;
    bst_assert_close(greatest(3, 0) / 6.0, 0.23, 0.02 * 0.23);        /* E[x^3] */
    bst_assert_close(greatest(1, 2) / 2.0, 0.30, 0.02 * 0.30);        /* E[x y^2] */
    bst_assert_close(greatest(3, 1) / 6.0, 0.14, 0.02 * 0.14);        /* E[x^3 y] */
    bst_assert_close(greatest(2, 2) / 4.0, 0.25, 0.02 * 0.25);        /* E[x^2 y^2] */
    bst_assert_close(1.2 * greatest(4, 0) / 24.0, 0.15, 0.02 * 0.15); /* fourth cumulant */
    bst_assert_close(greatest(1, 1), 0.37, 0.02 * 0.37);              /* E[x y] */
    bst_assert_close(greatest(1, 0) / 2.0, 0.304, 0.02 * 0.304);      /* shift of the mean */
    bst_assert_close(24.0 / greatest(4, 0), 8.0, 0.02 * 8.0);         /* two nodes */
    bst_assert_close(720.0 / greatest(6, 0), 48.0, 0.02 * 48.0);      /* three nodes */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(taylor_factors),
        cmocka_unit_test(neighbours_of_jittered_paths),
        cmocka_unit_test(margin_of_smooth_paths),
        cmocka_unit_test(neighbours_in_a_row),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
