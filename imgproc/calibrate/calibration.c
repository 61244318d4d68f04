#include "imgproc/calibrate/calibration.h"

#include <math.h>
#include <stdlib.h>

#include "sim/io/fits_image.h"
#include "sim/io/psf_fits.h"

/* Reads a calibration image of the sensor's size from a FITS file. */
static bst_status read_map(bst_ctx *ctx, const char *key, const char *path,
                           const bst_camera *camera, float **map) {
    int width, height;
    bst_status status = bst_fits_read_image(ctx, path, &width, &height, map);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%s", key);
    }
    if (width != camera->width_px || height != camera->height_px) {
        free(*map);
        *map = NULL;
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: %s: an image of %d x %d pixels (allowed: the sensor's %lld x %lld)",
                        key, path, width, height, (long long)camera->width_px,
                        (long long)camera->height_px);
    }
    return BST_OK;
}

/* File of a calibration map and the range allowed for its good pixels. */
typedef struct map_file {
    const char *key, *path;
    float above;
    const char *allowed;
} map_file;

/* Checks that every good pixel of a dark or flat map is finite and in range. */
static bst_status check_map(bst_ctx *ctx, const map_file *file, const float *map,
                            const uint8_t *bad, const bst_camera *camera) {
    for (int64_t y = 0, k = 0; y < camera->height_px; y++) {
        for (int64_t x = 0; x < camera->width_px; x++, k++) {
            if (!(bad && bad[k]) && !(isfinite(map[k]) && map[k] > file->above)) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s: pixel (%lld, %lld) is %g (allowed: %s; or mark it in "
                                "bad_pixel_file)",
                                file->key, file->path, (long long)x, (long long)y, (double)map[k],
                                file->allowed);
            }
        }
    }
    return BST_OK;
}

/* Reads the bad-pixel map: any pixel that is not zero is bad. */
static bst_status read_bad(bst_ctx *ctx, const char *path, const bst_camera *camera,
                           const uint8_t **out) {
    float *map;
    BST_TRY(read_map(ctx, "bad_pixel_file", path, camera, &map));
    size_t count = (size_t)camera->width_px * (size_t)camera->height_px;
    uint8_t *bad = malloc(count);
    for (size_t k = 0; bad && k < count; k++) {
        bad[k] = map[k] != 0.0f; /* blank pixels (NAN) are bad too */
    }
    free(map);
    *out = bad;
    return bad ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a bad-pixel map");
}

static bst_status load(bst_ctx *ctx, const bst_imgproc_config *config, const bst_camera *camera,
                       bst_imgproc_maps *maps) {
    float *map;
    if (*config->bad_pixel_file) {
        BST_TRY(read_bad(ctx, config->bad_pixel_file, camera, &maps->bad));
    }
    if (*config->dark_file) {
        const map_file dark = {"dark_file", config->dark_file, -INFINITY, "finite numbers"};
        BST_TRY(read_map(ctx, dark.key, dark.path, camera, &map));
        maps->dark_e_per_s = map;
        BST_TRY(check_map(ctx, &dark, map, maps->bad, camera));
    }
    if (*config->flat_file) {
        const map_file flat = {"flat_file", config->flat_file, 0.0f, "finite numbers above 0"};
        BST_TRY(read_map(ctx, flat.key, flat.path, camera, &map));
        maps->flat = map;
        BST_TRY(check_map(ctx, &flat, map, maps->bad, camera));
    }
    return BST_OK;
}

bst_status bst_calibration_load(bst_ctx *ctx, const bst_imgproc_config *config,
                                const bst_camera *camera, bst_imgproc_maps *out) {
    *out = (bst_imgproc_maps){0};
    bst_status status = load(ctx, config, camera, out);
    if (status != BST_OK) {
        bst_calibration_free(out);
    }
    return status;
}

bst_status bst_calibration_psf(bst_ctx *ctx, const bst_knowledge *knowledge, bst_camera *camera,
                               bst_imgproc_maps *maps) {
    double oversampling;
    const char *path = bst_knowledge_psf_file(knowledge, &oversampling);
    if (!*path) {
        maps->psf = bst_knowledge_psf(knowledge);
        return BST_OK;
    }
    bst_psf_summary summary;
    bst_psf_samples samples;
    BST_TRY(bst_psf_fits_read(ctx, path, oversampling, &summary));
    BST_TRY(bst_psf_fits_samples(ctx, path, oversampling, &samples));
    bst_camera source = {.width_px = camera->width_px,
                         .height_px = camera->height_px,
                         .psf_fwhm_px = camera->psf_fwhm_px,
                         .optics = {.psf = BST_PSF_FILE}};
    const bst_psf_inputs inputs = {.samples = &samples};
    samples.planes = 1;
    bst_status status = bst_psf_create_from(ctx, &source, &inputs, &maps->own_psf);
    free((float *)samples.samples);
    if (status == BST_OK) {
        maps->psf = maps->own_psf;
        camera->psf_fwhm_px = bst_psf_equivalent_fwhm_px(
            maps->psf, 0.5 * (double)(camera->width_px - 1), 0.5 * (double)(camera->height_px - 1));
    }
    return status;
}

void bst_calibration_free(bst_imgproc_maps *maps) {
    free((void *)(uintptr_t)maps->dark_e_per_s);
    free((void *)(uintptr_t)maps->flat);
    free((void *)(uintptr_t)maps->bad);
    bst_psf_free(maps->own_psf);
    *maps = (bst_imgproc_maps){0};
}
