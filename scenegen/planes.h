/* Noise-free planes of an exposure and its masks, with the renderer's own light, in the frame's own
 * pixels: of those that are binned light and background are added. */
#ifndef BST_SCENEGEN_PLANES_H
#define BST_SCENEGEN_PLANES_H

#include "scenegen/renderer.h"

typedef struct bst_plane_maker bst_plane_maker;

/* Makes room for windows of up to width x height pixels. `planes`: bit k for the bst_plane k.
 * threshold_sigma: least light of a pixel of the mask. */
bst_status bst_plane_maker_create(bst_ctx *ctx, uint32_t planes, int width, int height,
                                  double threshold_sigma, bst_plane_maker **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_plane_maker_free(bst_plane_maker *maker);

/* Renders the planes of `request` (that of saturation needs a renderer with saturation_flags),
 * whose sources are stars first and then objects; it must be the renderer's latest. Afterwards the
 * renderer's statistics and peaks are those of other requests. item_source: [item_count] source of
 * each item of the truth; only these are in the mask.
 *
 * The mask: a pixel belongs to the source that gives most light there, where that is more than the
 * threshold times the noise of a pixel without sources, sqrt(background_e + read_noise_e^2), with
 * the background of all pixels that are added.
 * Sources that might touch are rendered apart, so that the light is each one's own. *out points
 * into the maker, until the next call. */
bst_status bst_plane_maker_render(bst_ctx *ctx, bst_plane_maker *maker, bst_renderer *renderer,
                                  const bst_camera *camera, const bst_render_request *request,
                                  const int *item_source, int item_count,
                                  bst_planes *out) BST_MUST_CHECK;

#endif
