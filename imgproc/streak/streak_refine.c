#include "imgproc/streak/streak_refine.h"

#include <math.h>
#include <string.h>

enum { MOST = BST_STREAK_MAX_ROWS + 96, MOST_LAGS = 2 * 24 };

/* Limit, sigma, by which a sample may exceed the path's mean. */
static const double CLIP_SIGMA = 2.5;
/* Share of the path's mean above which a row counts as lit, design choice: between sky, 0, and the
 * path, 1, nearer to the sky because a streak of SNR 7 over 60 rows has 0.9 sigma in a row. */
static const double LIT_SHARE = 0.35;

/* Straight path in a plane of the streak map: column s0 at row t0, s1 at row t1 (row centres). */
typedef struct path {
    double s0, s1;
    int t0, t1; /* rows of s0 and s1 */
    int e0, e1; /* range of summed rows */
    double snr;
} path;

typedef struct profile {
    int first, count;        /* rows */
    float value[MOST];       /* sigma */
    double before[MOST + 1]; /* cumulative sum of the values before each row */
    float scale[MOST + 1];   /* 1 / standard deviation of a sum of n rows */
} profile;

/* Samples the streak map along a path on rows first to first + count - 1. */
static void sample_path(const bst_streak_map *map, int plane, const path *p, int first, int count,
                        int most_rows, profile *out) {
    const int16_t *pixels = bst_streak_map_plane(map, plane);
    long stride = map->stride[plane];
    double slope = p->t1 > p->t0 ? (p->s1 - p->s0) / (p->t1 - p->t0) : 0.0;
    double lowest = 1.0 - BST_STREAK_PAD, highest = (double)(stride - BST_STREAK_PAD) - 3.0;
    int base[MOST];
    float fraction[MOST];
    out->first = first;
    out->count = count;
    out->before[0] = 0.0;
    for (int i = 0; i < count; i++) {
        double s = p->s0 + slope * (first + i - p->t0);
        s = s < lowest ? lowest : s > highest ? highest : s;
        double whole = floor(s);
        base[i] = (int)whole;
        fraction[i] = (float)(s - whole);
        const int16_t *at = pixels + (long)(first + i) * stride + base[i];
        out->value[i] = ((1.0f - fraction[i]) * (float)at[0] + fraction[i] * (float)at[1]) *
                        (1.0f / BST_STREAK_QUANTA);
        out->before[i + 1] = out->before[i] + (double)out->value[i];
    }
    /* mean covariance of rows by lag */
    float r[MOST_LAGS + 2];
    int lags = 2 * map->radius < count - 1 ? 2 * map->radius : count - 1;
    lags = lags < MOST_LAGS - 1 ? lags : MOST_LAGS - 1;
    for (int k = 0; k < MOST_LAGS + 2; k++) {
        r[k] = (float)map->correlation[k];
    }
    double mean[MOST_LAGS];
    for (int k = 0; k <= lags; k++) {
        float sum = 0.0f;
        for (int i = 0; i + k < count; i++) {
            int d = base[i + k] - base[i];
            float f = fraction[i], g = fraction[i + k];
            int up = d + 1 < 0 ? -d - 1 : d + 1, down = d - 1 < 0 ? 1 - d : d - 1;
            d = d < 0 ? -d : d;
            if (d > MOST_LAGS) {
                continue;
            }
            sum += r[d] * ((1.0f - f) * (1.0f - g) + f * g) + r[up] * (1.0f - f) * g +
                   r[down] * f * (1.0f - g);
        }
        mean[k] = (double)sum / (count - k) * map->correlation[k];
    }
    /* V(n) - V(n - 1) = c_0 + 2 (c_1 + ... + c_(n-1)) */
    double variance = 0.0, step = mean[0];
    out->scale[0] = 0.0f;
    for (int n = 1; n <= count && n <= most_rows; n++) {
        variance += step;
        step += n <= lags ? 2.0 * mean[n] : 0.0;
        out->scale[n] = (float)(1.0 / sqrt(variance > 0.1 ? variance : 0.1));
    }
}

/* Best end rows of a path within `reach` rows of its current ends. */
static void best_ends(const profile *p, int reach, int most_rows, path *at) {
    int e0 = at->e0, e1 = at->e1;
    at->snr = -1.0;
    for (int a = e0 - reach; a <= e0 + reach; a++) {
        for (int b = e1 - reach; b <= e1 + reach; b++) {
            int n = b - a + 1, i = a - p->first;
            if (i < 0 || i + n > p->count || n < BST_STREAK_LEAST_ROWS - 1 || n > most_rows) {
                continue;
            }
            double snr = (p->before[i + n] - p->before[i]) * (double)p->scale[n];
            if (snr > at->snr) {
                at->snr = snr;
                at->e0 = a;
                at->e1 = b;
            }
        }
    }
}

/* Plane of the streak map and longest path. */
typedef struct search_plane {
    const bst_streak_map *map;
    int plane, rows;
    double max_px;
} search_plane;

/* Step sizes of the refinement: ends across by up to `steps` steps, along by `reach` rows. */
typedef struct moves {
    double step;
    int steps, reach;
} moves;

