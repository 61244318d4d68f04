#include "obsgen/streak/streak_centroid_error.h"

#include <math.h>

#include "obsgen/model/matched_filter_theory.h"

enum {
    ROWS = BST_WANDER_ROWS,
    STEPS = BST_WANDER_STEPS,
    TAPS = BST_WANDER_TAPS,
    BLOCKS = STEPS / BST_RNG_BLOCK,
    TRIES = 8
};
/* Search range beyond the streak's ends, sigmas. */
static const double BEYOND = 2.0;
/* Spacing of the rows, sigmas. */
static const double APART = 0.7;

/* Mixing matrix from white rows to correlated output rows (Cholesky). */
static void set_mix(bst_streak_centroid_error *w) {
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k <= i; k++) {
            double sum = exp(-0.25 * APART * APART * (i - k) * (i - k));
            for (int m = 0; m < k; m++) {
                sum -= w->mix[i][m] * w->mix[k][m];
            }
            w->mix[i][k] = i == k ? sqrt(sum) : sum / w->mix[k][k];
        }
    }
}

void bst_streak_centroid_error_set(bst_streak_centroid_error *w, double length_px,
                                   double sigma_px) {
    if (w->length == length_px && w->sigma == sigma_px) {
        return;
    }
    *w = (bst_streak_centroid_error){.length = length_px, .sigma = sigma_px};
    w->half = (int)fmax(1.0, floor(length_px / sigma_px + 0.5));
    w->step = 0.5 * length_px / w->half;
    w->reach = (int)fmin(ceil(3.0 * sigma_px / w->step), TAPS);
    w->side = (int)ceil((0.5 * length_px + BEYOND * sigma_px) / w->step);
    int steps = 2 * (w->side + w->half + w->reach) + 1;
    if (steps > STEPS) {
        return;
    }
    w->steps = steps;
    double square = 0.0;
    for (int i = -w->reach; i <= w->reach; i++) {
        double at = i * w->step / sigma_px;
        w->taps[i + w->reach] = exp(-0.5 * at * at);
        square += exp(-at * at);
    }
    w->point_norm = 1.0 / sqrt(square);
    square = 0.0;
    for (int at = -w->half - w->reach; at <= w->half + w->reach; at++) {
        double value = 0.0;
        for (int i = -w->reach; i <= w->reach; i++) {
            int from = at - i, off = from < 0 ? -from : from;
            double share = off < w->half ? 1.0 : off == w->half ? 0.5 : 0.0;
            value += share * w->taps[i + w->reach];
        }
        square += value * value;
    }
    w->streak_norm = 1.0 / sqrt(square);
    w->shared = bst_matched_efficiency((bst_obsgen_path_px){length_px, 0.0},
                                       (bst_obsgen_path_px){0.0, 0.0}, sigma_px);
    double d = 0.1 * sigma_px;
    w->curvature = 2.0 * (1.0 - bst_matched_falloff(d, 0.0, length_px, sigma_px)) / (d * d);
    set_mix(w);
}

/* Filter outputs along the rows, from -side to side. */
typedef struct rows {
    double streak[ROWS][STEPS], point[ROWS][STEPS];
} rows;

/* Adds the light of the sources to the outputs. */
static void add_light(const bst_streak_centroid_error *w,
                      const bst_streak_centroid_error_source *sources, int count, rows *out) {
    double s = w->sigma * sqrt(2.0), half = 0.5 * w->length;
    double top = 2.0 * bst_matched_normal_below(half / s) - 1.0;
    for (int k = 0; k < count; k++) {
        double across[ROWS];
        for (int r = 0; r < ROWS; r++) {
            double v = ((r - ROWS / 2) * APART * w->sigma - sources[k].across_px) / s;
            across[r] = sources[k].snr * exp(-0.5 * v * v);
        }
        for (int i = 0; i <= 2 * w->side; i++) {
            double u = (i - w->side) * w->step - sources[k].along_px;
            double streak = bst_matched_falloff(u, 0.0, w->length, w->sigma);
            double point = w->shared *
                           (bst_matched_normal_below((u + half) / s) -
                            bst_matched_normal_below((u - half) / s)) /
                           top;
            for (int r = 0; r < ROWS; r++) {
                out->streak[r][i] += across[r] * streak;
                out->point[r][i] += across[r] * point;
            }
        }
    }
}

