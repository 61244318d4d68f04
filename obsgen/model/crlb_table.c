#include "obsgen/model/crlb_table.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* log10 of the first ratio; nodes per decade */
static const double FIRST_RATIO = -1.0, PER_DECADE = 4.0;

enum { PHASES = 3, MAX_PIXELS = 128 };

static double length_of(int node, double sigma) {
    return node == 0 ? 0.0 : ldexp(sigma, node - 1);
}

/* Integral of a normal density centred at c over pixel k. */
static double pixel_integral(double k, double c, double sigma) {
    double s = sigma * sqrt(2.0);
    return 0.5 * (erf((k + 0.5 - c) / s) - erf((k - 0.5 - c) / s));
}
/* Derivative of pixel_integral by c. */
static double pixel_integral_slope(double k, double c, double sigma) {
    double a = (k + 0.5 - c) / sigma, b = (k - 0.5 - c) / sigma;
    return (exp(-0.5 * b * b) - exp(-0.5 * a * a)) / (sigma * 2.5066282746310002);
}

static double segment_integral_slope(double k, double c, double sigma, double length) {
    /* L^2 / 12 < 3e-5 sigma^2: a point to 2e-5 */
    if (length < 0.02 * sigma) {
        return pixel_integral_slope(k, c, sigma);
    }
    /* derivative by c: the segment's two ends */
    return (pixel_integral(k, c + 0.5 * length, sigma) -
            pixel_integral(k, c - 0.5 * length, sigma)) /
           length;
}

typedef struct profile {
    int first, count;
    double share[MAX_PIXELS], slope[MAX_PIXELS];
} profile;

/* Adds a normal density centred at `at`, integrated over the pixels within 7 sigma. */
static void add_point(profile *p, double at, double sigma) {
    double s = sigma * sqrt(2.0), reach = 7.0 * sigma + 1.5;
    int from = (int)fmax(floor(at - reach) - p->first, 0.0);
    int to = (int)fmin(ceil(at + reach) - p->first, p->count - 1.0);
    double before = erf((p->first + from - 0.5 - at) / s);
    for (int i = from; i <= to; i++) {
        /* neighbours share an edge */
        double k = p->first + i, after = erf((k + 0.5 - at) / s);
        if (at > k - 0.5 - 7.0 * sigma && at < k + 0.5 + 7.0 * sigma) {
            p->share[i] += 0.5 * (after - before);
        }
        before = after;
    }
}

/* Pixel-integrated profile of a segment and its derivative. */
static void make_profile(profile *p, double c, double sigma, double length) {
    double reach = 0.5 * length + 6.0 * sigma + 1.0;
    p->first = (int)floor(c - reach);
    p->count = (int)ceil(c + reach) - p->first + 1;
    p->count = p->count < MAX_PIXELS ? p->count : MAX_PIXELS;
    memset(p->share, 0, sizeof p->share);
    /* midpoints h = sigma / 3 apart: the ends err by h^2 / 24 of the slope, 0.1 % of the level */
    int parts = length < 0.02 * sigma ? 1 : (int)fmin(ceil(3.0 * length / sigma), 4096.0);
    for (int i = 0; i < parts; i++) {
        add_point(p, c + length * ((i + 0.5) / parts - 0.5), sigma);
    }
    for (int i = 0; i < p->count; i++) {
        p->share[i] /= parts;
        p->slope[i] = segment_integral_slope(p->first + i, c, sigma, length);
    }
}

typedef struct information {
    double along[BST_BOUND_RATIOS], across[BST_BOUND_RATIOS], flux[BST_BOUND_RATIOS];
} information;

/* Adds the Fisher information of a product image for each ratio. */
static void add_information(const profile *x, const profile *y,
                            const double ratio[BST_BOUND_RATIOS], information *sums) {
    for (int j = 0; j < y->count; j++) {
        for (int i = 0; i < x->count; i++) {
            double p = x->share[i] * y->share[j];
            double dx = x->slope[i] * y->share[j], dy = x->share[i] * y->slope[j];
            for (int r = 0; r < BST_BOUND_RATIOS; r++) {
                double w = 1.0 / (1.0 + ratio[r] * p);
                sums->along[r] += w * dx * dx;
                sums->across[r] += w * dy * dy;
                sums->flux[r] += w * p * p;
            }
        }
    }
}

static double total_square(const profile *p) {
    double sum = 0.0;
    for (int i = 0; i < p->count; i++) {
        sum += p->share[i] * p->share[i];
    }
    return sum;
}

