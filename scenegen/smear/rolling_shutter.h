/* A rolling shutter: a frame as bands of rows, each with the line of sight and the motion of its
 * middle row's own exposure. Bands are as narrow as the brightest source on them needs, down to one
 * row, which is exact. */
#ifndef BST_SCENEGEN_SMEAR_ROLLING_SHUTTER_H
#define BST_SCENEGEN_SMEAR_ROLLING_SHUTTER_H

#include "scenegen/renderer.h"

typedef struct bst_rolling bst_rolling;

/* tolerance_sigma: error of each source's image in any pixel by the bands that is allowed, sigma of
 * that pixel. peak_sigma_px: of the Gaussian that puts as much of a point's light in one pixel as
 * the PSF; gaussian: it is that Gaussian. */
bst_status bst_rolling_create(bst_ctx *ctx, const bst_camera *camera, double tolerance_sigma,
                              double peak_sigma_px, bool gaussian,
                              bst_rolling **out) BST_MUST_CHECK;
/* Frees a rolling shutter; NULL is allowed. */
void bst_rolling_free(bst_rolling *rolling);

/* Starts a frame; the request (with row_time_s) is needed until its last band. margin_px: distance
 * from which a source still lights a pixel. BST_ERR_ARGUMENT when the track is shorter than the
 * exposure of all rows. */
bst_status bst_rolling_begin(bst_ctx *ctx, bst_rolling *rolling, const bst_render_request *request,
                             double margin_px) BST_MUST_CHECK;

/* The next band as a request of its own, without row_time_s. *more is false when there is none.
 * Held until the next call. */
bst_status bst_rolling_next(bst_ctx *ctx, bst_rolling *rolling, bst_render_request *band,
                            bool *more) BST_MUST_CHECK;

/* Number in the request of source `index` of the latest band. */
int bst_rolling_source(const bst_rolling *rolling, int index);
/* Predicted error of the latest band, in units of the pixel noise. */
double bst_rolling_error_sigma(const bst_rolling *rolling);

#endif