/* Adds noise to both filters' outputs, from the same white noise. */
static void add_noise(const bst_streak_centroid_error *w, bst_rng_key key, int attempt,
                      double noise, rows *out) {
    double white[ROWS][STEPS], smooth[STEPS];
    int blocks = (w->steps + 2 * BST_RNG_BLOCK - 1) / (2 * BST_RNG_BLOCK);
    for (int r = 0; r < ROWS; r++) {
        for (int b = 0; b < blocks; b++) {
            double drawn[2][BST_RNG_BLOCK];
            uint64_t first = (uint64_t)((attempt * ROWS + r) * BLOCKS + b) * BST_RNG_BLOCK;
            bst_rng_normal_block(key, first, drawn);
            for (int i = 0; i < 2 * BST_RNG_BLOCK; i++) {
                int at = 2 * BST_RNG_BLOCK * b + i;
                if (at < w->steps) {
                    white[r][at] = noise * drawn[i / BST_RNG_BLOCK][i % BST_RNG_BLOCK];
                }
            }
        }
    }
    int smoothed = w->steps - 2 * w->reach;
    for (int r = ROWS - 1; r >= 0; r--) {
        for (int i = 0; i < w->steps; i++) { /* rows below are still white */
            double sum = 0.0;
            for (int m = 0; m <= r; m++) {
                sum += w->mix[r][m] * white[m][i];
            }
            white[r][i] = sum;
        }
        for (int i = 0; i < smoothed; i++) {
            double sum = 0.0;
            for (int t = 0; t <= 2 * w->reach; t++) {
                sum += w->taps[t] * white[r][i + t];
            }
            smooth[i] = sum;
        }
        double box = -0.5 * smooth[0];
        for (int i = 0; i < 2 * w->half; i++) {
            box += smooth[i];
        }
        for (int i = 0; i <= 2 * w->side; i++) { /* ends count half */
            int end = i + 2 * w->half;
            double sum = box + 0.5 * smooth[end];
            out->streak[r][i] += w->streak_norm * sum;
            out->point[r][i] += w->point_norm * smooth[i + w->half];
            box += 0.5 * (smooth[end] - smooth[i]) + 0.5 * (smooth[end] - smooth[i + 1]);
        }
    }
}

/* Vertex of the parabola through three outputs, in steps from the middle. */
static double vertex(double before, double at, double after) {
    double bend = 2.0 * at - before - after;
    return bend > 1e-9 ? fmin(fmax(0.5 * (after - before) / bend, -0.5), 0.5) : 0.0;
}

/* Highest interpolated output of both filters. */
static bst_streak_centroid_error_peak find_peak(const bst_streak_centroid_error *w,
                                                const rows *out) {
    bst_streak_centroid_error_peak top = {.snr = -INFINITY};
    int row = 0, column = 0;
    for (int r = 0; r < ROWS; r++) {
        for (int i = 0; i <= 2 * w->side; i++) {
            bool point = out->point[r][i] > out->streak[r][i];
            double value = point ? out->point[r][i] : out->streak[r][i];
            if (value > top.snr) {
                top.snr = value;
                top.point = point;
                row = r;
                column = i;
            }
        }
    }
    const double(*o)[STEPS] = top.point ? out->point : out->streak;
    double along = 0.0, across = 0.0;
    if (column > 0 && column < 2 * w->side) {
        along = vertex(o[row][column - 1], o[row][column], o[row][column + 1]);
    }
    if (row > 0 && row < ROWS - 1 && o[row - 1][column] > 0.0 && o[row + 1][column] > 0.0) {
        across = vertex(log(o[row - 1][column]), log(o[row][column]), log(o[row + 1][column]));
    }
    top.along_px = (column - w->side + along) * w->step;
    top.across_px = (row - ROWS / 2 + across) * APART * w->sigma;
    return top;
}

bst_streak_centroid_error_peak bst_streak_centroid_error_draw(
    const bst_streak_centroid_error *w, bst_rng_key key,
    const bst_streak_centroid_error_source *sources, int count, double noise, double threshold) {
    rows light, out;
    for (int r = 0; r < ROWS; r++) {
        for (int i = 0; i <= 2 * w->side; i++) {
            light.streak[r][i] = light.point[r][i] = 0.0;
        }
    }
    add_light(w, sources, count, &light);
    bst_streak_centroid_error_peak best = {.snr = -INFINITY};
    for (int attempt = 0; attempt < TRIES && !(best.snr > threshold); attempt++) {
        for (int r = 0; r < ROWS; r++) {
            for (int i = 0; i <= 2 * w->side; i++) {
                out.streak[r][i] = light.streak[r][i];
                out.point[r][i] = light.point[r][i];
            }
        }
        add_noise(w, key, attempt, noise, &out);
        bst_streak_centroid_error_peak top = find_peak(w, &out);
        best = top.snr > best.snr ? top : best;
    }
    return best;
}
