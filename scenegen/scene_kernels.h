/* Kernels of the renderer, each effect's in a program of its own, so that cameras share the
 * compiled programs and only those in use are compiled. Release them with clReleaseKernel. */
#ifndef BST_SCENEGEN_SCENE_KERNELS_H
#define BST_SCENEGEN_SCENE_KERNELS_H

#include "sim/device/device.h"

/* Builds a program, or takes one already built, and creates one of its kernels.
 *
 * Given:     device   keeps the program
 *            sources  [count]
 * Returned:  *out     release it with clReleaseKernel
 * Errors:    as bst_device_build */
bst_status bst_scene_kernel(bst_ctx *ctx, bst_device *device,
                            const bst_device_kernel_source *const *sources, int count,
                            const char *options, const char *name, cl_kernel *out) BST_MUST_CHECK;

/* Kernel of the boxes of nodes (kernels/node_boxes.cl). Errors: as bst_device_build. */
bst_status bst_scene_nodes_kernel(bst_ctx *ctx, bst_device *device, cl_kernel *out) BST_MUST_CHECK;

/* Kernel of noise-free images (kernels/expected.cl).
 *
 * Given:     tile_options  of bst_scene_tile_options
 * Errors:    as bst_device_build */
bst_status bst_scene_expected_kernel(bst_ctx *ctx, bst_device *device, const char *tile_options,
                                     cl_kernel *out) BST_MUST_CHECK;

/* Kernel of frames (kernels/frame.cl).
 *
 * Given:     options  of bst_scene_tile_options, followed by those of bst_detector_options
 * Errors:    as bst_device_build */
bst_status bst_scene_frame_kernel(bst_ctx *ctx, bst_device *device, const char *options,
                                  cl_kernel *out) BST_MUST_CHECK;

#endif
