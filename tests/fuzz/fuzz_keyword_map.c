/* Keyword maps (JSON) of any bytes. What is accepted reads the keywords of a frame or says why
 * not: maps that are wrong for their frames, too. */
#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/recorded_frames.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { BLOCK = 2880 };

/* A frame of 3 x 2 px with keywords of the kinds that maps ask for. */
static bst_recorded_frames *the_frame(void) {
    static const char *const cards[] = {"SIMPLE  =                    T",
                                        "BITPIX  =                   16",
                                        "NAXIS   =                    2",
                                        "NAXIS1  =                    3",
                                        "NAXIS2  =                    2",
                                        "DATE-OBS= '2024-08-26T17:45:45.582'",
                                        "TIME-OBS= '17:45:45'",
                                        "MJD     =      60548.740110903",
                                        "EXPTIME =                  2.5",
                                        "GAIN    = '1.10    '",
                                        "POS1    =                6.5D3",
                                        "TEXT    = 'no number'",
                                        "DELT_000=                  0.0",
                                        "DELT_001=                  0.5",
                                        "DELT_002=                  1.0",
                                        "DELT_003=                  1.5",
                                        "VEL_000 = '1.0 2.0 3.0'",
                                        "VEL_001 = '1.0 2.1 3.0'",
                                        "VEL_002 = '1.0 2.2 3.0'",
                                        "VEL_003 = '1.0 2.2 3.1'",
                                        "TRIMSEC = '[2:3,1:2]'",
                                        "BIASSEC = '[1:1,1:2]'",
                                        "END"};
    static bst_recorded_frames *frames;
    if (!frames) {
        static char file[2 * BLOCK];
        memset(file, ' ', BLOCK);
        for (size_t i = 0; i < sizeof cards / sizeof *cards; i++) {
            memcpy(file + 80 * i, cards[i], strlen(cards[i]));
        }
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        const char *path = fuzz_write_file("frame.fits", file, sizeof file);
        if (bst_recorded_frames_open(&ctx, &path, 1, NULL, &frames) != BST_OK) {
            abort();
        }
    }
    return frames;
}

static void close_frame(void) {
    bst_recorded_frames_close(the_frame());
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    static int is_open;
    bst_recorded_frames *frames = the_frame();
    if (!is_open) {
        is_open = atexit(close_frame) == 0;
    }
    const char *path = fuzz_write_file("map.json", data, bytes);
    bst_ctx ctx;
    bst_keyword_map map;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_keyword_map_load(&ctx, path, &map);
    FUZZ_CHECK_REASON(ctx, status);
    if (status != BST_OK) {
        return 0;
    }
    struct cJSON *camera;
    status = bst_keyword_map_camera(&ctx, path, &camera);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        cJSON_Delete(camera);
    }
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_recorded_frame frame;
    const bst_recorded_options options = {.map = &map};
    status = bst_recorded_frames_select(&ctx, frames, 0, &options, &frame);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        double trend, sigma;
        const float *pixels;
        uint16_t dn[6];
        bst_keyword_rate_trend(&ctx, &map, bst_recorded_frames_source(frames), &frame.place,
                               frame.values.exposure_s, &trend, &sigma);
        if (bst_recorded_frames_pixels(&ctx, frames, &options, &frame, &pixels) != BST_OK ||
            bst_recorded_counts(&ctx, pixels, (size_t)(frame.width * frame.height), &map, dn, NULL,
                                NULL) != BST_OK) {
            abort();
        }
    }
    return 0;
}
