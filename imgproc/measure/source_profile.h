/* Images of sources in single precision, for fits: many a frame, all of one PSF. */
#ifndef BST_IMGPROC_MEASURE_SOURCE_PROFILE_H
#define BST_IMGPROC_MEASURE_SOURCE_PROFILE_H

#include <stdbool.h>

#include "boresight/status.h"
#include "imgproc/detect/known_psf.h"
#include "imgproc/detect/psf.h"
#include "imgproc/detect/simd_layout.h"

enum {
    BST_PROFILE_PHASES = 128,
    BST_PROFILE_LENGTH = 96, /* the most */
};

/* The pixel-integrated PSF along one axis at centres of 1/128 px apart: share, slope and half the
 * curvature by centre. A Gaussian has one profile for both axes; a known PSF `terms` of them for
 * each, those of x by node of the field grid. */
typedef struct bst_source_profiles {
    const bst_known_psf *known; /* NULL: a Gaussian */
    double sigma_px;            /* that they were made for */
    int length, half;           /* pixels of a row: a multiple of 16; of them before the centre's */
    int reach;                  /* pixels about the centre's that count */
    int pitch;                  /* floats from a row to the next: lanes before and after are 0 */
    float *rows;                /* lanes, [PHASES + 1][nodes][terms][3][pitch] */
    float *down;                /* of a known PSF along y: lanes, [PHASES + 1][terms][3][pitch] */
    /* the frame: full-sensor place = origin + binning * its pixel */
    double origin_x_px, origin_y_px;
    int binning, made_binning;
} bst_source_profiles;

/* known: lent, NULL for a Gaussian. */
bst_status bst_source_profiles_create(bst_ctx *ctx, const bst_known_psf *known,
                                      bst_source_profiles *out) BST_MUST_CHECK;
/* Frees the memory of the profiles and clears the struct, which belongs to the caller. */
void bst_source_profiles_free(bst_source_profiles *profiles);
/* Where on the sensor the sources of a frame are. */
void bst_source_profiles_on(bst_source_profiles *profiles, double origin_x_px, double origin_y_px,
                            int binning);
/* Makes them for a Gaussian of sigma_px, at most 9, or the known PSF, which sigma_px is the like
 * of; at once when they are there. */
void bst_source_profiles_set(bst_source_profiles *profiles, const bst_imgproc_gauss *psf,
                             double sigma_px);

/* Work space of bst_source_profile_render for stamps of up to max_side, floats. */
size_t bst_source_profile_scratch(int max_side);

/* As bst_imgproc_gauss_render, for the PSF of `profiles`: four planes [height][stride] one after
 * the other, share, by x, by y and by variance; stride: the stamp's width rounded up to lanes, what
 * is beyond the stamp is of no meaning. Errors stay below 2e-4 of the peak: half of it the sum
 * along the path, the rest the straight lines between the profiles' centres and, for sigma
 * beyond 1.5 px, the light beyond 4.5 sigma; of a known PSF, what its sums miss. */
void bst_source_profile_render(const bst_source_profiles *profiles, const bst_imgproc_gauss *psf,
                               const bst_imgproc_shape *shape, const bst_imgproc_stamp *stamp,
                               float *scratch, float *planes);

/* The planes of a path's own changes, after the four: by its length in the direction `along` (a
 * unit vector), by its end minus start across that, (-along[1], along[0]), and by its bend in
 * direction `along`. */
enum { BST_IMAGE_BY_LENGTH = 4, BST_IMAGE_BY_ACROSS, BST_IMAGE_BY_BEND, BST_IMAGE_MOTION_PLANES };

/* As bst_source_profile_render, with the planes of changes that all streaks of a frame share. */
void bst_source_profile_render_motion(const bst_source_profiles *profiles,
                                      const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                                      const bst_imgproc_stamp *stamp, const double along[2],
                                      float *scratch, float *planes);

/* The same two for a known PSF: with the planes of changes unless `along` is NULL. */
void bst_source_profile_render_known(const bst_source_profiles *profiles,
                                     const bst_imgproc_gauss *psf, const bst_imgproc_shape *shape,
                                     const bst_imgproc_stamp *stamp, const double *along,
                                     float *scratch, float *planes);
/* Fills the profiles of a known PSF for the frame's binning. */
void bst_source_profiles_set_known(bst_source_profiles *profiles);

#endif
