#include "sim/io/recorded_frames.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/compare.h"
#include "sim/io/recorded_files_internal.h"

struct bst_recorded_frames {
    bst_recorded_files files;
    int64_t *first; /* [files.count + 1] number of each file's first frame; the last: of all */
    bst_frame_source *source;
    bst_keyword_map map; /* of the options below */
    bst_frame_source_options options;
    int open; /* index of the open file; -1: none */
    bst_frame_place place;
    int box[4], bias[4]; /* x0, y0, width, height; width 0: none */
    float *image, *used;
    size_t image_room, used_room;
};

/* Opens a file unless it is open. */
static bst_status open_file(bst_ctx *ctx, bst_recorded_frames *f, int index) {
    if (f->open == index) {
        return BST_OK;
    }
    bst_frame_source_close(f->source);
    f->source = NULL;
    f->open = -1;
    BST_TRY(bst_frame_source_open(ctx, f->files.paths[index], &f->options, &f->source));
    f->open = index;
    return BST_OK;
}

/* Counts the frames of all files. */
static bst_status count_frames(bst_ctx *ctx, bst_recorded_frames *f) {
    f->first = calloc((size_t)f->files.count + 1, sizeof *f->first);
    if (!f->first) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d files", f->files.count);
    }
    for (int i = 0; i < f->files.count; i++) {
        BST_TRY(open_file(ctx, f, i));
        f->first[i + 1] = f->first[i] + bst_frame_source_count(f->source);
    }
    return BST_OK;
}

bst_status bst_recorded_frames_open(bst_ctx *ctx, const char *const *paths, int count,
                                    const bst_keyword_map *map, bst_recorded_frames **out) {
    assert(paths && count > 0 && out);
    *out = NULL;
    bst_recorded_frames *f = calloc(1, sizeof *f);
    if (!f) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for recorded frames");
    }
    f->open = -1;
    f->options =
        (bst_frame_source_options){.columns = {BST_FRAME_FILE_COLUMNS, BST_FRAME_PAGE_COLUMNS}};
    if (map) {
        f->map = *map;
        f->options = bst_keyword_map_source(&f->map);
    }
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        status = bst_recorded_files_add(ctx, &f->files, paths[i]);
    }
    if (status == BST_OK) {
        status = count_frames(ctx, f);
    }
    if (status != BST_OK) {
        bst_recorded_frames_close(f);
        return status;
    }
    *out = f;
    return BST_OK;
}

void bst_recorded_frames_close(bst_recorded_frames *f) {
    if (f) {
        bst_frame_source_close(f->source);
        bst_recorded_files_free(&f->files);
        free(f->first);
        free(f->image);
        free(f->used);
        free(f);
    }
}

int64_t bst_recorded_frames_count(const bst_recorded_frames *f) {
    return f->first[f->files.count];
}

int bst_recorded_frames_files(const bst_recorded_frames *f) {
    return f->files.count;
}

const char *bst_recorded_frames_file(const bst_recorded_frames *f, int index) {
    assert(index >= 0 && index < f->files.count);
    return f->files.paths[index];
}

bool bst_recorded_flips(const bst_recorded_options *options) {
    bool bottom = options->map && options->map->first_row == BST_KEYWORD_BOTTOM;
    return options->flip_rows != bottom;
}

bst_status bst_recorded_frame_fail(bst_ctx *ctx, const char *path, const bst_frame_place *place,
                                   bst_status status) {
    char where[BST_FRAME_WHERE_TEXT];
    return bst_fail_prefix(ctx, status, "%s", bst_frame_where(path, place, where));
}

bst_frame_source *bst_recorded_frames_source(bst_recorded_frames *f) {
    return f->source;
}

