/* Jitter from tables and harmonic lines, in addition to the flat bands. */
#ifndef BST_GIMBAL_JITTER_JITTER_MORE_H
#define BST_GIMBAL_JITTER_JITTER_MORE_H

#include "gimbal/jitter/jitter_noise.h"
#include "gimbal/jitter/jitter_spectrum.h"

typedef struct bst_jitter_more {
    bool has_noise[2];
    bst_jitter_noise noise[2]; /* low, high */
    double y_factor;
    int lines;
    int64_t index; /* step of the phasors; -1: none */
    bst_jitter_line line[BST_JITTER_SPECTRUM_LINES];
    double re[BST_JITTER_SPECTRUM_LINES], im[BST_JITTER_SPECTRUM_LINES];
    double turn_re[BST_JITTER_SPECTRUM_LINES], turn_im[BST_JITTER_SPECTRUM_LINES];
} bst_jitter_more;

/* Adds the jitter of tables and lines at step n to out. */
void bst_jitter_more_at(bst_jitter_more *more, int64_t n, double dt_s, double out[2]);

#endif
