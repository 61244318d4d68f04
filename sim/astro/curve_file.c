#include "sim/astro/curve_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "sim/core/file.h"
#include "sim/core/text_reader.h"

#define MAX_FILE_BYTES ((uint64_t)16 << 20)

enum { MAX_LINE = 4096, MAX_FIELDS = 3 };

void bst_curve_free(bst_curve *curve) {
    free(curve->x);
    free(curve->y);
    *curve = (bst_curve){0};
}

static bst_status find_name(const bst_text_source *source, const bst_text_line *line,
                            bst_text_span field, const char *const *names, int *out) {
    char allowed[160];
    int length = 0;
    for (int i = 0; names[i]; i++) {
        if (bst_text_is(field, names[i])) {
            *out = i;
            return BST_OK;
        }
        length += snprintf(allowed + length, sizeof allowed - (size_t)length, "%s%s",
                           i > 0 ? " or " : "", names[i]);
    }
    return bst_text_fail_at(source, line, "the column is not known", field.text, field.length,
                            allowed);
}

static bst_status read_number(const bst_text_source *source, const bst_text_line *line,
                              bst_text_span field, const char *name, double low, double high,
                              double *out) {
    char problem[96], range[96];
    if (bst_text_number(field, out) && *out >= low && *out <= high) {
        return BST_OK;
    }
    snprintf(problem, sizeof problem, "%s is not a number in its range", name);
    snprintf(range, sizeof range, "a number from %g to %g", low, high);
    return bst_text_fail_at(source, line, problem, field.text, field.length, range);
}

static bst_status add_row(const bst_text_source *source, const bst_text_line *line,
                          const bst_curve_format *f, const bst_text_span *fields, bst_curve *out,
                          int *capacity) {
    double x, y;
    BST_TRY(
        read_number(source, line, fields[0], f->x_names[out->x_column], f->x_min, f->x_max, &x));
    BST_TRY(
        read_number(source, line, fields[1], f->y_names[out->y_column], f->y_min, f->y_max, &y));
    if (out->count > 0 && !(x > out->x[out->count - 1])) {
        return bst_text_fail_at(source, line, "the first column does not ascend", fields[0].text,
                                fields[0].length, "a greater number than in the row before");
    }
    if (out->count == BST_CURVE_POINTS_MAX) {
        return bst_fail(source->ctx, BST_ERR_FORMAT, "%.400s:%d: more than %d rows", source->name,
                        line->number, BST_CURVE_POINTS_MAX);
    }
    if (out->count == *capacity) {
        *capacity = *capacity > 0 ? 2 * *capacity : 64;
        double *more_x = realloc(out->x, (size_t)*capacity * sizeof *more_x);
        out->x = more_x ? more_x : out->x;
        double *more_y = realloc(out->y, (size_t)*capacity * sizeof *more_y);
        out->y = more_y ? more_y : out->y;
        if (!more_x || !more_y) {
            return bst_fail(source->ctx, BST_ERR_MEMORY, "%.400s: no memory for its rows",
                            source->name);
        }
    }
    out->x[out->count] = x;
    out->y[out->count++] = y;
    return BST_OK;
}

static bst_status read_text(const bst_text_source *source, const char *text, size_t bytes,
                            const bst_curve_format *f, bst_curve *out) {
    bst_text_cursor cursor = bst_text_start(text, bytes);
    bst_text_line line;
    char scratch[MAX_LINE];
    bool header = false;
    int capacity = 0;
    while (bst_text_next_line(&cursor, &line)) {
        bst_text_span all = bst_text_trimmed((bst_text_span){line.text, line.length});
        if (all.length == 0 || all.text[0] == '#') {
            continue;
        }
        if (line.length > MAX_LINE) {
            return bst_fail(source->ctx, BST_ERR_FORMAT, "%.400s:%d: the line is too long",
                            source->name, line.number);
        }
        bst_text_span fields[MAX_FIELDS];
        if (bst_text_split_csv(&line, scratch, fields, MAX_FIELDS) != 2) {
            return bst_text_fail_at(source, &line, "the row does not have two fields", line.text,
                                    line.length, "two, separated by a comma");
        }
        if (header) {
            BST_TRY(add_row(source, &line, f, fields, out, &capacity));
            continue;
        }
        BST_TRY(find_name(source, &line, fields[0], f->x_names, &out->x_column));
        BST_TRY(find_name(source, &line, fields[1], f->y_names, &out->y_column));
        header = true;
    }
    if (out->count == 0) {
        return bst_fail(source->ctx, BST_ERR_FORMAT,
                        "%.400s: has no rows; give %s: a line \"%s,%s\" and rows of two numbers",
                        source->name, f->what, f->x_names[0], f->y_names[0]);
    }
    return BST_OK;
}

bst_status bst_curve_load(bst_ctx *ctx, const char *path, const bst_curve_format *format,
                          bst_curve *out) {
    *out = (bst_curve){0};
    char *text = NULL;
    size_t bytes = 0;
    BST_TRY(bst_file_read(ctx, path, MAX_FILE_BYTES, format->what, &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    if (status == BST_OK) {
        bst_text_source source = {ctx, path};
        status = read_text(&source, text, bytes, format, out);
    }
    free(text);
    return status;
}

double bst_curve_at(const bst_curve *curve, double x) {
    int low = 0, high = curve->count - 1;
    if (x <= curve->x[0]) {
        return curve->y[0];
    }
    if (x >= curve->x[high]) {
        return curve->y[high];
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(curve->x[middle] <= x ? &low : &high) = middle;
    }
    double u = (x - curve->x[low]) / (curve->x[high] - curve->x[low]);
    return curve->y[low] + u * (curve->y[high] - curve->y[low]);
}
