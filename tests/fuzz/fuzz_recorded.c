/* Frames of other programs (FITS) of any bytes, by the shipped keyword map that asks for most: what
 * is accepted has sections within the image, and values that a run can use. */
#include <math.h>
#include <stdlib.h>

#include "sim/io/recorded_frames.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

/* A larger image takes as long as a hundred small files. */
enum { MOST_PIXELS = 1 << 14, MOST_FRAMES = 4 };

static const char map_text[] =
    "{\"boresight_keyword_map\": 1, \"name\": \"fuzz\", \"time\": {\"keyword\": \"DATE-OBS\"},"
    " \"exposure_s\": {\"keyword\": \"EXPOSURE|EXPTIME\"}, \"gain_e_per_dn\": {\"keyword\": "
    "\"GAIN\", \"value\": 1}, \"read_noise_e\": {\"value\": 9}, \"exposure_id\": {\"keyword\": "
    "\"FRAMEID\", \"value\": -1}, \"observer_position_gcrf_m\": {\"x\": {\"keyword\": \"POS[1]\", "
    "\"factor\": 1000, \"value\": 7e6}, \"y\": {\"keyword\": \"POS[2]\", \"value\": 0}, \"z\": "
    "{\"keyword\": \"POSZ\", \"value\": 0}}, \"rate_history\": {\"time\": \"DELT_###\", \"rate\": "
    "\"VEL_###\"}, \"attitude\": \"wcs\", \"image_section\": \"TRIMSEC\", \"bias_section\": "
    "\"BIASSEC\", \"pedestal_dn\": 1000}";

static const bst_keyword_map *the_map(void) {
    static bst_keyword_map map;
    static int is_read;
    if (!is_read) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        const char *path = fuzz_write_file("map.json", map_text, sizeof map_text - 1);
        if (bst_keyword_map_load(&ctx, path, &map) != BST_OK) {
            abort();
        }
        is_read = 1;
    }
    return &map;
}

static void check_values(const bst_keyword_values *v) {
    if (!(v->exposure_s >= 0.0 && isfinite(v->exposure_s)) || !isfinite(v->gain_e_per_dn) ||
        !isfinite(v->position_gcrf_m.x) || !isfinite(v->position_gcrf_m.y) ||
        !isfinite(v->position_gcrf_m.z)) {
        abort();
    }
}

/* Reads a frame and its keywords. */
static void read_frame(bst_recorded_frames *frames, int64_t index,
                       const bst_recorded_options *options) {
    bst_ctx ctx;
    bst_recorded_frame frame;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_recorded_frames_select(&ctx, frames, index, options, &frame);
    FUZZ_CHECK_REASON(ctx, status);
    if (status != BST_OK) {
        return;
    }
    if (frame.width < 1 || frame.height < 1 || frame.width > frame.place.width ||
        frame.height > frame.place.height) {
        abort();
    }
    bst_quat q;
    double scale, trend, sigma;
    bst_frame_source *source = bst_recorded_frames_source(frames);
    if (bst_keyword_wcs(source, &frame.place, options->flip_rows, &q, &scale) &&
        !(scale > 0.0 && isfinite(scale) && isfinite(q.x + q.y + q.z + q.w))) {
        abort();
    }
    if (options->map) {
        check_values(&frame.values);
        bst_keyword_rate_trend(&ctx, options->map, source, &frame.place, frame.values.exposure_s,
                               &trend, &sigma);
    }
    if ((int64_t)frame.place.width * frame.place.height > MOST_PIXELS) {
        return;
    }
    const float *pixels;
    static uint16_t dn[MOST_PIXELS];
    status = bst_recorded_frames_pixels(&ctx, frames, options, &frame, &pixels);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK && bst_recorded_counts(&ctx, pixels, (size_t)(frame.width * frame.height),
                                                options->map, dn, NULL, NULL) != BST_OK) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const bst_keyword_map *map = the_map();
    const char *paths[] = {fuzz_write_file("frame.fits", data, bytes)};
    bst_ctx ctx;
    bst_recorded_frames *frames;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_recorded_frames_open(&ctx, paths, 1, map, &frames);
    FUZZ_CHECK_REASON(ctx, status);
    for (int64_t i = 0;
         status == BST_OK && i < bst_recorded_frames_count(frames) && i < MOST_FRAMES; i++) {
        read_frame(frames, i, &(bst_recorded_options){.map = map, .flip_rows = i % 2 == 1});
        read_frame(frames, i, &(bst_recorded_options){.map = NULL});
    }
    bst_recorded_frames_close(frames);
    return 0;
}
