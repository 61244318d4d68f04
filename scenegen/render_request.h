/* Checks of cameras and render requests, and their conversion to kernel parameters. */
#ifndef BST_SCENEGEN_RENDER_REQUEST_H
#define BST_SCENEGEN_RENDER_REQUEST_H

#include "scenegen/kernels/scene_shared.h"
#include "scenegen/renderer.h"
#include "sim/world/scene/skylight.h"

/* Checks that a camera can be rendered; BST_ERR_ARGUMENT as in bst_renderer_create. */
bst_status bst_render_camera_check(bst_ctx *ctx, const bst_camera *camera) BST_MUST_CHECK;

/* Checks window, binning, background and track of a request against bst_render_request. Errors:
 * BST_ERR_ARGUMENT. */
bst_status bst_render_request_check(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_render_request *request) BST_MUST_CHECK;

/* Exposure time of each pixel, s. */
double bst_render_exposure_s(const bst_render_request *request);
/* Background map of a request, or a zero map. */
const bst_skylight_map *bst_render_background(const bst_render_request *request);
/* Kernel parameters of a frame.
 *
 * Given:     fixed    parameters that are the camera's, equal in all frames
 *            sources  number of rendered sources */
bst_kernel_frame_params bst_render_params(const bst_kernel_frame_params *fixed,
                                          const bst_camera *camera,
                                          const bst_renderer_options *options,
                                          const bst_render_request *request, int sources);

#endif
