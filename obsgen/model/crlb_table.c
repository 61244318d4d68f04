#include "obsgen/model/crlb_table.h"

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

/* Share of light of a smeared segment in pixel k: second difference of antiderivatives. */
static double segment_integral(double k, double c, double sigma, double length) {
    double sum = 0.0;
    int parts = length < 0.02 * sigma ? 1 : (int)fmin(ceil(3.0 * length / sigma), 4096.0);
    double lo = k - 0.5 - 7.0 * sigma, hi = k + 0.5 + 7.0 * sigma;
    for (int i = 0; i < parts; i++) {
        double at = c + length * ((i + 0.5) / parts - 0.5);
        sum += at > lo && at < hi ? pixel_integral(k, at, sigma) : 0.0;
    }
    return sum / parts;
}
static double segment_integral_slope(double k, double c, double sigma, double length) {
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

/* Pixel-integrated profile of a segment and its derivative. */
static void make_profile(profile *p, double c, double sigma, double length) {
    double reach = 0.5 * length + 6.0 * sigma + 1.0;
    p->first = (int)floor(c - reach);
    p->count = (int)ceil(c + reach) - p->first + 1;
    p->count = p->count < MAX_PIXELS ? p->count : MAX_PIXELS;
    for (int i = 0; i < p->count; i++) {
        p->share[i] = segment_integral(p->first + i, c, sigma, length);
        p->slope[i] = segment_integral_slope(p->first + i, c, sigma, length);
    }
}

/* Adds the Fisher information of a product image: along, across, flux. */
static void add_information(const profile *x, const profile *y, double ratio, double sums[3]) {
    for (int j = 0; j < y->count; j++) {
        for (int i = 0; i < x->count; i++) {
            double p = x->share[i] * y->share[j];
            double w = 1.0 / (1.0 + ratio * p);
            double dx = x->slope[i] * y->share[j], dy = x->share[i] * y->slope[j];
            sums[0] += w * dx * dx;
            sums[1] += w * dy * dy;
            sums[2] += w * p * p;
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
    profile x, y;
    b->sigma_px = sigma_px = fmax(sigma_px, 0.2);
    for (int n = 0; n < BST_BOUND_LENGTHS; n++) {
        /* A streak that does not fit is cut in the middle: the straight part contributes
         * information across the path only, in proportion to its length. */
        double length = length_of(n, sigma_px), most = MAX_PIXELS - 2.0 * (6.0 * sigma_px + 2.0);
        double shown = fmin(length, most), share = length > 0.0 ? shown / length : 1.0;
        double sums[BST_BOUND_RATIOS][3] = {{0}}, squared = 0.0;
        for (int phase = 0; phase < PHASES * PHASES; phase++) {
            double cx = (phase % PHASES + 0.5) / PHASES - 0.5;
            double cy = (double)(phase / PHASES + 0.5) / PHASES - 0.5;
            make_profile(&x, cx, sigma_px, shown);
            make_profile(&y, cy, sigma_px, 0.0);
            for (int r = 0; r < BST_BOUND_RATIOS; r++) {
                add_information(&x, &y, share * pow(10.0, FIRST_RATIO + r / PER_DECADE), sums[r]);
            }
            squared += total_square(&x) * total_square(&y);
        }
        double mean = share / (PHASES * PHASES);
        for (int r = 0; r < BST_BOUND_RATIOS; r++) {
            b->along[n][r] = (float)log(sums[r][0] * mean * share);
            b->across[n][r] = (float)log(sums[r][1] * mean);
            b->flux[n][r] = (float)log(sums[r][2] * mean);
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
                                       double length_px, double wider) {
    /* equivalent to larger pixels with the noise of as many more of them */
    bst_crlb_table_at b = bst_crlb_table_of(bound, flux_e, noise_e * wider, length_px / wider);
    b.var_along_px2 *= wider * wider;
    b.var_across_px2 *= wider * wider;
    b.norm /= wider;
    return b;
}
