#include "imgproc/calibrate/bad_map.h"

#include <stdlib.h>
#include <string.h>

bst_status bst_bad_map_create(bst_ctx *ctx, const bst_camera *camera, const bst_imgproc_maps *maps,
                              const bst_config_list *list, uint8_t **out) {
    *out = NULL;
    const bst_imgproc_bad_pixel *pixel = list->items;
    if (!maps->bad && list->count == 0) {
        return BST_OK;
    }
    size_t width = (size_t)camera->width_px, height = (size_t)camera->height_px;
    *out = calloc(width, height);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a bad-pixel map");
    }
    if (maps->bad) {
        memcpy(*out, maps->bad, width * height);
    }
    for (int i = 0; i < list->count; i++) {
        if (pixel[i].x < 0 || pixel[i].y < 0 || pixel[i].x >= camera->width_px ||
            pixel[i].y >= camera->height_px) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "bad_pixels/%d: (%lld, %lld) is outside the sensor of %lld x %lld", i,
                            (long long)pixel[i].x, (long long)pixel[i].y,
                            (long long)camera->width_px, (long long)camera->height_px);
        }
        (*out)[(size_t)pixel[i].y * width + (size_t)pixel[i].x] = 1;
    }
    return BST_OK;
}
