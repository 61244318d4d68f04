#include "imgproc/calibrate/bad_rows.h"
#include "sim/core/pages.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

bst_status bst_bad_rows_create(bst_ctx *ctx, int width, int height, int capacity,
                               bst_bad_rows *out) {
    assert(out && width > 0 && height > 0 && capacity >= 0);
    *out = (bst_bad_rows){.width = width, .height = height, .capacity = capacity};
    out->first = calloc((size_t)height + 1, sizeof *out->first);
    out->column = bst_pages_zero((size_t)capacity + 1, sizeof *out->column);
    if (!out->first || !out->column) {
        bst_bad_rows_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a map of %d bad pixels", capacity);
    }
    return BST_OK;
}

void bst_bad_rows_free(bst_bad_rows *rows) {
    free(rows->first);
    bst_pages_free(rows->column);
    *rows = (bst_bad_rows){0};
}

/* True if the rows' first indices ascend from 0 to the count, and the columns within each row. */
static bool is_valid(const bst_bad_rows *rows) {
    bool valid = rows->first[0] == 0 && rows->first[rows->height] == rows->count;
    for (int y = 0; y < rows->height && valid; y++) {
        int last = -1;
        valid = rows->first[y] <= rows->first[y + 1] && rows->first[y + 1] <= rows->count;
        for (int i = rows->first[y]; valid && i < rows->first[y + 1]; i++) {
            valid = rows->column[i] > last && rows->column[i] < rows->width;
            last = rows->column[i];
        }
    }
    return valid;
}

bst_status bst_bad_rows_archive(bst_bad_rows *rows, bst_archive *archive) {
    assert(rows && archive);
    rows->count = bst_archive_count(archive, rows->count, rows->capacity);
    bst_archive_bytes(archive, rows->first, ((size_t)rows->height + 1) * sizeof *rows->first);
    bst_archive_bytes(archive, rows->column, (size_t)rows->count * sizeof *rows->column);
    if (bst_archive_is_restoring(archive) && !is_valid(rows)) {
        bst_bad_rows_begin(rows);
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved map of bad pixels has rows or columns out of range (allowed: "
                        "those of a sensor of %d x %d pixels, ascending)",
                        rows->width, rows->height);
    }
    return BST_OK;
}

void bst_bad_rows_begin(bst_bad_rows *rows) {
    rows->count = 0;
    memset(rows->first, 0, ((size_t)rows->height + 1) * sizeof *rows->first);
}

void bst_bad_rows_add(bst_bad_rows *rows, int32_t pixel) {
    assert(rows && pixel >= 0 && pixel < rows->width * rows->height);
    if (rows->count < rows->capacity) {
        rows->first[pixel / rows->width + 1]++;
        rows->column[rows->count++] = pixel % rows->width;
    }
}

void bst_bad_rows_end(bst_bad_rows *rows) {
    for (int y = 0; y < rows->height; y++) {
        rows->first[y + 1] += rows->first[y];
    }
}

/* Index of the first bad column >= x of sensor row y (binary search). */
static int first_bad_from_column(const bst_bad_rows *rows, int y, int x) {
    int lo = rows->first[y], hi = rows->first[y + 1];
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (rows->column[mid] < x) {
            lo = mid + 1;
        } else {
            hi = mid;
        }
    }
    return lo;
}

bool bst_bad_rows_hold(const bst_bad_rows *rows, int32_t pixel) {
    int y = pixel / rows->width, x = pixel % rows->width, i = first_bad_from_column(rows, y, x);
    return i < rows->first[y + 1] && rows->column[i] == x;
}

void bst_bad_rows_mask(const bst_bad_rows *rows, const bst_bad_rows_run *run, float value,
                       float *out) {
    int binning = run->binning;
    int top = run->window->y0 + run->y * binning, left = run->window->x0 + run->x * binning;
    int right = left + run->count * binning;
    for (int v = top; v < top + binning; v++) {
        for (int i = first_bad_from_column(rows, v, left);
             i < rows->first[v + 1] && rows->column[i] < right; i++) {
            out[(rows->column[i] - left) / binning] = value;
        }
    }
}
