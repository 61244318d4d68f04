/* Tells which detections are which stars of the onboard catalogue. */
#ifndef BST_IMGPROC_IDENTIFY_STARID_H
#define BST_IMGPROC_IDENTIFY_STARID_H

#include "boresight/messages.h"

/* A catalogue star where telemetry says that it should be, mean over the exposure. */
typedef struct bst_imgproc_expected_star {
    double x_px, y_px; /* full-sensor coordinates */
    double v_mag;      /* as the camera sees it: that of a Sun-like star of the same light */
    uint32_t id;
} bst_imgproc_expected_star;

typedef struct bst_starid_options {
    double search_radius_px;                /* greatest shift between expectation and detection */
    double tolerance_px;                    /* of a single star, after the shift */
    double centre_x_px, centre_y_px;        /* about which the field may be turned */
    double field_width_px, field_height_px; /* of the window that detections come from */
} bst_starid_options;

typedef struct bst_starid_result {
    int matched;
    double shift_x_px, shift_y_px; /* detection minus expectation, at the centre */
    double roll_rad;               /* turn from +x towards +y */
    double rms_px;                 /* of the residuals, per axis */
} bst_starid_result;

typedef struct bst_starid bst_starid;

/* Work space for up to max_stars and max_detections and shifts up to max_radius_px. */
bst_status bst_starid_create(bst_ctx *ctx, int max_stars, int max_detections, double max_radius_px,
                             bst_starid **out) BST_MUST_CHECK;
/* Frees a star identification; NULL is allowed. */
void bst_starid_free(bst_starid *starid);

/* Matches detections to stars that are shifted and slightly turned together.
 *
 * Every pair of a bright detection and a bright star of consistent magnitude votes for a shift; the
 * densest 4 x 4 px square wins if chance would fill a square anywhere as well in less than 1 of 100
 * frames (Poisson, at the density of consistent pairs). Then the nearest consistent partners are
 * matched one to one, shift and turn fitted by least squares, and again with a closer tolerance.
 * Sets star_id, label STAR and its probability (the pair's distance against the density of what
 * matches no star) of the matched ones, leaves the others untouched. Only detections of label
 * UNKNOWN (or STAR) take part. */
void bst_starid_match(bst_starid *starid, const bst_starid_options *options,
                      const bst_imgproc_expected_star *stars, int star_count, bst_detection *items,
                      int count, bst_starid_result *out);

/* Index of the star that the latest match gave a detection, -1: none. */
int bst_starid_star_of(const bst_starid *starid, int detection);

#endif
