#include "scenegen/scene_boxes.h"

#include "scenegen/scene_plan.h"

bst_scene_boxes bst_scene_boxes_init(bst_device *device, bst_scene_form form, uint64_t most_bytes) {
    return (bst_scene_boxes){.form = form,
                             .device = device,
                             .context = bst_device_context(device),
                             .most_bytes = most_bytes};
}

/* Boxes of all blocks, for the search by work-groups (kernels/gather.cl). */
static bool are_of_blocks(const bst_scene_boxes *b) {
    return b->form.lanes && !b->form.fourier;
}

bst_status bst_scene_boxes_prepare(bst_ctx *ctx, bst_scene_boxes *b, cl_kernel tile_kernel) {
    if (b->kernel) {
        return BST_OK;
    }
    if (are_of_blocks(b)) {
        return bst_scene_blocks_kernel(ctx, b->device, &b->kernel);
    }
    return bst_scene_nodes_kernel(ctx, b->device, b->form, tile_kernel, &b->kernel);
}

void bst_scene_boxes_clear(bst_scene_boxes *b) {
    cl_mem buffers[] = {b->block.buffer, b->source.buffer, b->group.buffer};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        if (buffers[i]) {
            clReleaseMemObject(buffers[i]);
        }
    }
    if (b->kernel) {
        clReleaseKernel(b->kernel);
    }
    *b = (bst_scene_boxes){.kernel = NULL};
}

static bst_status grow(bst_ctx *ctx, bst_scene_boxes *b, bst_device_array *g, size_t bytes) {
    return bst_device_array_reserve(ctx, b->context, b->most_bytes, g, bytes);
}

static size_t groups_of(size_t items) {
    return (items + BST_BLOCK - 1) / BST_BLOCK;
}

/* Boxes of all blocks, in order. */
static bst_status enqueue_blocks(bst_ctx *ctx, bst_scene_boxes *b, cl_command_queue queue,
                                 const bst_scene_boxes_input *in) {
    size_t blocks = (size_t)in->blocks, groups = groups_of(blocks), fars = groups_of(groups);
    /* the blocks' boxes are followed by the number of each block's source */
    BST_TRY(grow(ctx, b, &b->block, blocks * (BST_BOX_BYTES + sizeof(cl_int))));
    BST_TRY(grow(ctx, b, &b->source, groups * BST_BOX_BYTES));
    BST_TRY(grow(ctx, b, &b->group, fars * BST_BOX_BYTES));
    if (in->count == 0) {
        return BST_OK;
    }
    const void *values[] = {in->nodes,  &in->sources,     &in->count,        &in->blocks,
                            &in->table, &b->block.buffer, &b->source.buffer, &b->group.buffer};
    const size_t m = sizeof(cl_mem), n = sizeof(cl_int);
    const size_t bytes[] = {sizeof *in->nodes, m, n, n, m, m, m, m};
    BST_TRY(bst_scene_kernel_arguments(ctx, b->kernel, values, bytes, 8));
    size_t global = fars * BST_BOX_GROUP, local = BST_BOX_GROUP;
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(queue, b->kernel, 1, NULL, &global, &local, 0, NULL, NULL),
        "placing the scene's blocks");
}

bst_status bst_scene_boxes_enqueue(bst_ctx *ctx, bst_scene_boxes *b, cl_command_queue queue,
                                   const bst_scene_boxes_input *in) {
    BST_TRY(bst_scene_boxes_prepare(ctx, b, in->tile_kernel));
    if (are_of_blocks(b)) {
        return enqueue_blocks(ctx, b, queue, in);
    }
    size_t groups = groups_of((size_t)in->count), bytes_of_group = BST_BLOCK * BST_BOX_BYTES;
    BST_TRY(grow(ctx, b, &b->block, (size_t)in->boxes * bytes_of_group));
    BST_TRY(grow(ctx, b, &b->source, groups * bytes_of_group));
    BST_TRY(grow(ctx, b, &b->group, groups_of(groups) * bytes_of_group));
    if (in->count == 0) {
        return BST_OK;
    }
    const void *values[] = {in->nodes,        &in->sources,      &in->count,      &in->table,
                            &b->block.buffer, &b->source.buffer, &b->group.buffer};
    const size_t m = sizeof(cl_mem);
    const size_t bytes[] = {sizeof *in->nodes, m, sizeof in->count, m, m, m, m};
    BST_TRY(bst_scene_kernel_arguments(ctx, b->kernel, values, bytes, 7));
    size_t global = groups * BST_BLOCK, local = BST_BLOCK;
    return bst_device_check(
        ctx, clEnqueueNDRangeKernel(queue, b->kernel, 1, NULL, &global, &local, 0, NULL, NULL),
        "placing the scene's nodes");
}
