/* Internal types of the OEM reader and its interpolation. */
#ifndef BST_ASTRO_OEM_INTERNAL_H
#define BST_ASTRO_OEM_INTERNAL_H

#include "sim/astro/interpolate.h"
#include "sim/astro/oem.h"

typedef enum bst_oem_axes { BST_OEM_GCRF, BST_OEM_TEME, BST_OEM_ITRF } bst_oem_axes;

typedef struct bst_oem_segment_rows {
    int object;
    char name[64], id[64]; /* of the object */
    int line;              /* of META_START */
    bst_oem_axes axes;
    bool hermite;
    int points;          /* number of rows for the interpolation */
    bst_time base;       /* reference time of rows[].t_s */
    int64_t first, rows; /* in bst_oem.rows */
    double from_s, to_s; /* usable span, after base */
} bst_oem_segment_rows;

typedef struct bst_oem_object {
    const char *name, *id; /* of its first segment */
    int first, count;      /* in bst_oem.segments */
} bst_oem_object;

struct bst_oem {
    char *name; /* of the file, for messages */
    bst_astro_table_state *rows;
    int64_t row_count, row_capacity;
    bst_oem_segment_rows *segments; /* sorted by object, then by time */
    int segment_count, segment_capacity;
    bst_oem_object *objects;
    int object_count;
};

/* Numbers objects in file order and sorts their segments by time. BST_ERR_FORMAT: usable spans of
 * one object overlap. */
bst_status bst_oem_sort(bst_ctx *ctx, bst_oem *oem) BST_MUST_CHECK;

#endif