/* One refinement round over all moves; returns true if the SNR improved. */
static bool improve_path(const search_plane *in, const moves *by, profile *work, path *best) {
    const path start = *best;
    const int steps = by->steps, reach = by->reach;
    int first = start.e0 - reach > 0 ? start.e0 - reach : 0;
    int last = start.e1 + reach < in->rows - 1 ? start.e1 + reach : in->rows - 1;
    double slant = start.t1 > start.t0 ? (start.s1 - start.s0) / (start.t1 - start.t0) : 0.0;
    int most = (int)ceil(in->max_px / sqrt(1.0 + slant * slant));
    most = most < BST_STREAK_MAX_ROWS ? most : BST_STREAK_MAX_ROWS;
    if (last - first + 1 > MOST || last < first) {
        return false;
    }
    bool better = false;
    for (int i = -steps; i <= steps; i++) {
        for (int j = -steps; j <= steps; j++) {
            path trial = start;
            trial.s0 += i * by->step;
            trial.s1 += j * by->step;
            sample_path(in->map, in->plane, &trial, first, last - first + 1, most, work);
            best_ends(work, reach, most, &trial);
            if (trial.snr > best->snr + 1e-9) {
                *best = trial;
                better = true;
            }
        }
    }
    /* the ends are those of the summed rows */
    double slope = best->t1 > best->t0 ? (best->s1 - best->s0) / (best->t1 - best->t0) : 0.0;
    double s0 = best->s0 + slope * (best->e0 - best->t0);
    best->s1 = best->s0 + slope * (best->e1 - best->t0);
    best->s0 = s0;
    best->t0 = best->e0;
    best->t1 = best->e1;
    return better;
}

/* SNR of the two brightest separate points on the path. */
static void two_points(const bst_streak_map *map, int plane, const path *p, double out[2]) {
    const int16_t *pixels = bst_streak_map_plane(map, plane);
    double slope = p->t1 > p->t0 ? (p->s1 - p->s0) / (p->t1 - p->t0) : 0.0;
    int row_best[MOST] = {0}, count = p->e1 - p->e0 + 1, first = 0;
    for (int i = 0; i < count; i++) {
        const int16_t *row = pixels + (long)(p->e0 + i) * map->stride[plane];
        int s = (int)floor(p->s0 + slope * (p->e0 + i - p->t0) + 0.5);
        row_best[i] = 0;
        for (int x = s - 1; x <= s + 1; x++) {
            row_best[i] = row[x] > row_best[i] ? row[x] : row_best[i];
        }
        first = row_best[i] > row_best[first] ? i : first;
    }
    double apart = 3.5 * map->sigma_px / sqrt(1.0 + slope * slope);
    int second = 0;
    for (int i = 0; i < count; i++) {
        if (fabs((double)(i - first)) >= apart && row_best[i] > second) {
            second = row_best[i];
        }
    }
    out[0] = (double)row_best[first] / BST_STREAK_QUANTA;
    out[1] = (double)second / BST_STREAK_QUANTA;
}

/* SNR of a path with outliers limited, and the uniformity of its brightness. */
static void measure_path(const bst_streak_map *map, int plane, const path *p, profile *work,
                         bst_streak_line *out) {
    int n = p->e1 - p->e0 + 1;
    sample_path(map, plane, p, p->e0, n, BST_STREAK_MAX_ROWS, work);
    double top = work->before[n] / n + CLIP_SIGMA, sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += fmin((double)work->value[i], top);
    }
    out->snr = sum * (double)work->scale[n];
    two_points(map, plane, p, out->point_snr);
    int lit = 0;
    for (int i = 0; i < n; i++) {
        lit += (double)work->value[i] > LIT_SHARE * sum / n;
    }
    out->filled = (double)lit / n;
}

void bst_streak_refine(const bst_streak_map *map, const bst_streak_hit *hit, double max_px,
                       bst_streak_line *out) {
    int plane = hit->plane, rows = plane ? map->width : map->height;
    double top = plane ? (double)hit->x0 : (double)hit->y0;
    double s0 = plane ? (double)hit->y0 : (double)hit->x0;
    double s1 = plane ? (double)hit->y1 : (double)hit->x1;
    double half = 0.5 * (s1 - s0) / hit->rows;
    path best = {.s0 = s0 + half, .s1 = s1 - half, .snr = -1.0};
    best.t0 = best.e0 = (int)floor(top + 1.0);
    best.t1 = best.e1 = best.e0 + hit->rows - 1;
    profile work;
    int reach = hit->rows / 4 > 2 ? hit->rows / 4 : 2;
    const search_plane in = {map, plane, rows, max_px};
    const moves coarse = {0.5, 2, reach}, fine = {0.25, 1, 2};
    improve_path(&in, &coarse, &work, &best);
    for (int round = 0; round < 3 && improve_path(&in, &fine, &work, &best); round++) {
    }
    *out = (bst_streak_line){0};
    if (best.snr > 0.0) {
        measure_path(map, plane, &best, &work, out);
    }
    double slope = best.t1 > best.t0 ? (best.s1 - best.s0) / (best.t1 - best.t0) : 0.0;
    double u0 = best.s0 - 0.5 * slope, u1 = best.s1 + 0.5 * slope;
    double v0 = best.e0 - 0.5, v1 = best.e1 + 0.5;
    out->x0 = plane ? v0 : u0;
    out->y0 = plane ? u0 : v0;
    out->x1 = plane ? v1 : u1;
    out->y1 = plane ? u1 : v1;
}
