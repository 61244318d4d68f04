#include "gimbal/jitter/jitter.h"

#include <math.h>

#include "boresight/vec.h"
#include "gimbal/jitter/jitter_more.h"
#include "sim/core/simd.h"

/* Rotation steps between evaluations of the exact phase: rounding errors grow to about 1e-14. */
#define RESYNC_STEPS 256

/* A flat band and its lines in a bst_jitter_axis. */
typedef struct flat_band {
    int first, lines;
    double rms_axis_rad, min_hz, max_hz;
} flat_band;

static void draw_band(bst_jitter_axis *axis, const flat_band *b, double dt_s, bst_rng_key key,
                      int axis_number) {
    double amplitude = b->rms_axis_rad * sqrt(2.0 / b->lines);
    for (int i = 0; i < b->lines; i++) {
        int line = b->first + i;
        uint64_t draw = (uint64_t)(2 * line);
        double u = bst_rng_uniform(key, (uint64_t)axis_number, draw);
        double f = b->min_hz + (b->max_hz - b->min_hz) * (i + u) / b->lines;
        axis->amplitude[line] = amplitude;
        axis->frequency_hz[line] = f;
        axis->phase_cycles[line] = bst_rng_uniform(key, (uint64_t)axis_number, draw + 1);
        axis->turn_re[line] = cos(2.0 * BST_PI * f * dt_s);
        axis->turn_im[line] = sin(2.0 * BST_PI * f * dt_s);
    }
}

static bool has_band(double rms_rad, double min_hz, double max_hz) {
    return rms_rad > 0.0 && max_hz > min_hz;
}

static void cut_band(double *rms_rad, double min_hz, double *max_hz, double top_hz) {
    if (has_band(*rms_rad, min_hz, *max_hz) && *max_hz > top_hz) {
        double cut = fmax(top_hz, min_hz);
        *rms_rad *= sqrt((cut - min_hz) / (*max_hz - min_hz));
        *max_hz = cut;
    }
}

bst_jitter_spec bst_jitter_resolved(const bst_jitter_spec *spec, double dt_s) {
    bst_jitter_spec out = *spec;
    double top_hz = BST_JITTER_RESOLVED / dt_s;
    cut_band(&out.low_rms_rad, 0.0, &out.low_cutoff_hz, top_hz);
    cut_band(&out.high_rms_rad, out.high_min_hz, &out.high_max_hz, top_hz);
    return out;
}

/* Share of a flat band's variance missing from linear interpolation at steps dt: (1 - cos(2 pi f
 * dt)) / 3 on average up to the highest resolved frequency, all beyond. */
static double unresolved_share(double min_hz, double max_hz, double dt_s) {
    double top_hz = fmin(fmax(BST_JITTER_RESOLVED / dt_s, min_hz), max_hz);
    double w = 2.0 * BST_PI * dt_s, width = top_hz - min_hz, mean = 0.5 * (top_hz + min_hz);
    /* mean of the cosine: cos(w mean) sin(w width / 2) / (w width / 2) */
    double half = 0.5 * w * width, sinc = half > 1e-4 ? sin(half) / half : 1.0 - half * half / 6.0;
    return (width * (1.0 - cos(w * mean) * sinc) / 3.0 + max_hz - top_hz) / (max_hz - min_hz);
}

double bst_jitter_unresolved_rad2(const bst_jitter_spec *s, double dt_s) {
    double sum = 0.0;
    if (has_band(s->low_rms_rad, 0.0, s->low_cutoff_hz)) {
        sum += s->low_rms_rad * s->low_rms_rad * unresolved_share(0.0, s->low_cutoff_hz, dt_s);
    }
    if (has_band(s->high_rms_rad, s->high_min_hz, s->high_max_hz)) {
        sum += s->high_rms_rad * s->high_rms_rad *
               unresolved_share(s->high_min_hz, s->high_max_hz, dt_s);
    }
    return 0.5 * sum;
}

void bst_jitter_init(bst_jitter *jitter, const bst_jitter_spec *spec, double dt_s,
                     bst_rng_key key) {
    *jitter = (bst_jitter){.dt_s = dt_s, .index = -1};
    jitter->silent = spec->low_rms_rad == 0.0 && spec->high_rms_rad == 0.0;
    const flat_band low = {0, BST_JITTER_LOW_LINES, spec->low_rms_rad * sqrt(0.5), 0.0,
                           spec->low_cutoff_hz};
    const flat_band high = {BST_JITTER_LOW_LINES, BST_JITTER_HIGH_LINES,
                            spec->high_rms_rad * sqrt(0.5), spec->high_min_hz, spec->high_max_hz};
    for (int a = 0; a < 2; a++) {
        draw_band(&jitter->axis[a], &low, dt_s, key, a);
        draw_band(&jitter->axis[a], &high, dt_s, key, a);
    }
}

static void synchronise(bst_jitter *jitter, int64_t n) {
    double t = (double)n * jitter->dt_s;
    for (int a = 0; a < 2; a++) {
        bst_jitter_axis *axis = &jitter->axis[a];
        for (int i = 0; i < BST_JITTER_LINES; i++) {
            double cycles = axis->frequency_hz[i] * t;
            double phase = 2.0 * BST_PI * (cycles - floor(cycles) + axis->phase_cycles[i]);
            axis->re[i] = axis->amplitude[i] * cos(phase);
            axis->im[i] = axis->amplitude[i] * sin(phase);
        }
    }
}

BST_CLONES static void rotate(bst_jitter_axis *axis) {
    for (int i = 0; i < BST_JITTER_LINES; i++) {
        double re = axis->re[i] * axis->turn_re[i] - axis->im[i] * axis->turn_im[i];
        axis->im[i] = axis->re[i] * axis->turn_im[i] + axis->im[i] * axis->turn_re[i];
        axis->re[i] = re;
    }
}

/* Eight partial sums: a single chain of additions would cost more than the rotation. */
BST_CLONES static double sum(const bst_jitter_axis *axis) {
    double s[8] = {0.0};
    for (int i = 0; i < BST_JITTER_LINES; i += 8) {
        for (int j = 0; j < 8; j++) {
            s[j] += axis->re[i + j];
        }
    }
    return ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
}

static void flat_at(bst_jitter *jitter, int64_t n, double out_rad[2]) {
    int64_t block = n - n % RESYNC_STEPS;
    if (jitter->index < block || jitter->index > n) {
        synchronise(jitter, block);
        jitter->index = block;
    }
    while (jitter->index < n) {
        rotate(&jitter->axis[0]);
        rotate(&jitter->axis[1]);
        jitter->index++;
    }
    out_rad[0] = sum(&jitter->axis[0]);
    out_rad[1] = sum(&jitter->axis[1]);
}

void bst_jitter_at(bst_jitter *jitter, int64_t n, double out_rad[2]) {
    if (jitter->silent) {
        out_rad[0] = out_rad[1] = 0.0;
    } else {
        flat_at(jitter, n, out_rad);
    }
    if (jitter->more) {
        bst_jitter_more_at(jitter->more, n, jitter->dt_s, out_rad);
    }
}
