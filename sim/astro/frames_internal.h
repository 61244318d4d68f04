/* Slowly varying parts of the Earth rotation, which sky_clock.c interpolates; prediction of Earth
 * orientation. */
#ifndef BST_ASTRO_FRAMES_INTERNAL_H
#define BST_ASTRO_FRAMES_INTERNAL_H

#include "sim/astro/frames.h"

/* Prediction after the last row of a table. */
typedef struct bst_astro_eop_prediction {
    int last_mjd; /* of the last row, 0h UTC */
    int rows;     /* of the table */
    double ut1_minus_tai_s, rate_s_per_day;
    double terms_arcsec[2][5]; /* x and y: constant, cosine and sine of a year and of Chandler */
    double rest_arcsec[2];     /* difference between last row and fit */
} bst_astro_eop_prediction;

/* Fits the prediction after a table's rows (at least 2): the pole as secular pole with an offset,
 * annual and Chandler terms, and a decaying difference to the last row; UT1-TAI with the mean rate
 * of the last half year and the conventional seasons. Continuous at the last row. BST_ERR_NUMERIC
 * for values that are no numbers. Source: the form of IERS Bulletin A; McCarthy and Luzum, Bulletin
 * Geodesique 65 (1991) 18. */
bst_status bst_astro_eop_prediction_fit(bst_ctx *ctx, int first_mjd, int count,
                                        const bst_astro_eop_values *rows,
                                        bst_astro_eop_prediction *out) BST_MUST_CHECK;
/* Predicted values at a UTC date after the table, with the leap seconds known to ERFA. */
void bst_astro_eop_prediction_at(const bst_astro_eop_prediction *prediction, double mjd,
                                 bst_astro_eop_values *out);
/* Uncertainty of the predicted values. */
void bst_astro_eop_prediction_error(const bst_astro_eop_prediction *prediction, double mjd,
                                    bst_astro_eop_uncertainty *out);

typedef struct bst_astro_earth_parts {
    bst_mat3 cirs_from_gcrf; /* celestial intermediate pole and origin */
    bst_mat3 itrf_from_tirs; /* polar motion and TIO locator */
    double era_rad;          /* Earth rotation angle, [0, 2 pi) */
    double teme_turn_rad;    /* cirs_from_teme: rotation of the axes about z by this angle */
} bst_astro_earth_parts;

/* Computes the parts of the Earth rotation at t, with the Earth orientation at `read_at`. */
bst_status bst_astro_earth_parts_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                    bst_time read_at, bst_astro_earth_parts *out) BST_MUST_CHECK;
/* Nearest time to t within the table, one second inside its ends. */
bst_status bst_astro_eop_nearest(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                 bst_time *out) BST_MUST_CHECK;

/* Rotations from GCRF to TEME and ITRF from their parts.
 *
 * Given:     parts  polar motion, Earth rotation angle, CIRS rotation and turn to TEME */
bst_astro_earth_frames bst_astro_earth_frames_from_parts(const bst_astro_earth_parts *parts);
/* Interpolates between parts at most an hour apart, linearly: error 1e-10 rad. f: 0 at a, 1 at
 * b. */
bst_astro_earth_parts bst_astro_earth_parts_between(const bst_astro_earth_parts *a,
                                                    const bst_astro_earth_parts *b, double f);

#endif
