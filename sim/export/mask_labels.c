#include "sim/export/mask_labels.h"

#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"
#include "sim/io/mask_outline.h"

/* values in a mask; the truth has room for fewer sources */
enum { MOST_VALUES = 1 << 24 };

static const char parts_sql[] = "SELECT number, id, part FROM parts ORDER BY number";

/* Reads the table parts. */
static bst_status read_parts(bst_ctx *ctx, const bst_run_reader *run, bst_mask_labels *out) {
    int64_t count = bst_run_reader_int(run, "SELECT count(*) FROM parts", 0, 0);
    bst_io_rows *rows;
    bool more;
    bst_status status;
    if (count <= 0 || count > MOST_VALUES) {
        return BST_OK;
    }
    out->parts = calloc((size_t)count, sizeof *out->parts);
    if (!out->parts) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %lld parts", (long long)count);
    }
    BST_TRY(bst_io_rows_open(ctx, run, parts_sql, 0, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           out->part_count < count) {
        bst_mask_part *part = &out->parts[out->part_count++];
        part->number = bst_io_rows_int(rows, 0);
        part->object = bst_io_rows_int(rows, 1);
        snprintf(part->name, sizeof part->name, "%s", bst_io_rows_text(rows, 2));
    }
    bst_io_rows_close(rows);
    return status;
}

bst_status bst_mask_labels_open(bst_ctx *ctx, const bst_run_reader *run, const char *file,
                                const char *plane, bst_mask_labels *out) {
    char name[320], path[4096];
    *out = (bst_mask_labels){0};
    /* frames.fits -> segmentation.fits, frames_OBSERVER_SENSOR.fits -> ... */
    if (strncmp(file, "frames", 6) != 0) {
        return BST_OK;
    }
    snprintf(name, sizeof name, "%s%s", plane, file + 6);
    BST_TRY(bst_run_reader_file(ctx, run, name, path, sizeof path));
    bst_ctx quiet = {0};
    bst_status status = bst_fits_reader_open_masks(&quiet, path, &out->fits);
    if (status != BST_OK) {
        out->fits = NULL;
        return status == BST_ERR_NOT_FOUND ? BST_OK : bst_fail(ctx, status, "%s", quiet.message);
    }
    return strcmp(plane, "parts") == 0 ? read_parts(ctx, run, out) : BST_OK;
}

void bst_mask_labels_close(bst_mask_labels *labels) {
    bst_fits_reader_close(labels->fits);
    free(labels->extents);
    free(labels->parts);
    *labels = (bst_mask_labels){0};
}

/* Finds the bounding box and pixel count of each value of the current mask. */
static bst_status find_extents(bst_ctx *ctx, bst_mask_labels *l) {
    const bst_fits_read_mask *m = &l->mask;
    int32_t most = 0;
    size_t pixels = (size_t)m->width * (size_t)m->height;
    for (size_t i = 0; i < pixels; i++) {
        most = m->items[i] > most ? m->items[i] : most;
    }
    if (most >= MOST_VALUES) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the mask of exposure %lld has the value %d",
                        (long long)m->exposure_id, most);
    }
    if (most + 1 > l->extent_room) {
        bst_mask_extent *grown = realloc(l->extents, 2 * ((size_t)most + 1) * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d outlines", most);
        }
        l->extents = grown;
        l->extent_room = 2 * (most + 1);
    }
    l->extent_count = most + 1;
    memset(l->extents, 0, (size_t)l->extent_count * sizeof *l->extents);
    for (size_t i = 0; i < pixels; i++) {
        if (m->items[i] > 0) {
            bst_mask_extent *e = &l->extents[m->items[i]];
            int x = (int)(i % (size_t)m->width), y = (int)(i / (size_t)m->width);
            bool first = e->pixels++ == 0;
            e->x0 = first || x < e->x0 ? x : e->x0;
            e->x1 = first || x >= e->x1 ? x + 1 : e->x1;
            e->y0 = first ? y : e->y0;
            e->y1 = y + 1;
        }
    }
    return BST_OK;
}

