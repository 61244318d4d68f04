/* The reader of calibration maps (dark, flat, bad pixels; FITS) of a 4 x 3 px sensor on any bytes.
 * What is accepted has values that frames can be corrected by. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "imgproc/calibrate/calibration.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { WIDTH = 4, HEIGHT = 3, MAPS = 3 };

static void check(const bst_imgproc_maps *maps) {
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        if (maps->bad && maps->bad[k]) {
            continue;
        }
        if ((maps->dark_e_per_s && !isfinite(maps->dark_e_per_s[k])) ||
            (maps->flat && !(isfinite(maps->flat[k]) && maps->flat[k] > 0.0f))) {
            abort();
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("map.fits", data, bytes);
    const bst_camera camera = {.width_px = WIDTH, .height_px = HEIGHT};
    bool all = true;
    for (int k = 0; k <= MAPS; k++) { /* each kind alone; together if each is accepted */
        int which = k < MAPS ? 1 << k : (1 << MAPS) - 1;
        if (k == MAPS && !all) {
            break;
        }
        bst_imgproc_config config = {0};
        snprintf(config.dark_file, sizeof config.dark_file, "%s", which & 1 ? path : "");
        snprintf(config.flat_file, sizeof config.flat_file, "%s", which & 2 ? path : "");
        snprintf(config.bad_pixel_file, sizeof config.bad_pixel_file, "%s", which & 4 ? path : "");
        bst_ctx ctx;
        bst_imgproc_maps maps;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_status status = bst_calibration_load(&ctx, &config, &camera, &maps);
        FUZZ_CHECK_REASON(ctx, status);
        all &= status == BST_OK;
        if (status == BST_OK) {
            check(&maps);
            bst_calibration_free(&maps);
        }
    }
    return 0;
}
