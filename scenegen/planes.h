/* Noise-free planes and masks of an exposure in the frame's (binned) pixels, rendered as the frame
 * is. */
#ifndef BST_SCENEGEN_PLANES_H
#define BST_SCENEGEN_PLANES_H

#include "scenegen/renderer.h"

typedef struct bst_plane_maker bst_plane_maker;

/* Creates a plane maker for windows of up to width x height pixels.
 *
 * Given:     planes           bit k: bst_plane k
 *            threshold_sigma  threshold of the segmentation mask, sigma of a dark pixel */
bst_status bst_plane_maker_create(bst_ctx *ctx, uint32_t planes, int width, int height,
                                  double threshold_sigma, bst_plane_maker **out) BST_MUST_CHECK;
/* Frees a plane maker; NULL is allowed. */
void bst_plane_maker_free(bst_plane_maker *maker);

/* Renders the planes of `request`, which must be the renderer's latest; its sources are stars
 * first, then objects. The saturation plane needs a renderer with saturation_flags. Afterwards the
 * renderer's statistics and peaks belong to other requests.
 *
 * Given:     item_source  [item_count] source of each truth item; only these are in the mask
 * Returned:  *out  points into the maker, valid until the next call
 * Notes:     A mask pixel belongs to the source with most light in it, if that exceeds the
 *            threshold times the noise of a pixel without sources, sqrt(background_e +
 *            read_noise_e^2), background summed over binned pixels. Sources that might overlap are
 *            rendered separately. */
bst_status bst_plane_maker_render(bst_ctx *ctx, bst_plane_maker *maker, bst_renderer *renderer,
                                  const bst_camera *camera, const bst_render_request *request,
                                  const int *item_source, int item_count,
                                  bst_planes *out) BST_MUST_CHECK;

#endif
