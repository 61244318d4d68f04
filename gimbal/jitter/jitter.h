/* Line-of-sight jitter of flat bands: a sum of sinusoids with random frequencies and phases. */
#ifndef BST_GIMBAL_JITTER_JITTER_H
#define BST_GIMBAL_JITTER_JITTER_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/rng.h"

#define BST_JITTER_LOW_LINES 16
#define BST_JITTER_HIGH_LINES 32
#define BST_JITTER_LINES (BST_JITTER_LOW_LINES + BST_JITTER_HIGH_LINES)

/* Jitter bands. RMS values are radial, sqrt(<x^2 + y^2>); each axis has the value over sqrt(2). */
typedef struct bst_jitter_spec {
    double low_rms_rad, low_cutoff_hz;             /* flat from 0 to the cut-off */
    double high_rms_rad, high_min_hz, high_max_hz; /* flat within the band */
} bst_jitter_spec;

/* Lines of one axis as rotating phasors. */
typedef struct bst_jitter_axis {
    double re[BST_JITTER_LINES], im[BST_JITTER_LINES];           /* amplitude * exp(i phase) */
    double turn_re[BST_JITTER_LINES], turn_im[BST_JITTER_LINES]; /* exp(i 2 pi f dt) */
    double amplitude[BST_JITTER_LINES], frequency_hz[BST_JITTER_LINES];
    double phase_cycles[BST_JITTER_LINES];
} bst_jitter_axis;

typedef struct bst_jitter {
    double dt_s;
    int64_t index; /* step of the phasors; -1: none */
    bool silent;   /* no flat bands */
    bst_jitter_axis axis[2];
    struct bst_jitter_more *more; /* owned: tables and lines (bst_jitter_add); NULL: none */
} bst_jitter;

/* Highest jitter frequency that steps of dt_s resolve, in units of 1 / dt_s. */
#define BST_JITTER_RESOLVED 0.4

/* Resolved part of a jitter: the bands up to BST_JITTER_RESOLVED / dt_s, with their share of the
 * variance. */
bst_jitter_spec bst_jitter_resolved(const bst_jitter_spec *spec, double dt_s);

/* Variance, rad^2 per axis, that linear interpolation between samples dt_s apart of
 * bst_jitter_resolved lacks: a sinusoid of frequency f keeps (2 + cos(2 pi f dt_s)) / 3 of its
 * variance on average. */
double bst_jitter_unresolved_rad2(const bst_jitter_spec *spec, double dt_s);

/* Draws the lines of a jitter. Each band is divided into equal slots with one line of equal
 * amplitude at a uniform position in each. The spectrum is flat at the slots' resolution, and the
 * RMS is exact over long times (a line of amplitude a has the mean square a^2 / 2).
 *
 * Given:     dt_s  step of bst_jitter_at */
void bst_jitter_init(bst_jitter *jitter, const bst_jitter_spec *spec, double dt_s, bst_rng_key key);

/* Jitter at time n * dt_s: rotation of the camera about its x and y axes, rad. It depends only on
 * n, bit for bit; ascending n is fast. */
void bst_jitter_at(bst_jitter *jitter, int64_t n, double out_rad[2]);

/* Frees the memory of bst_jitter_add; a zeroed jitter is allowed. */
void bst_jitter_free(bst_jitter *jitter);

#endif
