#include "sim/analysis/characterize/hot_pixels.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/compare.h"

/* Groups of hot pixels: all, GROUPS of every tenth, then classes by charge. */
enum { ALL = -1, CLASS = 100 };
enum { LEAST_HOT = 20, LEAST_TRAILS = 50, MOST_TRAILS = 4000, GROUPS = 10, SCAN = 60 };

/* Sums of the decimal logarithms of hot rates above the limit and below what fits. */
typedef struct hot_sums {
    double n, mean, variance, cut;
    double full, most; /* pixels from `most` on */
} hot_sums;

/* Share of a normal distribution above x. */
static double above(double x) {
    return 0.5 * erfc(x / sqrt(2.0));
}

/* Logarithm of the likelihood of mean m and deviation s, cut off below; of full pixels it is only
 * known that they have more. */
static double likelihood(const hot_sums *h, double m, double s) {
    double d = h->mean - m, q = above((h->cut - m) / s);
    double full = h->full > 0.0 ? above((h->most - m) / s) : 1.0;
    if (!(q > 0.0 && full > 0.0)) {
        return -INFINITY;
    }
    return h->full * log(full) - h->n * (log(s) + 0.5 * (h->variance + d * d) / (s * s)) -
           (h->n + h->full) * log(q);
}

/* Most likely mean and deviation: a grid that shrinks about its best point. */
static void most_likely(const hot_sums *h, double *m, double *s) {
    double dm = 1.5 * sqrt(h->variance) + 0.05, ds = 0.9 * log(2.5);
    double at_s = sqrt(h->variance) + 1e-3;
    *m = h->mean;
    *s = at_s;
    for (int turn = 0; turn < SCAN; turn++) {
        double best = -INFINITY, best_m = *m, best_s = *s;
        for (int i = -2; i <= 2; i++) {
            for (int j = -2; j <= 2; j++) {
                double mi = *m + 0.5 * i * dm, sj = *s * exp(0.5 * j * ds);
                double l = likelihood(h, mi, sj);
                if (l > best) {
                    best = l;
                    best_m = mi;
                    best_s = sj;
                }
            }
        }
        *m = best_m;
        *s = best_s;
        dm *= 0.75;
        ds *= 0.75;
    }
}

/* Standard errors from the curvature of the likelihood. */
static bool curvature(const hot_sums *h, double m, double s, double covariance[3]) {
    double e = 0.02 * s;
    double l0 = likelihood(h, m, s);
    double mm = (likelihood(h, m + e, s) + likelihood(h, m - e, s) - 2.0 * l0) / (e * e);
    double ss = (likelihood(h, m, s + e) + likelihood(h, m, s - e) - 2.0 * l0) / (e * e);
    double ms = (likelihood(h, m + e, s + e) - likelihood(h, m + e, s - e) -
                 likelihood(h, m - e, s + e) + likelihood(h, m - e, s - e)) /
                (4.0 * e * e);
    double determinant = mm * ss - ms * ms;
    if (!(determinant > 0.0) || !(mm < 0.0)) {
        return false;
    }
    covariance[0] = -ss / determinant;
    covariance[1] = ms / determinant;
    covariance[2] = -mm / determinant;
    return true;
}

