#include "scenegen/scene_kernels.h"

#include <assert.h>

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

bst_status bst_scene_kernel_arguments(bst_ctx *ctx, cl_kernel kernel, const void *const *values,
                                      const size_t *bytes, int count) {
    for (int i = 0; i < count; i++) {
        BST_TRY(bst_device_check(ctx, clSetKernelArg(kernel, (cl_uint)i, bytes[i], values[i]),
                                 "setting a kernel argument"));
    }
    return BST_OK;
}

static bool holds_boxes(bst_scene_form form) {
    return !form.lanes && !form.fourier;
}

bst_status bst_scene_nodes_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                  cl_kernel tile_kernel, cl_kernel *out) {
    static const bst_device_kernel_source *const sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes, &bst_kernel_nodes, &bst_kernel_node_boxes};
    static const char name[] = "bst_scene_nodes";
    if (!holds_boxes(form)) {
        return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources,
                                "-cl-std=CL1.2", name, out);
    }
    cl_program program;
    BST_TRY(bst_device_check(
        ctx,
        clGetKernelInfo(tile_kernel, CL_KERNEL_PROGRAM, sizeof program, (void *)&program, NULL),
        "asking for the program of the tiles"));
    cl_int code;
    *out = clCreateKernel(program, name, &code);
    return bst_device_check(ctx, code, name);
}

bst_status bst_scene_blocks_kernel(bst_ctx *ctx, bst_device *device, cl_kernel *out) {
    static const bst_device_kernel_source *const sources[] = {
        &bst_kernel_scene_shared, &bst_kernel_lanes, &bst_kernel_nodes, &bst_kernel_block_boxes};
    return bst_scene_kernel(ctx, device, sources, sizeof sources / sizeof *sources,
                            "-cl-std=CL1.2 -DONE_LANE", "bst_scene_block_boxes", out);
}

enum { MOST_SOURCES = 24 };

/* Sources of a program. */
typedef struct program {
    const bst_device_kernel_source *sources[MOST_SOURCES];
    int count;
} program;

static void add(program *p, const bst_device_kernel_source *const *sources, size_t count) {
    for (size_t i = 0; i < count; i++) {
        assert(p->count < MOST_SOURCES);
        p->sources[p->count++] = sources[i];
    }
}

#define ADD(program, ...)                                                                \
    do {                                                                                 \
        const bst_device_kernel_source *const list_of_sources[] = {__VA_ARGS__};         \
        add(program, list_of_sources, sizeof list_of_sources / sizeof *list_of_sources); \
    } while (0)

/* Sources of the tile kernels' light; those of a kernel follow. */
static program light_sources(bst_scene_form form) {
    program p = {.count = 0};
    ADD(&p, &bst_kernel_scene_shared, &bst_kernel_lanes);
    if (form.lanes) {
        ADD(&p, &bst_kernel_random, &bst_kernel_chunk);
    }
    ADD(&p, &bst_kernel_nodes);
    if (holds_boxes(form)) {
        ADD(&p, &bst_kernel_node_boxes);
    }
    ADD(&p, &bst_kernel_profiles);
    if (!form.lanes) {
        ADD(&p, &bst_kernel_block_search, &bst_kernel_splat, &bst_kernel_light);
    }
    ADD(&p, &bst_kernel_vignetting, &bst_kernel_background, &bst_kernel_tile);
    if (form.lanes && !form.fourier) {
        ADD(&p, &bst_kernel_gather);
    }
    if (form.lanes) {
        ADD(&p, &bst_kernel_lane_tile);
    }
    return p;
}

bst_status bst_scene_expected_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                     const char *tile_options, cl_kernel *out) {
    program p = light_sources(form);
    if (form.lanes) {
        ADD(&p, &bst_kernel_lane_expected);
    } else {
        ADD(&p, &bst_kernel_expected);
    }
    return bst_scene_kernel(ctx, device, p.sources, p.count, tile_options, "bst_scene_expected",
                            out);
}

bst_status bst_scene_frame_kernel(bst_ctx *ctx, bst_device *device, bst_scene_form form,
                                  const char *options, cl_kernel *out) {
    program p = light_sources(form);
    if (!form.lanes) {
        ADD(&p, &bst_kernel_random, &bst_kernel_chunk);
    }
    ADD(&p, &bst_kernel_noise_law, &bst_kernel_read_tail);
    if (form.lanes) {
        ADD(&p, &bst_kernel_lane_tail);
    }
    ADD(&p, &bst_kernel_detector, &bst_kernel_pixels, &bst_kernel_store_dn);
    if (form.lanes) {
        ADD(&p, &bst_kernel_lane_frame);
    } else {
        ADD(&p, &bst_kernel_frame);
    }
    return bst_scene_kernel(ctx, device, p.sources, p.count, options, "bst_scene_frame", out);
}
