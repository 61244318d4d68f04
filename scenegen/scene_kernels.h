/* Kernels of the renderer, each effect's in a program of its own, so that cameras share the
 * compiled programs and only those in use are compiled. Release them with clReleaseKernel. */
#ifndef BST_SCENEGEN_SCENE_KERNELS_H
#define BST_SCENEGEN_SCENE_KERNELS_H

#include <stdbool.h>

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

/* Sets the arguments of a kernel.
 *
 * Given:     values  [count]
 *            bytes   [count] their sizes
 * Errors:    BST_ERR_DEVICE */
bst_status bst_scene_kernel_arguments(bst_ctx *ctx, cl_kernel kernel, const void *const *values,
                                      const size_t *bytes, int count) BST_MUST_CHECK;

/* Kernel of the boxes of all blocks, for tiles that a work-group renders (kernels/block_boxes.cl).
 * Errors: as bst_device_build */
bst_status bst_scene_blocks_kernel(bst_ctx *ctx, bst_device *device, cl_kernel *out) BST_MUST_CHECK;

/* How a kernel renders a tile, and from what. */
typedef struct bst_scene_form {
    bool lanes;   /* a work-group for each tile, otherwise one work-item */
    bool fourier; /* the light is an image */
} bst_scene_form;

/* Kernel of the boxes of nodes (kernels/node_boxes.cl): of the program of the tiles' kernel where
 * each work-item renders a tile from nodes, because another program would cost its start 60 ms of
 * processor time (PoCL 3.1 reads its headers for each).
 *
 * Given:     tile_kernel  of bst_scene_expected_kernel or bst_scene_frame_kernel
 * Errors:    as bst_device_build */
bst_status bst_scene_nodes_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                  cl_kernel tile_kernel, cl_kernel *out) BST_MUST_CHECK;

/* Kernel of noise-free images (kernels/expected.cl or lane_expected.cl).
 *
 * Given:     tile_options  of bst_scene_tile_options
 * Errors:    as bst_device_build */
bst_status bst_scene_expected_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                     const char *tile_options, cl_kernel *out) BST_MUST_CHECK;

/* Kernel of frames (kernels/frame.cl or lane_frame.cl).
 *
 * Given:     options  of bst_scene_tile_options, followed by those of bst_detector_options
 * Errors:    as bst_device_build */
bst_status bst_scene_frame_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                  const char *options, cl_kernel *out) BST_MUST_CHECK;

#endif
