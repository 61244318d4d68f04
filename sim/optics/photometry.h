/* Photometric zero point of a frame, from identified stars. */
#ifndef BST_OPTICS_PHOTOMETRY_H
#define BST_OPTICS_PHOTOMETRY_H

#include "boresight/messages.h"
#include "boresight/status.h"

typedef struct bst_optics_zero_point {
    int stars;         /* number of stars used; 0: too few, other members are 0 */
    double offset_mag; /* catalogue magnitudes minus nominal magnitudes of the camera */
    double sigma_mag;  /* of the offset */
    double
        scatter_mag; /* scatter of a star beyond its photon noise: colour, catalogue, calibration */
} bst_optics_zero_point;

typedef struct bst_optics_photometer {
    int capacity, count;
    double *excess, *variance, *work; /* [capacity] mag, mag^2 */
} bst_optics_photometer;

/* Creates a photometer for a number of stars per frame. */
bst_status bst_optics_photometer_create(bst_ctx *ctx, int capacity,
                                        bst_optics_photometer *out) BST_MUST_CHECK;
/* Frees the memory of a photometer and clears the struct, which belongs to the caller. */
void bst_optics_photometer_free(bst_optics_photometer *photometer);

/* Begins a frame: removes all stars. */
void bst_optics_photometer_begin(bst_optics_photometer *photometer);

/* Adds an identified star to the estimate of the zero point.
 *
 * Given:     star   detection with the magnitude by the camera's nominal figures; ignored if
 *                   saturated, cut by the edge, blended or of an SNR below 10
 *            v_mag  catalogue magnitude, V */
void bst_optics_photometer_add(bst_optics_photometer *photometer, const bst_detection *star,
                               double v_mag);

/* Zero point of the frame: weighted mean difference of the stars, by photon noise and common
 * scatter, excluding those beyond three standard deviations from the median; at least three stars.
 * The scatter comes from the median deviation, robust against wrong identifications. */
bst_optics_zero_point bst_optics_photometer_zero_point(bst_optics_photometer *photometer);

/* Standard deviation of a detection's magnitude by photon noise only; INFINITY without light. */
double bst_photometry_noise_mag(const bst_detection *detection);

/* Applies the zero point to a nominal magnitude and its standard deviation. */
void bst_photometry_correct(const bst_optics_zero_point *zero_point, bst_detection *detection);

/* Applies the zero point to the magnitudes of a frame, and sets their standard deviations from
 * photon noise and zero point; INFINITY without light. camera_zero_point_mag: nominal V of one
 * electron per second. */
void bst_photometry_apply(const bst_optics_zero_point *zero_point, double camera_zero_point_mag,
                          bst_detections *detections);

#endif
