/* Least-squares fit of a uniformly lit segment, straight or slightly bent: the image of an object
 * that moves by more than the PSF. The image is in closed form, and the cost grows with the length
 * of the segment, not with the square of it. */
#ifndef BST_IMGPROC_STREAK_SEGMENT_FIT_H
#define BST_IMGPROC_STREAK_SEGMENT_FIT_H

#include <stdbool.h>

typedef struct bst_segment {
    double x_px, y_px; /* mean place of its light */
    double angle_rad;  /* from its start to its end */
    double half_px;    /* half of its length */
    /* it lies bend (u^2 - half^2 / 3) beside its axis, u along it from its mean place */
    double bend_per_px;
    double flux_e;
    double sigma_px; /* of the PSF with the pixel's own width */
} bst_segment;

/* Pixel of a fit. */
typedef struct bst_segment_pixel {
    float x_px, y_px, signal_e; /* above the background */
} bst_segment_pixel;

/* Pixels and noise model of a fit. */
typedef struct bst_segment_data {
    const bst_segment_pixel *pixels;
    int count;
    double noise_e; /* of the background */
    double excess;  /* variance of shot noise per electron */
} bst_segment_data;

/* Errors of a fit. */
typedef struct bst_segment_errors {
    double cov_xx, cov_xy, cov_yy; /* of the mean place, px^2 */
    double turn_variance;          /* of the direction, rad^2 */
    double flux_variance;
    double chi_square;
    double end_variance; /* of each end along the segment, beyond the linear law; part of cov */
    double norm;         /* sqrt(sum p^2) of the image of unit flux */
} bst_segment_errors;

/* What a fit may change beside direction, place across it, flux and width. */
typedef struct bst_segment_freedom {
    bool held[2]; /* start and end stay where they are along the segment */
    bool bent;    /* the bend is fitted */
} bst_segment_freedom;

/* Fits place, direction, length, flux and width of a segment, as far as `freedom` says, by damped
 * Gauss-Newton (Levenberg 1944) on sum (d - m)^2 / (noise^2 + excess m).
 *
 * Given:     segment  first estimate
 *            beyond   most that an end may move outwards, px: the pixels reach that far
 * Returned:  segment  the fit
 *            errors   inverse Fisher matrix of all parameters, and along the segment the law of
 *                     the ends
 *            false, with the segment unchanged: the pixels do not determine the parameters, or an
 *            end only within half of the length
 * Notes:     An end is a change of the mean of white noise. If a length l of the segment has the
 *            squared SNR l m^2, the end of greatest likelihood has the variance 26 / m^4 beside
 *            that of the Fisher matrix, which holds for ends that the PSF blurs by more than
 *            1 / m^2
 * Reference: Yao, Ann. Statist. 15, 1321, 1987 (law of the estimated change) */
bool bst_segment_fit_run(const bst_segment_data *data, double beyond,
                         const bst_segment_freedom *freedom, bst_segment *segment,
                         bst_segment_errors *errors);

/* The part of a segment from one place along it to another, which may be beyond its ends, with the
 * same light per length and the same bend. */
bst_segment bst_segment_part(const bst_segment *segment, double from_px, double to_px);
/* Place on a segment, at u px along it from its mean place. */
void bst_segment_place(const bst_segment *segment, double along_px, double *x_px, double *y_px);
/* Distance of a place from a segment's line, px, and its place along it from the mean place. */
double bst_segment_distance(const bst_segment *segment, double x_px, double y_px, double *along_px);
/* Share of a segment's light in a pixel. A half length of 0 is a point. */
double bst_segment_share(const bst_segment *segment, double x_px, double y_px);

#endif
