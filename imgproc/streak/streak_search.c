#include "imgproc/streak/streak_search.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"
#include "sim/core/heapsort.h"

/* Lines of the filter bank down to this margin below the threshold are refined: the loss of the
 * bank's steps, at most 0.65 (tests/imgproc/calibrate_streak_search.c). */
static const double MARGIN_SNR = 0.8;
/* Threshold law fitted to noise, for PSFs of sigma 0.43 to 2.2 px, lengths of 24 to 120 px and 0.05
 * to 60 false alarms per frame of 2048^2. Continuous theory has powers of -3 and 1. Noise gives
 * 0.86 of the false alarms asked for in the mean, 0.27 to 1.33 by case
 * (tests/imgproc/calibrate_streak_search.c). */
static const double RATE = 0.72, SIGMA_POWER = -2.35, LENGTH_PX = 200.0;
/* Undetected points per detected one, for counts proportional to 1 / SNR from SNR 3 to a threshold
 * of 5; and the distance, px, at which two of them look like a short streak. */
static const double FAINTER = 0.7, PAIR_PX = 9.0;
/* Search for bright streaks: above the SNR that a point alone reaches in a sum; a chain of points
 * has gaps. */
enum { BRIGHT_OCTAVE = 1 };
static const double BRIGHT_SNR = 7.5, BRIGHT_FILLED = 0.75, BRIGHT_PX = 11.0;

bst_status bst_streak_search_create(bst_ctx *ctx, bst_parallel *pool, int max_width, int max_height,
                                    double max_px, bst_streak_search *out) {
    *out = (bst_streak_search){.pool = pool, .max_px = max_px};
    bst_status status = bst_streak_map_create(ctx, max_width, max_height, true, &out->map);
    if (status == BST_OK) {
        status = bst_streak_bank_create(ctx, max_width, max_height, max_px,
                                        pool ? bst_parallel_threads(pool) : 1, &out->bank);
    }
    if (status == BST_OK) {
        out->order = calloc((size_t)bst_streak_bank_capacity(&out->bank), sizeof *out->order);
        out->chosen = calloc(BST_STREAK_MAX_CANDIDATES, sizeof *out->chosen);
        out->lines = calloc(BST_STREAK_MAX_CANDIDATES, sizeof *out->lines);
        if (!out->order || !out->chosen || !out->lines) {
            status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the candidates of streaks");
        }
    }
    if (status != BST_OK) {
        bst_streak_search_free(out);
    }
    return status;
}

void bst_streak_search_free(bst_streak_search *s) {
    bst_streak_map_free(&s->map);
    bst_streak_bank_free(&s->bank);
    free(s->order);
    free(s->chosen);
    free(s->lines);
    *s = (bst_streak_search){0};
}

double bst_streak_threshold(double false_alarms, double width_px, double height_px, double sigma_px,
                            double max_px) {
    double sigma = sqrt(sigma_px * sigma_px + 1.0 / 12.0);
    /* part of the fitted law: streaks inside of the frame would lack 2 / pi = 0.64 of their length
     * per axis; those that its edge cuts count in part */
    double inside = fmax(width_px - 0.45 * max_px, 1.0) * fmax(height_px - 0.45 * max_px, 1.0);
    double density = BST_PI / (4.0 * sqrt(12.0 * BST_PI)) * pow(sigma, SIGMA_POWER) * RATE *
                     max_px / (1.0 + max_px / LENGTH_PX);
    double lo = 3.0, hi = 12.0;
    for (int i = 0; i < 40; i++) {
        double u = 0.5 * (lo + hi);
        double rate = density * u * u * u * exp(-0.5 * u * u) / pow(2.0 * BST_PI, 2.5);
        if (rate * inside > false_alarms) {
            lo = u;
        } else {
            hi = u;
        }
    }
    return 0.5 * (lo + hi);
}

/* Sort order of filter-bank hits by SNR. */
static bool stronger_hit(const void *context, int a, int b) {
    const bst_streak_hit *h = context;
    return h[a].snr > h[b].snr || (h[a].snr == h[b].snr && a < b);
}

/* Sort order of lines by SNR. */
static bool stronger_line(const void *context, int a, int b) {
    const bst_streak_line *l = context;
    return l[a].snr > l[b].snr || (l[a].snr == l[b].snr && a < b);
}

