#include "sim/catalogue/star_curves.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/catalogue/star_table_internal.h"
#include "sim/core/file.h"
#include "sim/core/text_reader.h"

enum { FIELDS = 64, MOST_ROWS = 100000000 };
static const uint64_t MOST_BYTES = (uint64_t)4 << 30;

/* Quantities of a row, and the names of their columns. */
enum { SOURCE, MAG, PHASE, TIME, QUANTITIES };
static const char *const names[QUANTITIES] = {bst_star_source_names, "delta_mag", "phase",
                                              "time_jd"};

/* State of the reader. */
typedef struct reader {
    bst_text_source where;
    int column[QUANTITIES]; /* from 0; -1: none */
    int columns;
    char *scratch;
    size_t scratch_bytes;
    bst_star_curves *out;
    int room;
} reader;

static bst_status split(reader *r, const bst_text_line *line, bst_text_span fields[FIELDS],
                        int *count) {
    if (line->length + 1 > r->scratch_bytes) {
        size_t bytes = 2 * (line->length + 1);
        char *scratch = realloc(r->scratch, bytes);
        if (!scratch) {
            return bst_text_fail_memory(&r->where, "lines");
        }
        r->scratch = scratch;
        r->scratch_bytes = bytes;
    }
    *count = bst_text_split_csv(line, r->scratch, fields, FIELDS);
    if (*count < 0 || *count > FIELDS || (r->columns > 0 && *count != r->columns)) {
        return bst_text_fail_line(&r->where, line, "wrong number of fields",
                                  "as many as names of columns, at most 64");
    }
    return BST_OK;
}

static bst_status read_names(reader *r, const bst_text_line *line) {
    bst_text_span fields[FIELDS];
    BST_TRY(split(r, line, fields, &r->columns));
    for (int q = 0; q < QUANTITIES; q++) {
        r->column[q] = -1;
        for (int i = 0; i < r->columns && r->column[q] < 0; i++) {
            bst_text_span name = bst_text_trimmed(fields[i]);
            r->column[q] = bst_star_name_is(names[q], name.text, name.length) ? i : -1;
        }
    }
    if (r->column[SOURCE] < 0 || r->column[MAG] < 0 ||
        (r->column[PHASE] < 0) == (r->column[TIME] < 0)) {
        return bst_text_fail_line(&r->where, line, "names of columns",
                                  "source_id, delta_mag, and either phase or time_jd");
    }
    r->out->by_phase = r->column[PHASE] >= 0;
    return BST_OK;
}

static bst_status number(reader *r, const bst_text_line *line, const bst_text_span *fields, int q,
                         double low, double high, double *out) {
    bst_text_span field = bst_text_trimmed(fields[r->column[q]]);
    if (bst_text_number(field, out) && *out >= low && *out <= high) {
        return BST_OK;
    }
    char problem[64], allowed[64];
    snprintf(problem, sizeof problem, "column %s", names[q]);
    snprintf(allowed, sizeof allowed, "a number from %g to %g", low, high);
    return bst_text_fail_at(&r->where, line, problem, field.text, field.length, allowed);
}

static bst_status read_row(reader *r, const bst_text_line *line) {
    bst_text_span fields[FIELDS];
    int count;
    bst_star_curve_row row = {.line = line->number};
    BST_TRY(split(r, line, fields, &count));
    bst_text_span id = bst_text_trimmed(fields[r->column[SOURCE]]);
    if (!bst_star_source_read(id, &row.source)) {
        return bst_text_fail_at(&r->where, line, "column source_id", id.text, id.length,
                                "a whole number of 63 bits");
    }
    const bool phase = r->out->by_phase;
    BST_TRY(number(r, line, fields, phase ? PHASE : TIME, phase ? 0.0 : 2e6, phase ? 1.0 : 3e6,
                   &row.time));
    BST_TRY(number(r, line, fields, MAG, -20.0, 20.0, &row.mag));
    if (r->out->count == r->room) {
        if (r->room >= MOST_ROWS) {
            return bst_text_fail_line(&r->where, line, "too many points", "at most 100 million");
        }
        int room = r->room ? 2 * r->room : 1024;
        bst_star_curve_row *rows = realloc(r->out->rows, (size_t)room * sizeof *rows);
        if (!rows) {
            return bst_text_fail_memory(&r->where, "rows");
        }
        r->out->rows = rows;
        r->room = room;
    }
    r->out->rows[r->out->count++] = row;
    return BST_OK;
}

static int by_source_and_time(const void *pa, const void *pb) {
    const bst_star_curve_row *a = pa, *b = pb;
    if (a->source != b->source) {
        return a->source < b->source ? -1 : 1;
    }
    return (a->time > b->time) - (a->time < b->time);
}

/* Checks that each star has points at two times or more, and one at each time. */
static bst_status check_curves(bst_ctx *ctx, const char *path, const bst_star_curves *c) {
    double begin = 0.0;
    for (int i = 0; i < c->count; i++) {
        const bst_star_curve_row *row = &c->rows[i];
        bool first = i == 0 || row[-1].source != row->source;
        bool last = i + 1 == c->count || row[1].source != row->source;
        begin = first && !c->by_phase ? row->time : begin;
        if (first && last) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s:%d: source_id %lld has one point (allowed: two and more)", path,
                            row->line, (long long)row->source);
        }
        /* a catalogue has phases, and times from the first one on, in single precision */
        if (!first && !((float)(row->time - begin) > (float)(row[-1].time - begin))) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%s:%d: source_id %lld has another point at the same time, in line %d "
                            "(allowed: times that differ in single precision, %s)",
                            path, row->line, (long long)row->source, row[-1].line,
                            c->by_phase ? "as phases" : "as days after the first");
        }
    }
    return c->count > 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT,
                          "%s: is empty (allowed: a line of names, then a point a line)", path);
}

bst_status bst_star_curves_read(bst_ctx *ctx, const char *path, bst_star_curves *out) {
    char *text;
    size_t bytes;
    *out = (bst_star_curves){0};
    BST_TRY(bst_file_read(ctx, path, MOST_BYTES, "a table of light curves (CSV)", &text, &bytes));
    reader r = {.where = {ctx, path}, .out = out};
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    bst_text_cursor cursor = bst_text_start(text, bytes);
    bst_text_line line;
    while (status == BST_OK && bst_text_next_line(&cursor, &line)) {
        if (line.length > 0 && line.text[0] != '#') {
            status = r.columns == 0 ? read_names(&r, &line) : read_row(&r, &line);
        }
    }
    if (status == BST_OK && out->count > 0) {
        qsort(out->rows, (size_t)out->count, sizeof *out->rows, by_source_and_time);
    }
    if (status == BST_OK) {
        status = check_curves(ctx, path, out);
    }
    free(r.scratch);
    free(text);
    return status;
}

void bst_star_curves_free(bst_star_curves *c) {
    free(c->rows);
    *c = (bst_star_curves){0};
}

const bst_star_curve_row *bst_star_curves_of(const bst_star_curves *c, int64_t source, int *count) {
    int low = 0, high = c->count;
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (c->rows[middle].source < source) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    *count = 0;
    while (low + *count < c->count && c->rows[low + *count].source == source) {
        ++*count;
    }
    return *count > 0 ? &c->rows[low] : NULL;
}
