/* Line-of-sight jitter: a sum of sinusoids with random frequencies and phases. */
#ifndef BST_GIMBAL_JITTER_JITTER_H
#define BST_GIMBAL_JITTER_JITTER_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/rng.h"

#define BST_JITTER_LOW_LINES 16
#define BST_JITTER_HIGH_LINES 32
#define BST_JITTER_LINES (BST_JITTER_LOW_LINES + BST_JITTER_HIGH_LINES)

/* RMS values are radial, sqrt(<x^2 + y^2>): each axis has the value over sqrt(2). */
typedef struct bst_jitter_spec {
    double low_rms_rad, low_cutoff_hz;             /* flat from 0 to the cut-off */
    double high_rms_rad, high_min_hz, high_max_hz; /* flat within the band */
} bst_jitter_spec;

/* One axis: the lines as rotating phasors. */
typedef struct bst_jitter_axis {
    double re[BST_JITTER_LINES], im[BST_JITTER_LINES];           /* amplitude * exp(i phase) */
    double turn_re[BST_JITTER_LINES], turn_im[BST_JITTER_LINES]; /* exp(i 2 pi f dt) */
    double amplitude[BST_JITTER_LINES], frequency_hz[BST_JITTER_LINES];
    double phase_cycles[BST_JITTER_LINES];
} bst_jitter_axis;

typedef struct bst_jitter {
    double dt_s;
    int64_t index; /* of the step that the phasors stand at; -1: none */
    bool silent;   /* no flat bands */
    bst_jitter_axis axis[2];
    struct bst_jitter_more *more; /* owned: of tables and lines (bst_jitter_add); NULL: none */
} bst_jitter;

/* Steps of dt_s follow jitter up to this times 1 / dt_s. */
#define BST_JITTER_RESOLVED 0.4

/* What steps of dt_s can follow: the bands up to BST_JITTER_RESOLVED / dt_s, with their share of
 * the variance. */
bst_jitter_spec bst_jitter_resolved(const bst_jitter_spec *spec, double dt_s);

/* Variance, rad^2 per axis, that straight lines between samples dt_s apart of bst_jitter_resolved
 * lack: of a sinusoid of frequency f they have (2 + cos(2 pi f dt_s)) / 3 on average over its
 * phases. */
double bst_jitter_unresolved_rad2(const bst_jitter_spec *spec, double dt_s);

/* Draws the lines. Each band is cut into equal slots with one line of equal amplitude at a uniform
 * place in each, so that the spectrum is flat at the slots' resolution and the RMS is exact over
 * long times (a line of amplitude a has the mean square a^2 / 2). dt_s is the step of
 * bst_jitter_at. */
void bst_jitter_init(bst_jitter *jitter, const bst_jitter_spec *spec, double dt_s, bst_rng_key key);

/* Rotation of the camera about its x and y axes at time n * dt_s, rad. A function of n alone, to
 * the bit, whatever was asked before; asking for n = 0, 1, 2, ... in turn is fast. */
void bst_jitter_at(bst_jitter *jitter, int64_t n, double out_rad[2]);

/* Frees what bst_jitter_add made; a zeroed jitter is allowed. */
void bst_jitter_free(bst_jitter *jitter);

#endif