bst_hot_pixels bst_hot_pixels_fit(const float *excess, size_t count, double limit, double most) {
    const bst_sensor_estimate none = {NAN, NAN};
    bst_hot_pixels out = {0, limit, none, none, none};
    double sum = 0.0, sum2 = 0.0, covariance[3], m, s;
    size_t pixels = 0;
    int64_t full = 0;
    most = isnan(most) ? INFINITY : fmax(most, limit);
    for (size_t i = 0; i < count; i++) {
        pixels += isnan(excess[i]) ? 0 : 1;
        full += excess[i] > limit && excess[i] >= most;
        if (excess[i] > limit && excess[i] < most) {
            double x = log10((double)excess[i]);
            sum += x;
            sum2 += x * x;
            out.found++;
        }
    }
    double n = (double)out.found;
    out.found += full;
    if (n < LEAST_HOT) {
        return out;
    }
    const hot_sums h = {n,
                        sum / n,
                        fmax(sum2 / n - sum * sum / n / n, 1e-12),
                        log10(limit),
                        (double)full,
                        full > 0 ? log10(most) : INFINITY};
    n += (double)full;
    most_likely(&h, &m, &s);
    double share = above((h.cut - m) / s);
    if (share < 0.5 || !curvature(&h, m, s, covariance)) {
        return out; /* an extrapolation */
    }
    double z = (h.cut - m) / s, density = exp(-0.5 * z * z) / sqrt(2.0 * acos(-1.0));
    double by_m = density / s / share, by_s = density * z / s / share; /* d ln share */
    /* fraction n / (pixels share): n is of a Poisson law, and its logarithm has the variance 1 / n;
     * the fit's errors are independent of it, as the law of the values above a limit is not changed
     * by their number */
    double relative2 = 1.0 / n + by_m * by_m * covariance[0] + 2.0 * by_m * by_s * covariance[1] +
                       by_s * by_s * covariance[2];
    out.fraction.value = n / share / (double)pixels;
    out.fraction.sigma = out.fraction.value * sqrt(relative2);
    out.median.value = pow(10.0, m);
    out.median.sigma = out.median.value * log(10.0) * sqrt(covariance[0]);
    out.spread_dex = (bst_sensor_estimate){s, sqrt(covariance[2])};
    return out;
}

/* Steps to the neighbours: rows above, rows below, columns right, columns left. */
static const int steps[BST_TRAIL_SIDES][2] = {{0, 1}, {0, -1}, {1, 0}, {-1, 0}};

/* True if a pixel is the brightest within BST_TRAIL_PIXELS + 1 and can be used. */
static bool is_isolated(const float *map, int width, int height, int x, int y) {
    const int reach = BST_TRAIL_PIXELS + 1;
    if (x < reach || y < reach || x >= width - reach || y >= height - reach) {
        return false;
    }
    float peak = map[(size_t)y * (size_t)width + (size_t)x];
    for (int j = -reach; j <= reach; j++) {
        for (int i = -reach; i <= reach; i++) {
            float v = map[(size_t)(y + j) * (size_t)width + (size_t)(x + i)];
            if (isnan(v) || ((i != 0 || j != 0) && v >= peak)) {
                return false;
            }
        }
    }
    return true;
}

/* Hot pixels being stacked. */
typedef struct trail_stack {
    float *ratios[BST_TRAIL_SIDES][BST_TRAIL_PIXELS]; /* [used] charge over that of the hot pixel */
    double *charge;                                   /* [used] */
    double edges[BST_TRAIL_CLASSES + 1];              /* of the classes */
    double *scratch;
    int used;
} trail_stack;

/* True if a hot pixel is in a group. */
static bool is_in(const trail_stack *t, int i, int group) {
    int c = group - CLASS;
    return group == ALL || (group < CLASS && i % GROUPS == group) ||
           (c >= 0 && t->charge[i] >= t->edges[c] && t->charge[i] < t->edges[c + 1]);
}

/* Median of values of the hot pixels of a group; of their charges without ratios. */
static double median_of(const trail_stack *t, const float *ratios, int group) {
    int n = 0;
    for (int i = 0; i < t->used; i++) {
        if (is_in(t, i, group)) {
            t->scratch[n++] = ratios ? (double)ratios[i] : t->charge[i];
        }
    }
    qsort(t->scratch, (size_t)n, sizeof *t->scratch, bst_compare_doubles);
    return n > 0 ? 0.5 * (t->scratch[(n - 1) / 2] + t->scratch[n / 2]) : NAN;
}

/* Sum over the trail at one side less that at the other, of a group. */
static double asymmetry(const trail_stack *t, int side, int group) {
    double sum = 0.0;
    for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
        sum +=
            median_of(t, t->ratios[side][k], group) - median_of(t, t->ratios[side + 1][k], group);
    }
    return sum;
}

