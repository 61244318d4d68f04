/* Steps of `boresight twin`. */
#ifndef BST_PROCESS_TWIN_TWIN_INTERNAL_H
#define BST_PROCESS_TWIN_TWIN_INTERNAL_H

#include "sim/process/twin/twin.h"
#include "sim/process/twin/twin_model.h"
#include "sim/process/process_internal.h"

/* Brightness of the stars by the catalogue: V of one electron per second for B-V = 0.65, and the
 * slope with B-V. */
typedef struct bst_twin_photometry {
    int stars;                         /* that gave it */
    double zero_point_mag, colour_mag; /* m = zero point - 2.5 log10(e-/s) + colour (B-V - 0.65) */
    double tilt;          /* of the band's response, per 100 nm; NAN: the V band */
    double scatter_mag;   /* standard deviation of the stars used, after clipping */
    double bright_mag;    /* the same of those with V < BST_TWIN_BRIGHT_V; NAN: fewer than 3 */
    int bright;
} bst_twin_photometry;
#define BST_TWIN_BRIGHT_V 11.5

/* State of the command. */
typedef struct bst_twin {
    const bst_twin_request *request;
    bst_process_request process_request;
    bst_process process;       /* all frames */
    bst_process_frame *frame;  /* the one that gets a twin */
    bst_twin_model model;
    float *data_e;             /* [height][width] */
    bst_light light;           /* of the observer at mid-exposure */
    double julian_year, length_px;
    double read_noise_e;       /* by the header */
    bst_parallel *pool;
    bst_twin_photometry photometry;
    int catalogue_stars;       /* of model.stars, the first */
    char stem[4096];           /* of the output files */
} bst_twin;

/* Fits model and path to the frame.
 *
 * Given:     twin->process solved, twin->frame one with an attitude
 * Returned:  twin->model and what belongs to it
 * Errors:    those of the files, the catalogue and the fit */
bst_status bst_twin_fit_frame(bst_ctx *ctx, bst_twin *twin) BST_MUST_CHECK;

/* Adds the catalogue's stars on the frame to the model, brightest first.
 *
 * Errors:    those of the catalogue; BST_ERR_MEMORY */
bst_status bst_twin_add_catalogue(bst_ctx *ctx, bst_twin *twin) BST_MUST_CHECK;
/* Adds stars that the residual shows along the path and that are not in the model.
 *
 * Given:     least_snr  faintest
 * Returned:  *added     their number
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_add_found(bst_ctx *ctx, bst_twin *twin, double least_snr,
                              int *added) BST_MUST_CHECK;
/* Removes found stars below a signal-to-noise ratio. Returns how many. */
int bst_twin_remove_faint(bst_twin *twin, double least_snr);

/* Residual of the frame: data minus model.
 *
 * Returned:  residual_e  [height][width], NAN where the frame has no value
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_residual(bst_ctx *ctx, const bst_twin *twin, float *residual_e) BST_MUST_CHECK;

/* Zero point and band from the fitted stars of the catalogue; sets their expected_e.
 *
 * Errors:    those of bst_band_create */
bst_status bst_twin_measure_photometry(bst_ctx *ctx, bst_twin *twin) BST_MUST_CHECK;

#endif