bst_status bst_mask_labels_read(bst_ctx *ctx, bst_mask_labels *l, const bst_mask_frame *frame) {
    l->mask.items = NULL;
    if (!l->fits) {
        return BST_OK;
    }
    BST_TRY(bst_fits_reader_mask(ctx, l->fits, frame->index, &l->mask));
    if (l->mask.exposure_id != frame->exposure_id || l->mask.width != frame->width ||
        l->mask.height != frame->height) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "the masks are not those of the frames (mask %lld is of exposure %lld)",
                        (long long)frame->index, (long long)l->mask.exposure_id);
    }
    return find_extents(ctx, l);
}

int64_t bst_mask_labels_pixels(const bst_mask_labels *l, int64_t value) {
    return l->mask.items && value > 0 && value < l->extent_count ? l->extents[value].pixels : 0;
}

bst_status bst_mask_labels_add(bst_ctx *ctx, const bst_mask_labels *l, int64_t value, cJSON *node) {
    const bst_mask_extent *e = &l->extents[value];
    const bst_mask_item outlined = {l->mask.items, l->mask.width, (int32_t)value, e->x0,
                                    e->y0,         e->x1,         e->y1};
    char *text = NULL;
    size_t bytes;
    bst_json_add_number(node, "area", (double)e->pixels);
    FILE *stream = open_memstream(&text, &bytes);
    bst_status status = stream ? bst_mask_outline_write(ctx, &outlined, stream)
                               : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an outline");
    if (stream && fclose(stream) != 0 && status == BST_OK) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an outline");
    }
    if (status == BST_OK) {
        cJSON_AddItemToObject(node, "segmentation", cJSON_CreateRaw(text));
    }
    free(text);
    return status;
}

/* Replaces the polygons of a part by such in shares of the image's width and height. */
static bst_status make_fractions(bst_ctx *ctx, const bst_mask_labels *l, cJSON *part) {
    const cJSON *text = cJSON_GetObjectItem(part, "segmentation");
    cJSON *polygons = cJSON_Parse(text->valuestring), *polygon, *number;
    if (!polygons) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an outline");
    }
    cJSON_ArrayForEach(polygon, polygons) {
        bool across = true; /* x, y, x, y, ... */
        cJSON_ArrayForEach(number, polygon) {
            cJSON_SetNumberValue(number,
                                 number->valuedouble / (across ? l->mask.width : l->mask.height));
            across = !across;
        }
    }
    cJSON_ReplaceItemInObject(part, "segmentation", polygons);
    return BST_OK;
}

bst_status bst_mask_labels_add_parts(bst_ctx *ctx, const bst_mask_labels *l, int64_t object,
                                     bool fractions, cJSON *node) {
    if (!l->mask.items) {
        return BST_OK;
    }
    double width = fractions ? l->mask.width : 1.0, height = fractions ? l->mask.height : 1.0;
    cJSON *parts = cJSON_AddArrayToObject(node, "parts");
    for (int i = 0; i < l->part_count; i++) {
        const bst_mask_part *p = &l->parts[i];
        if (p->object != object || bst_mask_labels_pixels(l, p->number) == 0) {
            continue;
        }
        const bst_mask_extent *e = &l->extents[p->number];
        cJSON *part = cJSON_CreateObject();
        cJSON_AddItemToArray(parts, part);
        cJSON_AddStringToObject(part, "name", p->name);
        cJSON_AddNumberToObject(part, "number", (double)p->number);
        const double bbox[4] = {e->x0 / width, e->y0 / height, (e->x1 - e->x0) / width,
                                (e->y1 - e->y0) / height};
        cJSON_AddItemToObject(part, "bbox", cJSON_CreateDoubleArray(bbox, 4));
        BST_TRY(bst_mask_labels_add(ctx, l, p->number, part));
        if (fractions) {
            BST_TRY(make_fractions(ctx, l, part));
        }
    }
    return BST_OK;
}
