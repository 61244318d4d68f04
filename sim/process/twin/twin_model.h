/* Forward model of a frame of stars: their light along the path of the line of sight, a PSF of two
 * Gaussians and a quadratic background; and its fit to the pixels. */
#ifndef BST_PROCESS_TWIN_TWIN_MODEL_H
#define BST_PROCESS_TWIN_TWIN_MODEL_H

#include "boresight/camera.h"
#include "sim/core/parallel.h"
#include "sim/process/twin/twin_path.h"

enum { BST_TWIN_BACKGROUND = 6, BST_TWIN_STARS = 1600 };

/* A star. */
typedef struct bst_twin_star {
    bst_vec3 apparent;       /* unit, GCRF axes */
    double flux_e;           /* of the exposure; fitted */
    double sigma_e;          /* standard deviation of flux_e; NAN: not determined */
    double expected_e;       /* by the catalogue and the zero point; NAN: unknown */
    bool found;              /* in no catalogue: its place is fitted too */
    bst_vec3 icrs;           /* catalogue place at the frame's date; unset for a found star */
    double v_mag, b_minus_v; /* NAN: unknown */
    uint32_t id;
    double inside; /* share of its light on the frame, by its path */
} bst_twin_star;

/* Two Gaussians before integration over the pixel. */
typedef struct bst_twin_psf {
    double sigma_px; /* of the narrow one */
    double ratio;    /* width of the wide one over that */
    double wide;     /* share of the wide one */
} bst_twin_psf;

/* Width of the wide Gaussian, px. */
static inline double bst_twin_psf_wide_px(const bst_twin_psf *psf) {
    return psf->sigma_px * psf->ratio;
}
/* Samples of its file per pixel. */
#define BST_TWIN_OVERSAMPLING 5.0

/* A frame and its model. Background: c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2 with u, v from -1
 * to 1 over columns and rows, as the scenario's block `background` has it. */
typedef struct bst_twin_model {
    bst_camera camera; /* pixel_scale_arcsec is fitted */
    bst_twin_path path;
    bst_twin_psf psf;
    double background_e[BST_TWIN_BACKGROUND];
    bst_twin_star *stars; /* [count], room for BST_TWIN_STARS */
    int count;
    int width, height;
    const float *data_e; /* [height][width] electrons; NAN: no value */
    double noise_e;      /* of a pixel without stars, standard deviation */
    double form_error;  /* of the PSF, as a share of a pixel's starlight: keeps a few bright streaks
                           from outweighing all others */
    float *variance_e2; /* [height][width] of the latest fit */
    bool converged;     /* the latest fit ended because it improved no more */
} bst_twin_model;

/* Electrons of a frame by the model.
 *
 * Given:     pool   NULL: this thread
 * Returned:  stars_e  [height][width] light of the stars, without the background
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_model_render(bst_ctx *ctx, const bst_twin_model *model, bst_parallel *pool,
                                 float *stars_e) BST_MUST_CHECK;

/* Residual of the frame: data minus model.
 *
 * Returned:  residual_e  [height][width], NAN where the frame has no value
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_model_residual(bst_ctx *ctx, const bst_twin_model *model, bst_parallel *pool,
                                   float *residual_e) BST_MUST_CHECK;

/* Background at a pixel, e-. */
double bst_twin_background(const bst_twin_model *model, int x, int y);

/* What a fit may change. */
typedef struct bst_twin_freedom {
    bool path, roll, scale, psf; /* besides background and fluxes, which are always fitted */
    double least_snr; /* stars whose flux_e is below this many sigma_e stay as they are */
    int iterations;
} bst_twin_freedom;

/* Fits the model to the frame by Levenberg and Marquardt's method with Huber's loss at 4 sigma.
 *
 * All parameters are fitted jointly. The variance of a pixel is noise_e^2 plus the light of the
 * stars by the model, and form_error of that light squared; it is kept during the call.
 *
 * Returned:  model      fitted; sigma_e of the stars
 *            *loss      sum over the pixels; half of chi squared without outliers
 * Errors:    BST_ERR_MEMORY, BST_ERR_INTERRUPTED
 * Reference: Huber, Robust Statistics (1981), section 7.7; Nocedal and Wright, Numerical
 *            Optimization (2006), section 10.3 */
bst_status bst_twin_model_fit(bst_ctx *ctx, bst_twin_model *model, const bst_twin_freedom *freedom,
                              bst_parallel *pool, double *loss) BST_MUST_CHECK;

/* Number of free values of the path. */
int bst_twin_path_values(const bst_twin_path *path);

/* Length of the path of a star at the frame's middle, px. */
double bst_twin_path_length_px(const bst_twin_model *model);

/* Moves the direction of a star so that its image moves. */
void bst_twin_star_shift(const bst_twin_model *model, bst_twin_star *star, double dx_px,
                         double dy_px);

/* Displacement of a star's image from the model's path, measured on its own pixels with the other
 * stars as they are. */
typedef struct bst_twin_offset {
    double across_px, along_px, across_sigma_px, along_sigma_px;
} bst_twin_offset;

/* Measures the displacement of a star.
 *
 * Given:     residual_e  [height][width] frame minus model with background
 * Returned:  *measured  false: the pixels do not determine it, or it is 2 px or more
 * Errors:    BST_ERR_MEMORY */
bst_status bst_twin_star_offset(bst_ctx *ctx, const bst_twin_model *model,
                                const bst_twin_star *star, const float *residual_e,
                                bst_twin_offset *out, bool *measured) BST_MUST_CHECK;

#endif