bst_status bst_recorded_frames_select(bst_ctx *ctx, bst_recorded_frames *f, int64_t index,
                                      const bst_recorded_options *options,
                                      bst_recorded_frame *out) {
    assert(f && options && out);
    if (index < 0 || index >= bst_recorded_frames_count(f)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "there is no recorded frame %lld: %s and the other files have %lld",
                        (long long)index, f->files.paths[0],
                        (long long)bst_recorded_frames_count(f));
    }
    int low = 0, high = f->files.count;
    while (high - low > 1) {
        int middle = low + (high - low) / 2;
        *(f->first[middle] <= index ? &low : &high) = middle;
    }
    BST_TRY(open_file(ctx, f, low));
    BST_TRY(bst_frame_source_select(ctx, f->source, index - f->first[low], &f->place));
    *out = (bst_recorded_frame){.path = f->files.paths[low],
                                .place = f->place,
                                .width = f->place.width,
                                .height = f->place.height,
                                .values = {.exposure_id = -1}};
    memset(f->box, 0, sizeof f->box);
    memset(f->bias, 0, sizeof f->bias);
    if (!options->map) {
        return BST_OK;
    }
    const bst_keyword_map *map = options->map;
    BST_TRY(bst_keyword_section(ctx, map->image_section, f->source, &f->place, f->box));
    BST_TRY(bst_keyword_section(ctx, map->bias_section, f->source, &f->place, f->bias));
    out->width = f->box[2] > 0 ? f->box[2] : out->width;
    out->height = f->box[3] > 0 ? f->box[3] : out->height;
    return bst_keyword_map_read(ctx, map, f->source, &f->place, &out->values);
}

/* Makes room for `count` floats. */
static bst_status make_room(bst_ctx *ctx, size_t count, float **buffer, size_t *room) {
    if (*room < count) {
        free(*buffer);
        *buffer = malloc(count * sizeof **buffer);
        *room = *buffer ? count : 0;
    }
    return *buffer ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
}

/* Median of the values that are no NAN; sorts them. 0 without any. */
static double median(float *values, size_t count) {
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        if (!isnan(values[i])) {
            values[kept++] = values[i];
        }
    }
    qsort(values, kept, sizeof *values, bst_compare_floats);
    return kept > 0 ? (double)values[kept / 2] : 0.0;
}

/* Copies a part of the image. */
static void copy_box(const bst_recorded_frames *f, const int box[4], bool flip_rows, float *to) {
    for (int y = 0; y < box[3]; y++) {
        int row = box[1] + (flip_rows ? box[3] - 1 - y : y);
        memcpy(to + (size_t)y * (size_t)box[2],
               f->image + (size_t)row * (size_t)f->place.width + (size_t)box[0],
               (size_t)box[2] * sizeof *to);
    }
}

bst_status bst_recorded_frames_pixels(bst_ctx *ctx, bst_recorded_frames *f,
                                      const bst_recorded_options *options,
                                      bst_recorded_frame *frame, const float **pixels) {
    assert(f && f->source && options && frame && pixels);
    size_t whole = (size_t)f->place.width * (size_t)f->place.height;
    const int box[4] = {f->box[0], f->box[1], frame->width, frame->height};
    size_t count = (size_t)box[2] * (size_t)box[3];
    size_t overscan = (size_t)f->bias[2] * (size_t)f->bias[3];
    BST_TRY(make_room(ctx, whole, &f->image, &f->image_room));
    BST_TRY(bst_frame_source_pixels(ctx, f->source, f->image));
    BST_TRY(make_room(ctx, count > overscan ? count : overscan, &f->used, &f->used_room));
    frame->bias_dn = 0.0;
    if (overscan > 0) {
        copy_box(f, f->bias, false, f->used);
        frame->bias_dn = median(f->used, overscan);
    }
    copy_box(f, box, bst_recorded_flips(options), f->used);
    for (size_t i = 0; i < count && frame->bias_dn != 0.0; i++) {
        f->used[i] -= (float)frame->bias_dn;
    }
    *pixels = f->used;
    return BST_OK;
}

bst_status bst_recorded_counts(bst_ctx *ctx, const float *pixels, size_t count,
                               const bst_keyword_map *map, uint16_t *dn, int64_t *clipped,
                               int64_t *blank) {
    assert(pixels && dn);
    double pedestal = map ? map->pedestal_dn : 0.0, factor = map ? map->dn_per_unit : 1.0;
    int64_t outside = 0, missing = 0;
    for (size_t i = 0; i < count; i++) {
        missing += isnan(pixels[i]);
    }
    double filling = 0.0;
    if (missing > 0) {
        float *copy = malloc(count * sizeof *copy);
        if (!copy) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %zu pixels", count);
        }
        memcpy(copy, pixels, count * sizeof *copy);
        filling = median(copy, count);
        free(copy);
    }
    for (size_t i = 0; i < count; i++) {
        double v = pedestal + factor * (isnan(pixels[i]) ? filling : (double)pixels[i]);
        double whole = floor(v + 0.5);
        outside += whole < 0.0 || whole > 65535.0;
        dn[i] = (uint16_t)fmin(fmax(whole, 0.0), 65535.0);
    }
    if (clipped) {
        *clipped = outside;
    }
    if (blank) {
        *blank = missing;
    }
    return BST_OK;
}
