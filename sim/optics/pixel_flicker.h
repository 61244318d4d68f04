/* 1/f noise of single pixels, correlated from frame to frame: its processes, and their recursion
 * with one normal deviate per pixel and frame. */
#ifndef BST_OPTICS_PIXEL_FLICKER_H
#define BST_OPTICS_PIXEL_FLICKER_H

#include <stdbool.h>

#include "boresight/camera.h"

enum { BST_FLICKER_TERMS = 10 };

/* Sum of `terms` independent stationary Ornstein-Uhlenbeck processes of equal variance. */
typedef struct bst_pixel_flicker {
    int terms;
    double rate_per_s[BST_FLICKER_TERMS]; /* inverse correlation times, ascending */
    double variance_e2;                   /* of each */
    double time_s;                        /* of the latest read */
    /* of the processes at that time, given all frames before: e-^2 */
    double covariance[BST_FLICKER_TERMS][BST_FLICKER_TERMS];
} bst_pixel_flicker;

/* A frame of a pixel whose expected processes are m, by a standard normal deviate z:
 * noise = sum of weight m + spread z, and then m = decay m + gain z. */
typedef struct bst_pixel_flicker_step {
    int terms;
    double weight[BST_FLICKER_TERMS], decay[BST_FLICKER_TERMS], gain[BST_FLICKER_TERMS];
    double spread;
} bst_pixel_flicker_step;

/* Processes of a camera before its first frame; terms 0 if it has no such noise.
 *
 * Notes:     correlation times 1 / (2 pi f), f from lowest_hz to highest_hz in equal ratios of at
 *            most 4. In between, the one-sided power spectrum sum of 4 v tau / (1 + (2 pi f tau)^2)
 *            is 1/f within 6 % (Lorentzians of equal variance; Milotti 2002, arXiv
 *            physics/0204033), sigma^2 / (f n ln ratio) for n of them. */
void bst_pixel_flicker_begin(const bst_detector_config *detector, bst_pixel_flicker *out);

/* Autocovariance at a distance in time, e-^2: variance times the sum of exp(-rate |t|). */
double bst_pixel_flicker_covariance(const bst_pixel_flicker *flicker, double seconds);

/* Advances to the next frame.
 *
 * Given:     read_s        time of its read; before the latest one: at that time
 *            double_s      the read so much earlier is subtracted; 0: none is
 *            white_e       RMS of noise that is independent in each frame and part of `noise`
 * Returned:  *step  the frame; all pixels have the same one
 * Notes:     innovations form of a Gauss-Markov process that is seen through white noise (Anderson
 *            and Moore 1979, Optimal Filtering, section 9.3): the law of a frame given all frames
 *            before it is normal about sum of weight m. So all frames together have the exact
 *            covariance of processes and white noise, at any distances in time. */
void bst_pixel_flicker_advance(bst_pixel_flicker *flicker, double read_s, double double_s,
                               double white_e, bst_pixel_flicker_step *step);

/* RMS in a frame, e-: of the value, or of the difference of two reads `double_s` apart. */
double bst_pixel_flicker_noise_e(const bst_detector_config *detector);

#endif
