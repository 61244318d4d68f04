/* What the renderer takes: cameras that can be drawn, requests that fit the camera, and what the
 * kernels get of them. */
#ifndef BST_SCENEGEN_RENDER_REQUEST_H
#define BST_SCENEGEN_RENDER_REQUEST_H

#include "scenegen/kernels/scene_shared.h"
#include "scenegen/renderer.h"
#include "sim/world/scene/skylight.h"

/* BST_ERR_ARGUMENT as bst_renderer_create says. */
bst_status bst_render_camera_check(bst_ctx *ctx, const bst_camera *camera) BST_MUST_CHECK;

/* BST_ERR_ARGUMENT where window, binning, background or track are not what bst_render_request says.
 */
bst_status bst_render_request_check(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_render_request *request) BST_MUST_CHECK;

/* Of each pixel. */
double bst_render_exposure_s(const bst_render_request *request);
/* The request's map of the background, or one that adds nothing. */
const bst_skylight_map *bst_render_background(const bst_render_request *request);
/* sources: that are drawn. */
bst_kernel_frame_params bst_render_params(const bst_camera *camera,
                                          const bst_renderer_options *options,
                                          const bst_render_request *request, int sources);

#endif
