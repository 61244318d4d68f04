/* Steps of `boresight twin`. */
#ifndef BST_PROCESS_TWIN_TWIN_INTERNAL_H
#define BST_PROCESS_TWIN_TWIN_INTERNAL_H

#include <stdio.h>

#include "sim/catalogue/stars.h"
#include "sim/optics/band.h"
#include "sim/process/process_internal.h"
#include "sim/process/twin/twin.h"
#include "sim/process/twin/twin_model.h"

/* Brightness of the stars by the catalogue: V of one electron per second for B-V = 0.65, and the
 * slope with B-V. */
typedef struct bst_twin_photometry {
    int stars;                         /* that gave it */
    double zero_point_mag, colour_mag; /* m = zero point - 2.5 log10(e-/s) + colour (B-V - 0.65) */
    double scatter_mag;                /* standard deviation of the stars used, after clipping */
    double bright_mag; /* the same of those with V < BST_TWIN_BRIGHT_V; NAN: fewer than 3 */
    int bright;
} bst_twin_photometry;
#define BST_TWIN_BRIGHT_V 11.5

/* A pixel whose level no light explains. */
typedef struct bst_twin_defect {
    int x, y;
    double level_e; /* above the model; below 0 where a dark frame was subtracted that was too
                       bright */
} bst_twin_defect;

/* State of the command. */
typedef struct bst_twin {
    const bst_twin_request *request;
    bst_process_request process_request;
    bst_process process;      /* all frames */
    bst_process_frame *frame; /* the one that gets a twin */
    bst_twin_model model;
    float *data_e;   /* [height][width] */
    bst_light light; /* of the observer at mid-exposure */
    double julian_year, length_px;
    double read_noise_e;  /* by the header */
    bool direction_known; /* which end of the path came first */
    bst_parallel *pool;
    bst_twin_photometry photometry;
    int catalogue_stars; /* of model.stars, the first */
    bst_twin_defect *defects;
    int defect_count;
    int64_t below_range; /* pixels below the least count, which the pedestal does not lift to 0 */
    char stem[4096];     /* of the output files */
} bst_twin;

/* Name of a file of the twin: the scenario's without .json, and an ending. */
static inline void bst_twin_file(const bst_twin *twin, const char *ending, char path[4096]) {
    snprintf(path, 4096, "%.4000s%s", twin->stem, ending);
}

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

/* Zero point and band from the fitted stars of the catalogue; sets their expected_e.
 *
 * Errors:    those of bst_band_create */
bst_status bst_twin_measure_photometry(bst_ctx *ctx, bst_twin *twin) BST_MUST_CHECK;

/* What the scenario's camera has. */
typedef struct bst_twin_camera {
    bst_band_config band;
    bst_optics_response_point response[32];
    int points;                /* of the response; 0: the V band */
    double background_e;       /* per pixel and exposure where the fitted background is 0 */
    double dark_e;             /* the part of it that is dark signal; 0: no defects */
    double recorded_offset_dn; /* level of a pixel without light by header or map */
    double pedestal_dn;        /* by which the twin's level is above the recorded one */
    double read_noise_e;
    double photon_flux_v0_per_s_m2; /* of the V band */
    double aperture_m, throughput, quantum_efficiency;
    bst_band *spectrum; /* NULL: the V band */
    double rate_v0;     /* electrons per second of a star of V = 0 and B-V of the Sun */
} bst_twin_camera;

/* Chooses band, throughput, noise and background of the camera, so that the scenario's frame has
 * the zero point, colour term, noise and background of the recorded one.
 *
 * Given:     camera_json  of the scenario, changed accordingly
 * Ownership: free out->spectrum with bst_band_free
 * Errors:    those of bst_band_create; BST_ERR_NUMERIC: no zero point */
bst_status bst_twin_make_camera(bst_ctx *ctx, const bst_twin *twin, struct cJSON *camera_json,
                                bst_twin_camera *out) BST_MUST_CHECK;

/* Writes scenario, path, PSF and stars.
 *
 * Errors:    those of the outputs */
bst_status bst_twin_write(bst_ctx *ctx, const bst_twin *twin,
                          bst_twin_camera *camera) BST_MUST_CHECK;
/* Queries all stars of an open catalogue within a cone, at the frame's date.
 *
 * Given:     centre  unit, ICRS
 * Ownership: free(*out)
 * Errors:    those of the catalogue; BST_ERR_MEMORY */
bst_status bst_twin_query_stars(bst_ctx *ctx, const bst_twin *twin, const bst_stars *catalogue,
                                bst_vec3 centre, double radius_rad, bst_star **out,
                                int *count) BST_MUST_CHECK;

/* Writes the star catalogue of the twin.
 *
 * Errors:    those of the catalogues */
bst_status bst_twin_write_stars(bst_ctx *ctx, const bst_twin *twin, const bst_twin_camera *camera,
                                const char *path) BST_MUST_CHECK;

/* Residual figures of the rendered twin. */
typedef struct bst_twin_figures {
    double chi2, chi2_streaks; /* per pixel, less one for each defect, by the measured noise */
    double chi2_clipped, chi2_streaks_clipped; /* without defects and pixels beyond 5 sigma */
    double chi2_header; /* by the header's read noise and the background's shot noise */
    double chi2_stars;  /* as chi2, by background and stars alone: defects count as residuals */
    int64_t pixels, streak_pixels, outliers, streak_outliers; /* outliers: beyond 5 sigma */
    double explained;           /* share of the frame's variance, noise included */
    double explained_clipped;   /* the same without outliers and noise */
    double explained_streaks;   /* on streaks, noise included */
    double explained_catalogue; /* as explained_clipped, by the catalogue's stars alone */
    double across_px, along_px; /* RMS of the catalogue's streaks off the path */
    int streaks;
} bst_twin_figures;

/* Runs the scenario, compares its frame with the recorded one, and writes the report.
 *
 * Errors:    those of the run and the outputs */
bst_status bst_twin_report(bst_ctx *ctx, bst_twin *twin,
                           const bst_twin_camera *camera) BST_MUST_CHECK;

#endif
