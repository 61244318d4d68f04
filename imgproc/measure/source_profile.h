/* Fast single-precision source images for fits, all of one PSF. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_PROFILE_H
#define BST_IMGPROC_MEASURE_SOURCE_PROFILE_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/detect/known_psf.h"
#include "imgproc/detect/psf.h"
#include "imgproc/detect/simd_layout.h"

enum {
    BST_PROFILE_PHASES = 128,
    BST_PROFILE_LENGTH = 96, /* longest profile, px */
};

/* Pixel-integrated PSF along one axis, sampled at centres 1/128 px apart: share, slope and half the
 * curvature by the centre. A Gaussian has one profile for both axes. A known PSF has `terms`
 * profiles per axis; those along x depend on the node of the field grid. */
typedef struct bst_source_profiles {
    const bst_known_psf *known; /* NULL: a Gaussian */
    double sigma_px;            /* sigma for which they were computed */
    int length, half; /* pixels per profile, a multiple of 16; pixels before the centre's */
    int reach;        /* half width in pixels */
    int pitch;        /* floats between rows; the padding lanes are 0 */
    float *rows;      /* [PHASES + 1][nodes][terms][3][pitch], in lanes */
    float *down;      /* known PSF along y: [PHASES + 1][terms][3][pitch], in lanes */
    /* frame geometry: full-sensor position = origin + binning * frame pixel */
    double origin_x_px, origin_y_px;
    int binning, made_binning;
} bst_source_profiles;

/* Creates profiles. Errors: BST_ERR_MEMORY.
 *
 * Given:     known  PSF, lent; NULL: Gaussian */
bst_status bst_source_profiles_create(bst_ctx *ctx, const bst_known_psf *known,
                                      bst_source_profiles *out) BST_MUST_CHECK;
/* Frees the memory of the profiles and clears the struct, which belongs to the caller. */
void bst_source_profiles_free(bst_source_profiles *profiles);
/* Sets the frame's origin, full-sensor px, and binning. */
void bst_source_profiles_on(bst_source_profiles *profiles, double origin_x_px, double origin_y_px,
                            int binning);
/* Computes the profiles for a Gaussian of sigma_px (at most 9) or for the known PSF, of which
 * sigma_px is the nearest Gaussian. It returns at once if they are up to date. */
void bst_source_profiles_set(bst_source_profiles *profiles, const bst_imgproc_gauss *psf,
                             double sigma_px);

/* Size of the work space of bst_source_profile_render for stamps of up to max_side px, in floats.
 */
size_t bst_source_profile_scratch(int max_side);

/* Renders a source on a stamp: four planes [height][stride] in a row: share, and its derivatives by
 * x, y and variance. As bst_imgproc_gauss_render, in single precision.
 *
 * Given:     scratch  bst_source_profile_scratch floats
 * Returned:  planes   stride: width rounded up to lanes; pixels beyond the stamp are undefined
 * Notes:     The error is below 2e-4 of the peak. Half of it is the quadrature along the path. The
 *            other half is the interpolation between profiles and, for sigma above 1.5 px, light
 *            beyond 4.5 sigma. For a known PSF the truncation of its terms is added. */
void bst_source_profile_render(const bst_source_profiles *profiles, const bst_imgproc_gauss *psf,
                               const bst_imgproc_shape *shape, const bst_imgproc_stamp *stamp,
                               float *scratch, float *planes);

/* Additional planes: derivatives by the path itself. They are by its length along `along` (a unit
 * vector), by its end minus start across that, (-along[1], along[0]), and by its bend along
 * `along`. */
enum { BST_IMAGE_BY_LENGTH = 4, BST_IMAGE_BY_ACROSS, BST_IMAGE_BY_BEND, BST_IMAGE_MOTION_PLANES };

/* Renders as bst_source_profile_render, with the derivatives by the motion that all streaks of a
 * frame share. */
void bst_source_profile_render_motion(const bst_source_profiles *profiles,
                                      const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                                      const bst_imgproc_stamp *stamp, const double along[2],
                                      float *scratch, float *planes);

/* Renders with a known PSF, as the two functions above; without motion planes if `along` is NULL.
 */
void bst_source_profile_render_known(const bst_source_profiles *profiles,
                                     const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                                     const bst_imgproc_stamp *stamp, const double *along,
                                     float *scratch, float *planes);
/* Computes the profiles of a known PSF for the frame's binning. */
void bst_source_profiles_set_known(bst_source_profiles *profiles);

#endif
