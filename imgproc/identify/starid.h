/* Star identification: matches detections to stars of the onboard catalogue. */
#ifndef BST_IMGPROC_IDENTIFY_STARID_H
#define BST_IMGPROC_IDENTIFY_STARID_H

#include "boresight/camera.h"
#include "boresight/messages.h"

/* A catalogue star and its predicted position, mean over the exposure. */
typedef struct bst_imgproc_expected_star {
    double x_px, y_px; /* full-sensor coordinates */
    double v_mag;      /* effective magnitude: V of a Sun-like star of the same signal */
    uint32_t id;
} bst_imgproc_expected_star;

typedef struct bst_starid_options {
    double search_radius_px;                /* largest shift between prediction and detection */
    double tolerance_px;                    /* match tolerance of one star after the common shift */
    double centre_x_px, centre_y_px;        /* centre of the roll */
    double field_width_px, field_height_px; /* window of the detections */
} bst_starid_options;

typedef struct bst_starid_result {
    int matched;
    double shift_x_px, shift_y_px; /* detection minus prediction, at the centre */
    double roll_rad;               /* rotation from +x towards +y */
    double rms_px;                 /* RMS residual per axis */
} bst_starid_result;

typedef struct bst_starid bst_starid;

/* Creates a star identification for up to max_stars, max_detections and shifts up to max_radius_px.
 * Errors: BST_ERR_MEMORY. */
bst_status bst_starid_create(bst_ctx *ctx, int max_stars, int max_detections, double max_radius_px,
                             bst_starid **out) BST_MUST_CHECK;
/* Frees a star identification; NULL is allowed. */
void bst_starid_free(bst_starid *starid);

/* Matches detections to catalogue stars that share one shift and a small roll.
 *
 * Every pair of a bright detection and a bright star of consistent magnitude votes for a shift. The
 * densest 4 x 4 px cell wins if chance would fill a cell as well in less than 1 of 100 frames
 * (Poisson, at the density of consistent pairs). The nearest consistent partners are then matched
 * one to one. Shift and roll are fitted by least squares, and the match is repeated with a smaller
 * tolerance.
 *
 * Given:     items  detections; only those labelled UNKNOWN or STAR take part
 * Returned:  items  matched ones: star_id, label STAR and label_probability (distance of the pair
 *                   against the density of detections that are no catalogue stars); others
 *                   unchanged */
void bst_starid_match(bst_starid *starid, const bst_starid_options *options,
                      const bst_imgproc_expected_star *stars, int star_count, bst_detection *items,
                      int count, bst_starid_result *out);

/* Attitude corrected by the shift and roll of a match.
 *
 * Given:     q_cam_from_gcrf  attitude with which the stars were predicted
 * Returned:  q_cam_from_gcrf of the matched stars */
bst_quat bst_starid_attitude(const bst_camera *camera, const bst_starid_options *options,
                             const bst_starid_result *result, bst_quat q_cam_from_gcrf);

/* Index of the star that the latest match assigned to a detection; -1: none. */
int bst_starid_star_of(const bst_starid *starid, int detection);

#endif
