#include "scenegen/tiles.h"

#include <stdbool.h>

#include "scenegen/kernels/scene_shared.h"

/* Rows of a tile that a work-group renders: on a GPU, and at most (work-items of a group of the
 * least capable devices: 256). */
enum { GPU_ROWS = 8, MOST_ROWS = 16 };

bst_status bst_tiles_choose(bst_ctx *ctx, const bst_device *device, bst_renderer_options *options,
                            uint64_t *most_bytes) {
    cl_device_type type = 0;
    cl_ulong local_bytes = 0, most = 0;
    BST_TRY(bst_device_check(
        ctx, clGetDeviceInfo(bst_device_id(device), CL_DEVICE_TYPE, sizeof type, &type, NULL),
        "asking for the device's type"));
    BST_TRY(bst_device_check(ctx,
                             clGetDeviceInfo(bst_device_id(device), CL_DEVICE_LOCAL_MEM_SIZE,
                                             sizeof local_bytes, &local_bytes, NULL),
                             "asking for the device's local memory"));
    BST_TRY(bst_device_check(ctx,
                             clGetDeviceInfo(bst_device_id(device), CL_DEVICE_MAX_MEM_ALLOC_SIZE,
                                             sizeof most, &most, NULL),
                             "asking for the device's largest buffer"));
    *most_bytes = most;
    if (options->tile_width == 0) {
        bool large = (type & CL_DEVICE_TYPE_CPU) && local_bytes >= 256 * 1024;
        bool gpu = (type & CL_DEVICE_TYPE_GPU) != 0;
        options->tile_width = large ? 256 : 64;
        options->tile_height = large ? 128 : gpu ? GPU_ROWS : 4;
        options->group = large ? 1 : gpu ? 0 : 16;
    }
    bool lanes = options->group == 0;
    size_t need = (size_t)(options->tile_width + 16) *
                  (size_t)(options->tile_height + BST_SPARE_ROWS) * sizeof(float) *
                  (size_t)options->group;
    if (options->tile_width < 64 || options->tile_width % 64 != 0 || options->tile_height < 1 ||
        options->group < 0 || need > local_bytes ||
        (lanes && (options->tile_width != 64 || options->tile_height > MOST_ROWS))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "tiles of %d x %d pixels in groups of %d need %zu bytes of local memory "
                        "(the device has %llu) and a width that is a multiple of 64, or, in groups "
                        "of 0, of 64 and at most %d rows",
                        options->tile_width, options->tile_height, options->group, need,
                        (unsigned long long)local_bytes, MOST_ROWS);
    }
    return BST_OK;
}
