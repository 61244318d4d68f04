/* Sorts the segments of an OEM by object and time. */
#include <stdlib.h>
#include <string.h>

#include "sim/astro/oem_internal.h"

static int compare_objects(const bst_oem_segment_rows *a, const bst_oem_segment_rows *b) {
    int order = strcmp(a->name, b->name);
    return order ? order : strcmp(a->id, b->id);
}

static int by_object(const void *x, const void *y) {
    const bst_oem_segment_rows *a = x, *b = y;
    int order = compare_objects(a, b);
    return order ? order : (a->line > b->line) - (a->line < b->line);
}

static int by_number(const void *x, const void *y) {
    const bst_oem_segment_rows *a = x, *b = y;
    return (a->object > b->object) - (a->object < b->object);
}

static int by_time(const void *x, const void *y) {
    const bst_oem_segment_rows *a = x, *b = y;
    if (a->object != b->object) {
        return a->object < b->object ? -1 : 1;
    }
    double later_s = bst_time_diff(a->base, b->base) + (a->from_s - b->from_s);
    return later_s > 0.0 ? 1 : later_s < 0.0 ? -1 : (a->line > b->line) - (a->line < b->line);
}

bst_status bst_oem_sort(bst_ctx *ctx, bst_oem *oem) {
    int n = oem->segment_count, objects = 0;
    bst_oem_segment_rows *s = oem->segments;
    /* the line of an object's first segment identifies it until all are numbered */
    qsort(s, (size_t)n, sizeof *s, by_object);
    for (int i = 0; i < n; i++) {
        s[i].object = i > 0 && compare_objects(&s[i - 1], &s[i]) == 0 ? s[i - 1].object : s[i].line;
    }
    qsort(s, (size_t)n, sizeof *s, by_number);
    for (int i = 0, line = 0; i < n; i++) {
        objects += i == 0 || s[i].object != line;
        line = s[i].object;
        s[i].object = objects - 1;
    }
    qsort(s, (size_t)n, sizeof *s, by_time);
    oem->objects = calloc((size_t)objects, sizeof *oem->objects);
    if (!oem->objects) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for its objects", oem->name);
    }
    oem->object_count = objects;
    for (int i = 0; i < n; i++) {
        bst_oem_object *o = &oem->objects[s[i].object];
        if (o->count == 0) {
            *o = (bst_oem_object){.name = s[i].name, .id = s[i].id, .first = i};
        } else if (bst_time_diff(s[i].base, s[i - 1].base) + s[i].from_s - s[i - 1].to_s < -1e-6) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s:%d: the usable span overlaps that of the segment of the same "
                            "object at line %d; set USEABLE_START_TIME and USEABLE_STOP_TIME",
                            oem->name, s[i].line, s[i - 1].line);
        }
        o->count++;
    }
    return BST_OK;
}
