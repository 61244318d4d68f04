#include "sim/analysis/characterize/readout_time.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

enum { PARTS = 8 };
static const double CLIP = 5.0;

/* Sums of squares and products about the means, and their number. */
typedef struct sums {
    double n, x, y, xx, xy, yy;
} sums;

/* One column in the order of reading. */
typedef struct column {
    const float *bias, *dark; /* of the pixel that is read first */
    ptrdiff_t step;           /* from a pixel to that read after it */
    int height;
} column;

static bool has_values(const column *c) {
    for (int y = 0; y < c->height; y++) {
        if (!isfinite(c->dark[y * c->step]) || !isfinite(c->bias[y * c->step])) {
            return false;
        }
    }
    return true;
}

/* Sums of the pixels whose residual from a line of this slope through the column's mean is below a
 * limit. */
static sums sums_of(const column *c, double slope, double limit) {
    double mean = 0.0, passed = 0.0;
    for (int y = 0; y < c->height; y++) {
        mean += (c->bias[y * c->step] - slope * passed) / c->height;
        passed += c->dark[y * c->step];
    }
    sums s = {.n = 0.0};
    passed = 0.0;
    for (int y = 0; y < c->height; y++) {
        double v = c->bias[y * c->step] - mean, x = passed;
        passed += c->dark[y * c->step];
        if (fabs(v - slope * x) < limit) {
            s.n++;
            s.x += x;
            s.y += v;
            s.xx += x * x;
            s.xy += x * v;
            s.yy += v * v;
        }
    }
    if (s.n > 0.0) {
        s.xx -= s.x * s.x / s.n;
        s.xy -= s.x * s.y / s.n;
        s.yy -= s.y * s.y / s.n;
    }
    return s;
}

bst_sensor_estimate bst_readout_time(const bst_readout_frames *f) {
    assert(f && f->bias && f->dark && f->width > 0 && f->height > 1 && f->exposure_s > 0.0);
    const int width = f->width, height = f->height;
    /* with its own mean, a column's noise n and its walk -n_1, -n_1 - n_2, ... have these sums */
    const double noise_xy = 0.5 * f->bias_variance * (height - 1);
    const double noise_xx = f->dark_variance * ((double)height * height - 1.0) / 6.0;
    double slope = 0.0, limit = INFINITY, sigma = NAN, squares = 0.0;
    int known = 0;
    for (int turn = 0; turn < 4; turn++) {
        double xx[PARTS] = {0.0}, xy[PARTS] = {0.0}, yy = 0.0, n = 0.0, all_xx = 0.0, all_xy = 0.0;
        known = 0;
        for (int x = 0; x < width; x++) {
            size_t first = (size_t)x + (f->last_first ? (size_t)(height - 1) * (size_t)width : 0);
            column c = {f->bias + first, f->dark + first, f->last_first ? -width : width, height};
            if (has_values(&c)) {
                sums s = sums_of(&c, slope, limit);
                int part = (int)((int64_t)x * PARTS / width);
                xx[part] += s.xx - noise_xx;
                xy[part] += s.xy - noise_xy;
                yy += s.yy;
                n += fmax(s.n - 1.0, 0.0);
                known++;
            }
        }
        for (int k = 0; k < PARTS; k++) {
            all_xx += xx[k];
            all_xy += xy[k];
        }
        double rest = 0.0;
        squares = all_xx;
        slope = all_xy / all_xx;
        for (int k = 0; k < PARTS; k++) {
            double d = (all_xy - xy[k]) / (all_xx - xx[k]) - slope;
            rest += d * d * (PARTS - 1.0) / PARTS;
        }
        sigma = sqrt(rest);
        limit = CLIP * sqrt(fmax(yy - slope * all_xy, 0.0) / n);
    }
    double scale = height * f->exposure_s;
    return known >= BST_READOUT_TIME_COLUMNS && squares > 0.0
               ? (bst_sensor_estimate){slope * scale, sigma * scale}
               : (bst_sensor_estimate){NAN, NAN};
}