/* Asymmetry along an axis and its uncertainty; `up`: the trail lies at the first side. */
static bst_sensor_estimate trail_of(const trail_stack *t, int side, double *classes, bool *up) {
    double groups[GROUPS];
    for (int g = 0; g < GROUPS; g++) {
        groups[g] = asymmetry(t, side, g);
    }
    bst_sensor_estimate estimate = bst_mean_estimate(groups, GROUPS);
    estimate.value = asymmetry(t, side, ALL);
    *up = estimate.value > 0.0;
    estimate.value = fabs(estimate.value);
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        classes[c] = (*up ? 1.0 : -1.0) * asymmetry(t, side, CLASS + c);
    }
    return estimate;
}

/* Takes the neighbourhoods of the hot pixels of a map. */
static void stack_trails(trail_stack *t, const float *map, int width, int height, double least,
                         double most) {
    size_t pixels = (size_t)width * (size_t)height;
    for (size_t i = 0; i < pixels && t->used < MOST_TRAILS; i++) {
        int x = (int)(i % (size_t)width), y = (int)(i / (size_t)width);
        if (!(map[i] >= least && map[i] <= most) || !is_isolated(map, width, height, x, y)) {
            continue;
        }
        for (int side = 0; side < BST_TRAIL_SIDES; side++) {
            for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
                int64_t at = (int64_t)i + steps[side][0] * (k + 1) +
                             (int64_t)steps[side][1] * (k + 1) * width;
                t->ratios[side][k][t->used] = map[at] / map[i];
            }
        }
        t->charge[t->used++] = (double)map[i];
    }
}

/* Bounds of classes of equal numbers. */
static void set_classes(trail_stack *t) {
    for (int i = 0; i < t->used; i++) {
        t->scratch[i] = t->charge[i];
    }
    qsort(t->scratch, (size_t)t->used, sizeof *t->scratch, bst_compare_doubles);
    for (int c = 0; c <= BST_TRAIL_CLASSES; c++) {
        t->edges[c] =
            c == BST_TRAIL_CLASSES ? INFINITY : t->scratch[c * t->used / BST_TRAIL_CLASSES];
    }
}

bst_charge_trail bst_charge_trail_measure(const float *map, int width, int height, double least,
                                          double most) {
    bst_charge_trail out = {.parallel = {NAN, NAN}, .serial = {NAN, NAN}};
    float *all = malloc(sizeof *all * BST_TRAIL_SIDES * BST_TRAIL_PIXELS * MOST_TRAILS);
    double *numbers = malloc(sizeof *numbers * 2 * MOST_TRAILS);
    trail_stack t = {.charge = numbers};
    if (all && numbers) {
        t.scratch = numbers + MOST_TRAILS;
        for (int i = 0; i < BST_TRAIL_SIDES * BST_TRAIL_PIXELS; i++) {
            t.ratios[i / BST_TRAIL_PIXELS][i % BST_TRAIL_PIXELS] = all + (size_t)i * MOST_TRAILS;
        }
        stack_trails(&t, map, width, height, least, most);
    }
    out.used = t.used;
    if (out.used >= LEAST_TRAILS) {
        set_classes(&t);
        for (int i = 0; i < BST_TRAIL_SIDES * BST_TRAIL_PIXELS; i++) {
            int side = i / BST_TRAIL_PIXELS, k = i % BST_TRAIL_PIXELS;
            out.profile[side][k] = median_of(&t, t.ratios[side][k], ALL);
        }
        for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
            out.class_charge[c] = median_of(&t, NULL, CLASS + c);
        }
        out.parallel = trail_of(&t, 0, out.class_parallel, &out.parallel_up);
        out.serial = trail_of(&t, 2, out.class_serial, &out.serial_right);
    }
    free(all);
    free(numbers);
    return out;
}