void bst_crlb_table_init(bst_crlb_table *b, double sigma_px) {
    profile x[PHASES], y[PHASES];
    /* as in imgproc/detect/detect.c */
    b->sigma_px = sigma_px = fmax(sigma_px, 0.2);
    for (int n = 0; n < BST_BOUND_LENGTHS; n++) {
        /* A streak that does not fit is cut in the middle: the straight part contributes
         * information across the path only, in proportion to its length. */
        double length = length_of(n, sigma_px), most = MAX_PIXELS - 2.0 * (6.0 * sigma_px + 2.0);
        double shown = fmin(length, most), share = length > 0.0 ? shown / length : 1.0;
        double ratio[BST_BOUND_RATIOS], squared = 0.0;
        information sums = {.flux = {0}};
        for (int r = 0; r < BST_BOUND_RATIOS; r++) {
            ratio[r] = share * pow(10.0, FIRST_RATIO + r / PER_DECADE);
        }
        for (int phase = 0; phase < PHASES; phase++) {
            make_profile(&x[phase], (phase + 0.5) / PHASES - 0.5, sigma_px, shown);
            make_profile(&y[phase], (phase + 0.5) / PHASES - 0.5, sigma_px, 0.0);
        }
        for (int phase = 0; phase < PHASES * PHASES; phase++) {
            const profile *along = &x[phase % PHASES], *across = &y[phase / PHASES];
            add_information(along, across, ratio, &sums);
            squared += total_square(along) * total_square(across);
        }
        double mean = share / (PHASES * PHASES);
        for (int r = 0; r < BST_BOUND_RATIOS; r++) {
            b->along[n][r] = (float)log(sums.along[r] * mean * share);
            b->across[n][r] = (float)log(sums.across[r] * mean);
            b->flux[n][r] = (float)log(sums.flux[r] * mean);
        }
        b->squared[n] = (float)log(squared * mean);
    }
}

/* Node of a streak length in the table, and fraction; nodes are nearly linear in the square root.
 */
static int length_node(const bst_crlb_table *b, double length_px, double *part) {
    double x = length_px / b->sigma_px;
    if (!(x > 0.0)) {
        *part = 0.0;
        return 0;
    }
    if (x < 1.0) {
        *part = x * x; /* a short streak acts by its variance */
        return 0;
    }
    double at = 1.0 + log2(x);
    int node = (int)at;
    node = node < BST_BOUND_LENGTHS - 2 ? node : BST_BOUND_LENGTHS - 2;
    *part = fmin(at - node, 1.0);
    return node;
}

/* Bilinear interpolation in a table. */
static double between(const float (*table)[BST_BOUND_RATIOS], int n, double pn, int r, double pr) {
    double low = (double)table[n][r] + pr * (double)(table[n][r + 1] - table[n][r]);
    double high = (double)table[n + 1][r] + pr * (double)(table[n + 1][r + 1] - table[n + 1][r]);
    return exp(low + pn * (high - low));
}

double bst_crlb_table_norm(const bst_crlb_table *b, double length_px) {
    double part;
    int n = length_node(b, length_px, &part);
    return exp(0.5 * ((double)b->squared[n] + part * (double)(b->squared[n + 1] - b->squared[n])));
}

bst_crlb_table_at bst_crlb_table_of(const bst_crlb_table *b, double flux_e, double noise_e,
                                    double length_px) {
    assert(b && noise_e > 0.0 && length_px >= 0.0);
    double v = noise_e * noise_e, ratio = flux_e / v, pn;
    int n = length_node(b, length_px, &pn);
    double at = (log10(fmax(ratio, 1e-30)) - FIRST_RATIO) * PER_DECADE;
    at = fmin(fmax(at, 0.0), BST_BOUND_RATIOS - 1.0);
    int r = (int)at;
    r = r < BST_BOUND_RATIOS - 1 ? r : BST_BOUND_RATIOS - 2;
    double pr = at - r;
    /* beyond the table only shot noise counts: information is proportional to F */
    double beyond = fmax(ratio / pow(10.0, FIRST_RATIO + (BST_BOUND_RATIOS - 1) / PER_DECADE), 1.0);
    bst_crlb_table_at out;
    out.var_along_px2 = beyond / (flux_e * ratio * between(b->along, n, pn, r, pr));
    out.var_across_px2 = beyond / (flux_e * ratio * between(b->across, n, pn, r, pr));
    out.flux_variance = v * beyond / between(b->flux, n, pn, r, pr);
    out.norm = bst_crlb_table_norm(b, length_px);
    return out;
}

bst_crlb_table_at bst_crlb_table_wider(const bst_crlb_table *bound, double flux_e, double noise_e,
                                       double length_px, double wider, double excess) {
    assert(wider > 0.0 && excess >= 1.0);
    /* equivalent to larger pixels with the noise of as many more of them; the variance of a pixel,
     * v + excess F p, is excess times that of plain shot noise over v / excess */
    bst_crlb_table_at b =
        bst_crlb_table_of(bound, flux_e, noise_e * wider / sqrt(excess), length_px / wider);
    b.var_along_px2 *= wider * wider * excess;
    b.var_across_px2 *= wider * wider * excess;
    b.flux_variance *= excess;
    b.norm /= wider;
    return b;
}
