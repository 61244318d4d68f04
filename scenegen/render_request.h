/* What the renderer takes: cameras that can be drawn, requests that fit the camera. */
#ifndef BST_SCENEGEN_RENDER_REQUEST_H
#define BST_SCENEGEN_RENDER_REQUEST_H

#include "scenegen/renderer.h"

/* BST_ERR_ARGUMENT as bst_renderer_create says. */
bst_status bst_render_camera_check(bst_ctx *ctx, const bst_camera *camera) BST_MUST_CHECK;

/* BST_ERR_ARGUMENT where window, binning, background or track are not what bst_render_request says.
 */
bst_status bst_render_request_check(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_render_request *request) BST_MUST_CHECK;

#endif