/* True if hit b is caused by the same light as the stronger hit a. */
static bool is_same_streak(const bst_streak_hit *a, const bst_streak_hit *b) {
    float ax = a->x1 - a->x0, ay = a->y1 - a->y0, length = sqrtf(ax * ax + ay * ay);
    float mx = 0.5f * (b->x0 + b->x1 - a->x0 - a->x1), my = 0.5f * (b->y0 + b->y1 - a->y0 - a->y1);
    float along = (mx * ax + my * ay) / length, across = (my * ax - mx * ay) / length;
    if (fabsf(across) > 3.0f || fabsf(along) > 0.5f * length + 2.0f) {
        return false;
    }
    float bx = b->x1 - b->x0, by = b->y1 - b->y0, other = sqrtf(bx * bx + by * by);
    float turn = fabsf(ax * by - ay * bx) / (length * other);
    return turn * 0.5f * fminf(length, other) < 3.0f;
}

/* Refines the selected hits to paths (loop body). */
static void refine_all(void *user, int begin, int end) {
    const bst_streak_search *s = user;
    for (int i = begin; i < end; i++) {
        bst_streak_refine(&s->map, &s->chosen[i], s->max_px, &s->lines[i]);
    }
}

/* Selects one hit per group, by falling SNR; returns their number. */
static int select_hits(bst_streak_search *s, int hits) {
    for (int i = 0; i < hits; i++) {
        s->order[i] = i;
    }
    bst_heapsort_indices(s->order, hits, stronger_hit, s->bank.hits);
    int count = 0;
    for (int i = 0; i < hits && count < BST_STREAK_MAX_CANDIDATES; i++) {
        const bst_streak_hit *hit = &s->bank.hits[s->order[i]];
        bool known = false;
        for (int k = 0; k < count && !known; k++) {
            known = is_same_streak(&s->chosen[k], hit);
        }
        if (!known) {
            assert(count < BST_STREAK_MAX_CANDIDATES);
            s->chosen[count++] = *hit;
        }
    }
    return count;
}

void bst_streak_search_fill(bst_streak_search *s, const float *signal, int width, int height,
                            const bst_background *background, double sigma_px) {
    assert(s && signal && background && width > 0 && height > 0 && sigma_px > 0.0);
    const bst_streak_map_input input = {signal, width, height, background, sigma_px};
    bst_streak_map_fill(&s->map, s->pool, &input);
}

/* Searches streaks above `threshold` with at least the given filling and length; result in
 * s->found.
 *
 * Given:     more  excess of the squared SNR of a line over that of its two brightest points */
static int search_streaks(bst_streak_search *s, int first_octave, double margin, double threshold,
                          double filled, double least_px, double more) {
    s->threshold_snr = threshold;
    int hits = bst_streak_bank_run(&s->bank, s->pool, &s->map, first_octave, threshold - margin);
    s->candidates = select_hits(s, hits);
    bst_parallel_for(s->pool, s->candidates, 4, refine_all, s);
    int kept = 0;
    for (int i = 0; i < s->candidates; i++) {
        if (s->lines[i].snr > threshold) {
            s->order[kept++] = i;
        }
    }
    bst_heapsort_indices(s->order, kept, stronger_line, s->lines);
    int found = 0;
    for (int i = 0; i < kept && found < BST_STREAK_MAX_FOUND; i++) {
        bst_streak_line *line = &s->lines[s->order[i]];
        if (found > 0) {
            /* refine again without the light of streaks already found */
            bst_streak_refine(&s->map, &s->chosen[s->order[i]], s->max_px, line);
        }
        double of_points = hypot(line->point_snr[0], line->point_snr[1]);
        if (!(line->snr > threshold) || !(line->snr * line->snr > of_points * of_points + more) ||
            line->filled < filled || hypot(line->x1 - line->x0, line->y1 - line->y0) < least_px) {
            continue;
        }
        s->found[found++] = *line;
        double wide = 3.5 * hypot(s->map.sigma_px, s->map.sigma_px);
        bst_streak_map_blank(&s->map, line->x0, line->y0, line->x1, line->y1, wide);
    }
    return found;
}

int bst_streak_search_bright(bst_streak_search *s) {
    return search_streaks(s, BRIGHT_OCTAVE, 0.0, BRIGHT_SNR, BRIGHT_FILLED, BRIGHT_PX, 0.0);
}

int bst_streak_search_faint(bst_streak_search *s, double false_alarms, int points) {
    double faint = FAINTER * points, pixels = (double)s->map.width * (double)s->map.height;
    double pairs = faint * faint * BST_PI * PAIR_PX * PAIR_PX / (2.0 * pixels);
    double threshold =
        bst_streak_threshold(false_alarms, s->map.width, s->map.height, s->map.sigma_px, s->max_px);
    return search_streaks(s, 0, MARGIN_SNR, threshold, 0.0, 0.0, 2.0 * log1p(pairs / false_alarms));
}
