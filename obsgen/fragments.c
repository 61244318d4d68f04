#include "obsgen/fragments.h"

#include <math.h>

#include "obsgen/clutter.h"

/* As image processing tells maxima apart. */
static const double SADDLE_SIGMA = 3.0, SADDLE_SHARE = 0.15;
/* What stays further below the threshold is seen as often as noise alone, which has its own draws.
 */
static const double FAINTEST_SIGMA = 5.0;
/* Draws beyond those of other clutter; 2^15 of each source. */
static const uint64_t FRAGMENT = (uint64_t)1 << 60;

enum { MOST_STEPS = 4096, MOST_PEAKS = 1024, MOST_TAPS = 65 };

typedef struct peak {
    int step;
    double value, saddle; /* saddle: between it and the one before */
} peak;

static double noise_at(const bst_generator *g, const generator_source *s, int row, int k) {
    uint64_t draw = FRAGMENT + (s->name << 15) + ((uint64_t)row << 13) + (uint64_t)k;
    return bst_rng_normal(g->key, (uint64_t)g->exposure_id, draw);
}

/* The filter on white noise along the path. Draws come in pairs, of which two steps take one. */
static void filter_noise(const bst_generator *g, const generator_source *s, const double *tap,
                         int reach, int steps, int row, double *white, double *out) {
    int count = steps + 2 * reach;
    for (int k = 0; k < count; k += 2) {
        uint64_t draw = FRAGMENT + (s->name << 15) + ((uint64_t)row << 13) + (uint64_t)k;
        bst_rng_normal2(g->key, (uint64_t)g->exposure_id, draw, white + k);
    }
    for (int k = 0; k < steps; k++) {
        double sum = 0.0;
        for (int j = 0; j <= 2 * reach; j++) {
            sum += tap[j] * white[k + j];
        }
        out[k] = sum;
    }
}

/* The filter's output at the steps of the path: the greatest of its middle row of pixels and the
 * two beside it, whose noise has the filter's correlation with the middle one's. */
static void outputs(const bst_generator *g, const generator_source *s, const double *tap, int reach,
                    int steps, double (*noise)[MOST_STEPS], double *out) {
    double white[MOST_STEPS + MOST_TAPS + 1];
    for (int row = 0; row < 3; row++) {
        filter_noise(g, s, tap, reach, steps, row, white, noise[row]);
    }
    double beside = bst_matched_falloff(0.0, 1.0, 0.0, g->total_sigma);
    double own = sqrt(1.0 - beside * beside);
    for (int k = 0; k < steps; k++) {
        double at = k - 0.5 * steps, S = g->total_sigma;
        double start = (at + 0.5 * s->length) / (2.0 * S), end = (at - 0.5 * s->length) / (2.0 * S);
        /* away from the ends the error functions are 1 and -1 to rounding */
        double shape = start > 6.0 && end < -6.0 ? 1.0 : 0.5 * (erf(start) - erf(end));
        double signal = s->amplitude * shape;
        double best = signal + noise[0][k];
        for (int row = 1; row < 3; row++) {
            best = fmax(best, beside * (signal + noise[0][k]) + own * noise[row][k]);
        }
        out[k] = best;
    }
}

/* Removes maxima that are no more than noise on the flank of a higher one. */
static int merge(peak *peaks, int count, double threshold) {
    for (;;) {
        int worst = -1;
        double least = INFINITY;
        for (int i = 0; i < count; i++) {
            double left =
                i > 0 && peaks[i - 1].value >= peaks[i].value ? peaks[i].saddle : -INFINITY;
            double right = i + 1 < count && peaks[i + 1].value > peaks[i].value
                               ? peaks[i + 1].saddle
                               : -INFINITY;
            double saddle = fmax(left, right);
            double depth = saddle > threshold ? peaks[i].value - saddle : INFINITY;
            double needed = fmax(SADDLE_SIGMA, SADDLE_SHARE * peaks[i].value);
            if (depth < needed && depth < least) {
                least = depth;
                worst = i;
            }
        }
        if (worst < 0) {
            return count;
        }
        if (worst + 1 < count) {
            peaks[worst + 1].saddle = fmin(peaks[worst].saddle, peaks[worst + 1].saddle);
        }
        for (int i = worst; i + 1 < count; i++) {
            peaks[i] = peaks[i + 1];
        }
        count--;
    }
}

void bst_generator_fragments(bst_generator *g, const generator_source *s) {
    if (s->amplitude < g->threshold - FAINTEST_SIGMA) {
        return;
    }
    double S = g->total_sigma;
    int steps = (int)fmin(ceil(s->length + 4.0 * S), MOST_STEPS);
    int reach = (int)fmin(ceil(3.0 * S), MOST_TAPS / 2);
    double tap[MOST_TAPS], square = 0.0;
    for (int j = -reach; j <= reach; j++) {
        tap[j + reach] = exp(-0.5 * j * j / (S * S));
        square += tap[j + reach] * tap[j + reach];
    }
    for (int j = 0; j <= 2 * reach; j++) {
        tap[j] /= sqrt(square);
    }
    peak peaks[MOST_PEAKS];
    int count = 0;
    double before = -INFINITY, here = -INFINITY, lowest = INFINITY;
    double noise[3][MOST_STEPS], out[MOST_STEPS];
    outputs(g, s, tap, reach, steps, noise, out);
    for (int k = 0; k <= steps; k++) {
        double next = k < steps ? out[k] : -INFINITY;
        if (here >= before && here > next && here > g->threshold && count < MOST_PEAKS) {
            peaks[count++] = (peak){k - 1, here, lowest};
            lowest = INFINITY;
        }
        before = here;
        here = next;
        lowest = fmin(lowest, here);
    }
    count = merge(peaks, count, g->threshold);
    double c = s->path.dx / s->length, n = s->path.dy / s->length;
    for (int i = 0; i < count; i++) {
        double along = peaks[i].step - 0.5 * steps, across;
        bst_generated item = {.item = s->item};
        double x = s->x + along * c, y = s->y + along * n;
        item.detection = bst_generator_point(g, x, y, peaks[i].value, 0.0);
        across = noise_at(g, s, 3, i) * sqrt(item.detection.cov_xx) / g->binning;
        item.detection.x_px -= n * across * g->binning;
        item.detection.y_px += c * across * g->binning;
        if (x > -0.5 && y > -0.5 && x < g->width - 0.5 && y < g->height - 0.5) {
            bst_generator_keep(g, &item);
        }
    }
}
