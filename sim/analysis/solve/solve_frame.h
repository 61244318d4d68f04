/* boresight solve: attitude and pixel scale of a FITS frame from its pixels alone. */
#ifndef BST_ANALYSIS_SOLVE_SOLVE_FRAME_H
#define BST_ANALYSIS_SOLVE_SOLVE_FRAME_H

#include <stdio.h>

#include "sim/cli/options.h"

/* What the command line asks for. */
typedef struct bst_solve_request {
    const char *utc, *catalogue;
    double scale_arcsec, scale_tolerance, v_limit, least_snr;
    double speed_kmps[3]; /* of the observer, GCRF, geocentric */
    bool help;
} bst_solve_request;

/* Request without any option given. */
#define BST_SOLVE_REQUEST_DEFAULTS \
    { .catalogue = "default", .scale_tolerance = 0.05, .v_limit = 12.5, .least_snr = 12.0 }

/* Table of the options, with offsets in a bst_solve_request. */
extern const bst_option bst_solve_options[];

/* Finds the attitude of a frame of point-like or equally streaked stars and prints it.
 *
 * Given:     path  FITS file whose first image is the frame
 * Returned:  *solved  false: no attitude; said in the output
 * Errors:    those of bst_time_from_utc, bst_fits_read_image and the catalogue; BST_ERR_MEMORY */
bst_status bst_solve_frame(bst_ctx *ctx, const bst_solve_request *request, const char *path,
                           FILE *out, bool *solved) BST_MUST_CHECK;

#endif
