/* PNG and TIFF frames with a side table, of any bytes: the text before the first zero byte is the
 * table, what follows is the picture that it may name; a picture alone has no table. What is
 * accepted has finite values and sizes within limits; the rest is refused with a reason. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/recorded_frames.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { MOST_PIXELS = 1 << 14, MOST_FRAMES = 4, MOST_BYTES = 1 << 16 };

static const char *const map_texts[] = {
    "{\"boresight_keyword_map\": 1, \"name\": \"fuzz\", \"time\": {\"keyword\": \"time|t\"},"
    " \"exposure_s\": {\"keyword\": \"exposure\", \"value\": 1}, \"gain_e_per_dn\": {\"keyword\":"
    " \"gain\", \"value\": 1}, \"pixel_scale_arcsec\": {\"value\": 5}, \"image_section\": \"part\","
    " \"bias_section\": \"bias\", \"attitude\": \"direction\", \"first_row\": \"bottom\"}",
    "{\"boresight_keyword_map\": 1, \"name\": \"fuzz\", \"time\": {\"keyword\": \"t\", \"format\":"
    " \"unix\"}, \"exposure_s\": {\"value\": 1}, \"pixel_scale_arcsec\": {\"value\": 5},"
    " \"colour\": \"mean\", \"attitude\": \"quaternion\"}"};

static const bst_keyword_map *the_map(int which) {
    static bst_keyword_map maps[2];
    static int is_read[2];
    if (!is_read[which]) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        const char *path = fuzz_write_file("map.json", map_texts[which], strlen(map_texts[which]));
        if (bst_keyword_map_load(&ctx, path, &maps[which]) != BST_OK) {
            abort();
        }
        is_read[which] = 1;
    }
    return &maps[which];
}

/* CRC-32 of ISO/IEC 15948, annex D. */
static uint32_t crc_of(const uint8_t *bytes, size_t count) {
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) {
            crc = crc & 1 ? 0xedb88320U ^ crc >> 1 : crc >> 1;
        }
    }
    return ~crc;
}

/* Makes the check sums of a PNG file right, so that what is behind them is reached. */
static void mend_sums(uint8_t *png, size_t bytes) {
    for (size_t at = 8; at + 12 <= bytes;) {
        size_t length = (size_t)png[at] << 24 | (size_t)png[at + 1] << 16 |
                        (size_t)png[at + 2] << 8 | png[at + 3];
        if (length > bytes - at - 12) {
            return;
        }
        uint32_t crc = crc_of(png + at + 4, length + 4);
        for (int i = 0; i < 4; i++) {
            png[at + 8 + length + (size_t)i] = (uint8_t)(crc >> (24 - 8 * i));
        }
        at += 12 + length;
    }
}

/* Reads a frame. */
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
    if (frame.width < 1 || frame.height < 1 || frame.width > 32768 || frame.height > 32768 ||
        (options->map && !isfinite(frame.values.exposure_s))) {
        abort();
    }
    if (options->map) {
        bst_quat q;
        bool has;
        status = bst_keyword_attitude(&ctx, options->map, bst_recorded_frames_source(frames),
                                      &frame.place, false, &has, &q);
        FUZZ_CHECK_REASON(ctx, status);
        if (status == BST_OK && has && !isfinite(q.x + q.y + q.z + q.w)) {
            abort();
        }
    }
    if (status != BST_OK || (int64_t)frame.place.width * frame.place.height > MOST_PIXELS) {
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

/* Reads all frames of a file. */
static void read_file(const char *path, const bst_keyword_map *map, bool values) {
    bst_ctx ctx;
    bst_recorded_frames *frames;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_recorded_frames_open(&ctx, &path, 1, map, &frames);
    FUZZ_CHECK_REASON(ctx, status);
    for (int64_t i = 0;
         status == BST_OK && i < bst_recorded_frames_count(frames) && i < MOST_FRAMES; i++) {
        read_frame(frames, i, &(bst_recorded_options){.map = values ? map : NULL});
    }
    bst_recorded_frames_close(frames);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    static uint8_t picture[MOST_BYTES];
    if (bytes < 1 || bytes > MOST_BYTES) {
        return 0;
    }
    const uint8_t *zero = memchr(data, 0, bytes);
    size_t text = bst_image_file_begins(data, bytes) || !zero ? 0 : (size_t)(zero - data) + 1;
    bool table = text > 0 || !bst_image_file_begins(data, bytes);
    const bst_keyword_map *map = the_map(data[bytes - 1] & 1);
    memcpy(picture, data + text, bytes - text);
    mend_sums(picture, bytes - text);
    const char *path = fuzz_write_file("a.png", picture, bytes - text);
    if (table) {
        path = fuzz_write_file("table.csv", data, text > 0 ? text - 1 : bytes);
    }
    read_file(path, map, table);
    return 0;
}
