/* The zero point of a frame, from the stars that were identified in it. */
#ifndef BST_OPTICS_PHOTOMETRY_H
#define BST_OPTICS_PHOTOMETRY_H

#include "boresight/messages.h"
#include "boresight/status.h"

typedef struct bst_optics_zero_point {
    int stars;          /* it comes from; 0: they were too few, and the others are 0 */
    double offset_mag;  /* catalogue's magnitudes less those by the camera's own figures */
    double sigma_mag;   /* of the offset */
    double scatter_mag; /* of a star beyond its light's noise: colour, catalogue, calibration */
} bst_optics_zero_point;

typedef struct bst_optics_photometer {
    int capacity, count;
    double *excess, *variance, *work; /* [capacity]: mag, mag^2 */
} bst_optics_photometer;

/* Room for so many stars of a frame. */
bst_status bst_optics_photometer_create(bst_ctx *ctx, int capacity,
                                        bst_optics_photometer *out) BST_MUST_CHECK;
/* Frees the memory of a photometer and clears the struct, which belongs to the caller. */
void bst_optics_photometer_free(bst_optics_photometer *photometer);

/* Begins a frame: forgets the stars added. */
void bst_optics_photometer_begin(bst_optics_photometer *photometer);

/* Adds an identified star to the estimate of the zero point.
 *
 * Given:     star   detection with the magnitude by the camera's nominal figures; ignored if
 *                   saturated, cut by the edge, blended or of an SNR below 10
 *            v_mag  catalogue magnitude, V */
void bst_optics_photometer_add(bst_optics_photometer *photometer, const bst_detection *star,
                               double v_mag);

/* Mean difference of the stars, weighted by the noise of their light and the scatter that they
 * share, without those further than three standard deviations from the median; of three stars at
 * least. The scatter follows from the median deviation, so that wrong ones weigh little. */
bst_optics_zero_point bst_optics_photometer_zero_point(bst_optics_photometer *photometer);

/* Standard deviation of a detection's magnitude by the noise of its light alone; INFINITY without
 * light. */
double bst_photometry_noise_mag(const bst_detection *detection);

/* Puts a magnitude by the camera's own figures on the zero point, with its standard deviation. */
void bst_photometry_correct(const bst_optics_zero_point *zero_point, bst_detection *detection);

/* Puts a frame's magnitudes on the zero point, and sets their standard deviations from the noise of
 * the light and the zero point's; INFINITY without light. camera_zero_point_mag: V of an electron
 * per second by the camera's own figures. */
void bst_photometry_apply(const bst_optics_zero_point *zero_point, double camera_zero_point_mag,
                          bst_detections *detections);

#endif
