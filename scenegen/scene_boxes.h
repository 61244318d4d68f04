/* Boxes by which the tiles of a frame find their nodes: of blocks, of sources or groups of blocks,
 * and of groups of these (kernels/node_boxes.cl, block_boxes.cl). */
#ifndef BST_SCENEGEN_SCENE_BOXES_H
#define BST_SCENEGEN_SCENE_BOXES_H

#include "scenegen/device_array.h"
#include "scenegen/kernels/scene_shared.h"
#include "scenegen/scene_kernels.h"

typedef struct bst_scene_boxes {
    bst_scene_form form;
    bst_device *device;
    cl_context context;
    uint64_t most_bytes; /* largest buffer of the device */
    cl_kernel kernel;    /* NULL before bst_scene_boxes_prepare */
    bst_device_array block, source, group;
} bst_scene_boxes;

/* Boxes for tiles of a form, without kernel and buffers.
 *
 * Given:     device      must outlive the boxes
 *            most_bytes  largest buffer of the device
 * Returned:  to be cleared with bst_scene_boxes_clear */
bst_scene_boxes bst_scene_boxes_init(bst_device *device, bst_scene_form form, uint64_t most_bytes);
/* Builds the kernel, if it is not there yet.
 *
 * Given:     tile_kernel  of the tiles, which find their nodes by the boxes
 * Errors:    as bst_device_build */
bst_status bst_scene_boxes_prepare(bst_ctx *ctx, bst_scene_boxes *boxes,
                                   cl_kernel tile_kernel) BST_MUST_CHECK;
/* Releases kernel and buffers. */
void bst_scene_boxes_clear(bst_scene_boxes *boxes);

/* Sources and nodes of a frame. */
typedef struct bst_scene_boxes_input {
    const bst_kernel_node_params *nodes;
    int count, blocks, boxes; /* of bst_scene_plan */
    cl_mem sources, table;
    cl_kernel tile_kernel;
} bst_scene_boxes_input;

/* Enqueues the kernel, built if it is not there yet, with room for its results.
 *
 * Errors:    BST_ERR_DEVICE */
bst_status bst_scene_boxes_enqueue(bst_ctx *ctx, bst_scene_boxes *boxes, cl_command_queue queue,
                                   const bst_scene_boxes_input *input) BST_MUST_CHECK;

#endif
