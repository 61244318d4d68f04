/* Rows of a light curve, computed by all processors. */
#ifndef BST_ANALYSIS_SHAPE_LIGHT_CURVE_ROWS_H
#define BST_ANALYSIS_SHAPE_LIGHT_CURVE_ROWS_H

#include "sim/analysis/shape/light_curve.h"
#include "sim/world/world.h"

/* What a light curve is computed from. */
typedef struct bst_light_curve {
    const bst_light_curve_request *request;
    bst_world *world;
    bst_time epoch;                        /* of the world */
    double start_s;                        /* after the epoch */
    int object;                            /* that is seen */
    int observer, observing_object;        /* either, or both -1: the site */
    bst_vec3 site_itrf_m, east, north, up; /* of the site, ITRF */
} bst_light_curve;

/* One row of the table. */
typedef struct bst_light_curve_row {
    double seconds, v_mag; /* v_mag +INFINITY: no light arrives */
    bst_world_sight sight;
    double elevation_rad, azimuth_rad; /* NAN without a site */
} bst_light_curve_row;

/* Computes all rows, of request->step_s from c->start_s on.
 *
 * Given:     threads  0: one per available processor
 * Returned:  rows  [count], the same for any number of threads
 * Errors:    those of the first row whose orbit has no state; BST_ERR_ARGUMENT: the observer is
 *            the object itself; BST_ERR_MEMORY */
bst_status bst_light_curve_rows(bst_ctx *ctx, const bst_light_curve *c, int threads, int count,
                                bst_light_curve_row *rows) BST_MUST_CHECK;

#endif
