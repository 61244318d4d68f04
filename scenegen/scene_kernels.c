#include "scenegen/scene_kernels.h"

#include "bst_scenegen_kernels.h"

bst_status bst_scene_kernel(bst_ctx *ctx, bst_device *device,
                            const bst_device_kernel_source *const *sources, int count,
                            const char *options, const char *name, cl_kernel *out) {
    cl_program program;
    cl_int code;
    BST_TRY(bst_device_build(ctx, device, sources, count, options, &program));
    *out = clCreateKernel(program, name, &code);
    clReleaseProgram(program); /* the kernel holds a reference */
    return bst_device_check(ctx, code, name);
}

bst_status bst_scene_nodes_kernel(bst_ctx *ctx, bst_device *device, cl_kernel *out) {
    static const bst_device_kernel_source *const sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes, &bst_kernel_nodes, &bst_kernel_node_boxes};
    return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources, "-cl-std=CL1.2",
                            "bst_scene_nodes", out);
}

/* Sources of the tile kernels' light; those of a kernel follow. */
#define LIGHT_SOURCES                                                                         \
    &bst_kernel_scene_shared, &bst_kernel_lanes, &bst_kernel_nodes, &bst_kernel_block_search, \
        &bst_kernel_splat, &bst_kernel_light, &bst_kernel_vignetting, &bst_kernel_background, \
        &bst_kernel_tile

bst_status bst_scene_expected_kernel(bst_ctx *ctx, bst_device *device, const char *tile_options,
                                     cl_kernel *out) {
    static const bst_device_kernel_source *const sources[] = {LIGHT_SOURCES, &bst_kernel_expected};
    return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources, tile_options,
                            "bst_scene_expected", out);
}

bst_status bst_scene_frame_kernel(bst_ctx *ctx, bst_device *device, const char *options,
                                  cl_kernel *out) {
    static const bst_device_kernel_source *const sources[] = {
        LIGHT_SOURCES,         &bst_kernel_random,    &bst_kernel_chunk,
        &bst_kernel_noise_law, &bst_kernel_read_tail, &bst_kernel_detector,
        &bst_kernel_pixels,    &bst_kernel_store_dn,  &bst_kernel_frame};
    return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources, options,
                            "bst_scene_frame", out);
}
