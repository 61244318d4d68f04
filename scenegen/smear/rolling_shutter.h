/* Rolling shutter: renders a frame as bands of rows, each with the line of sight and motion during
 * its middle row's exposure. Bands are as narrow as their brightest source requires, down to one
 * row, which is exact. */
#ifndef BST_SCENEGEN_SMEAR_ROLLING_SHUTTER_H
#define BST_SCENEGEN_SMEAR_ROLLING_SHUTTER_H

#include "scenegen/renderer.h"

typedef struct bst_rolling bst_rolling;

/* Creates a rolling shutter.
 *
 * Given:     tolerance_sigma  allowed image error by the bands in any pixel, sigma of that pixel
 *            peak_sigma_px    Gaussian with the PSF's peak pixel share
 *            gaussian         the PSF is that Gaussian */
bst_status bst_rolling_create(bst_ctx *ctx, const bst_camera *camera, double tolerance_sigma,
                              double peak_sigma_px, bool gaussian,
                              bst_rolling **out) BST_MUST_CHECK;
/* Frees a rolling shutter; NULL is allowed. */
void bst_rolling_free(bst_rolling *rolling);

/* Starts a frame; the request (with row_time_s) must stay valid until its last band.
 *
 * Given:     margin_px  distance from which a source still lights a pixel
 * Errors:    BST_ERR_ARGUMENT if the track is shorter than the exposure of all rows */
bst_status bst_rolling_begin(bst_ctx *ctx, bst_rolling *rolling, const bst_render_request *request,
                             double margin_px) BST_MUST_CHECK;

/* Next band as a separate request without row_time_s, valid until the next call. *more is false if
 * there is none. */
bst_status bst_rolling_next(bst_ctx *ctx, bst_rolling *rolling, bst_render_request *band,
                            bool *more) BST_MUST_CHECK;

/* Index in the request of source `index` of the latest band. */
int bst_rolling_source(const bst_rolling *rolling, int index);
/* Predicted image error by the latest band, in units of the pixel noise. */
double bst_rolling_error_sigma(const bst_rolling *rolling);

#endif
