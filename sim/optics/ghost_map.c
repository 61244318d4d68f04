#include "sim/optics/ghost_map.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/file.h"
#include "sim/core/text_reader.h"

#define MAX_FILE_BYTES ((uint64_t)16 << 20)
/* Ghosts that move further than this for each px of their source are no ghosts but errors of a
 * table, and their streaks have millions of nodes. */
#define MOST_MAGNIFICATION 100.0

enum { SOURCE_X, SOURCE_Y, GHOST_X, GHOST_Y, INTENSITY, COLUMNS };
enum { MOST_ROWS = 250000, MAX_LINE = 4096 };

static const char *const names[COLUMNS] = {"source_x_px", "source_y_px", "x_px", "y_px",
                                           "intensity"};
static const double lowest[COLUMNS] = {-1e6, -1e6, -1e6, -1e6, 0.0};
static const char header_form[] = "source_x_px,source_y_px,x_px,y_px[,intensity]";

/* A row of the table. */
typedef struct row {
    double v[COLUMNS];
} row;

/* The table as it is read. */
typedef struct table {
    row *rows;
    int count, capacity;
    int column[COLUMNS]; /* meaning of each field */
    int fields;          /* 0: no header yet */
} table;

void bst_ghost_map_free(bst_ghost_map *map) {
    free(map->source_x);
    free(map->source_y);
    free(map->x);
    free(map->y);
    free(map->intensity);
    *map = (bst_ghost_map){0};
}

static bst_status read_header(const bst_text_source *source, const bst_text_line *line,
                              const bst_text_span *fields, int count, table *t) {
    bool seen[COLUMNS] = {false};
    for (int i = 0; i < count; i++) {
        int k = 0;
        bst_text_span field = bst_text_trimmed(fields[i]);
        while (k < COLUMNS && !bst_text_is(field, names[k])) {
            k++;
        }
        if (k == COLUMNS || seen[k]) {
            return bst_text_fail_at(
                source, line, k < COLUMNS ? "a column is there twice" : "the column is not known",
                field.text, field.length, header_form);
        }
        seen[k] = true;
        t->column[i] = k;
    }
    for (int k = 0; k < INTENSITY; k++) {
        if (!seen[k]) {
            return bst_text_fail_at(source, line, "a column is missing", line->text, line->length,
                                    header_form);
        }
    }
    t->fields = count;
    return BST_OK;
}

static bst_status read_row(const bst_text_source *source, const bst_text_line *line,
                           const bst_text_span *fields, int count, table *t) {
    if (count != t->fields) {
        return bst_text_fail_at(source, line, "the row does not have as many fields as the header",
                                line->text, line->length, "one for each column");
    }
    if (t->count == MOST_ROWS) {
        return bst_fail(source->ctx, BST_ERR_FORMAT, "%.400s:%d: more than %d rows", source->name,
                        line->number, MOST_ROWS);
    }
    if (t->count == t->capacity) {
        int capacity = t->capacity > 0 ? 2 * t->capacity : 64;
        row *more = realloc(t->rows, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_text_fail_memory(source, "rows");
        }
        t->rows = more;
        t->capacity = capacity;
    }
    row *r = &t->rows[t->count++];
    r->v[INTENSITY] = 1.0;
    for (int i = 0; i < count; i++) {
        int k = t->column[i];
        double most = k == INTENSITY ? 1e3 : 1e6;
        bst_text_span field = bst_text_trimmed(fields[i]);
        if (!bst_text_number(field, &r->v[k]) || !(r->v[k] >= lowest[k] && r->v[k] <= most)) {
            char problem[64], allowed[64];
            snprintf(problem, sizeof problem, "%s is not a number in its range", names[k]);
            snprintf(allowed, sizeof allowed, "a number from %g to %g", lowest[k], most);
            return bst_text_fail_at(source, line, problem, field.text, field.length, allowed);
        }
    }
    return BST_OK;
}

static int by_source(const void *a, const void *b) {
    const double *p = ((const row *)a)->v, *q = ((const row *)b)->v;
    if (p[SOURCE_Y] != q[SOURCE_Y]) {
        return p[SOURCE_Y] < q[SOURCE_Y] ? -1 : 1;
    }
    return (p[SOURCE_X] > q[SOURCE_X]) - (p[SOURCE_X] < q[SOURCE_X]);
}

/* Reports that the places of the source are no grid, at one of them. */
static bst_status fail_grid(const bst_text_source *source, const row *at) {
    return bst_fail(source->ctx, BST_ERR_FORMAT,
                    "%.400s: the places of the source are no rectangular grid (at source_x_px %g, "
                    "source_y_px %g); give each pair of an x and a y once, two or more of each",
                    source->name, at->v[SOURCE_X], at->v[SOURCE_Y]);
}

/* Ratio of lengths of the ghost's and the source's way between two points of the grid. */
static double ratio(const bst_ghost_map *m, int from, int to, double source_px) {
    return hypot(m->x[to] - m->x[from], m->y[to] - m->y[from]) / source_px;
}

/* Finds the largest ratio of lengths over the edges of the cells, times sqrt(2) for their
 * diagonals. */
static bst_status find_magnification(const bst_text_source *source, bst_ghost_map *m) {
    double most = 0.0;
    for (int j = 0; j < m->rows; j++) {
        for (int i = 0; i < m->columns; i++) {
            int k = j * m->columns + i;
            double x = i > 0 ? ratio(m, k - 1, k, m->source_x[i] - m->source_x[i - 1]) : 0.0;
            double y =
                j > 0 ? ratio(m, k - m->columns, k, m->source_y[j] - m->source_y[j - 1]) : 0.0;
            most = fmax(most, fmax(x, y));
            if (most > MOST_MAGNIFICATION) {
                return bst_fail(source->ctx, BST_ERR_FORMAT,
                                "%.400s: the ghost moves %.4g px for each px of its source (at "
                                "source_x_px %g, source_y_px %g); allowed are up to %g",
                                source->name, most, m->source_x[i], m->source_y[j],
                                MOST_MAGNIFICATION);
            }
        }
    }
    m->magnification = sqrt(2.0) * most;
    return BST_OK;
}

/* Makes the grid of the sorted rows. */
static bst_status make_grid(const bst_text_source *source, const table *t, bst_ghost_map *m) {
    int columns = 1;
    while (columns < t->count && t->rows[columns].v[SOURCE_Y] == t->rows[0].v[SOURCE_Y]) {
        columns++;
    }
    int rows = t->count / columns;
    if (columns < 2 || rows < 2 || rows * columns != t->count) {
        return fail_grid(source, &t->rows[columns < 2 ? 0 : t->count - 1]);
    }
    size_t n = (size_t)t->count;
    m->source_x = malloc((size_t)columns * sizeof *m->source_x);
    m->source_y = malloc((size_t)rows * sizeof *m->source_y);
    m->x = malloc(n * sizeof *m->x);
    m->y = malloc(n * sizeof *m->y);
    m->intensity = malloc(n * sizeof *m->intensity);
    if (!m->source_x || !m->source_y || !m->x || !m->y || !m->intensity) {
        return bst_text_fail_memory(source, "grid");
    }
    for (int k = 0; k < t->count; k++) {
        const row *r = &t->rows[k];
        int i = k % columns, j = k / columns;
        bool first_row = j == 0, first = i == 0;
        if (first_row) {
            m->source_x[i] = r->v[SOURCE_X];
        }
        if (first) {
            m->source_y[j] = r->v[SOURCE_Y];
        }
        if (r->v[SOURCE_X] != m->source_x[i] || r->v[SOURCE_Y] != m->source_y[j] ||
            (first_row && !first && !(m->source_x[i] > m->source_x[i - 1])) ||
            (first && j > 0 && !(m->source_y[j] > m->source_y[j - 1]))) {
            return fail_grid(source, r);
        }
        m->x[k] = r->v[GHOST_X];
        m->y[k] = r->v[GHOST_Y];
        m->intensity[k] = r->v[INTENSITY];
    }
    m->columns = columns;
    m->rows = rows;
    return find_magnification(source, m);
}

static bst_status read_lines(const bst_text_source *source, const char *text, size_t bytes,
                             table *t) {
    bst_text_cursor cursor = bst_text_start(text, bytes);
    bst_text_line line;
    char scratch[MAX_LINE];
    while (bst_text_next_line(&cursor, &line)) {
        bst_text_span all = bst_text_trimmed((bst_text_span){line.text, line.length});
        if (all.length == 0 || all.text[0] == '#') {
            continue;
        }
        if (line.length > MAX_LINE) {
            return bst_fail(source->ctx, BST_ERR_FORMAT, "%.400s:%d: the line is too long",
                            source->name, line.number);
        }
        bst_text_span fields[COLUMNS + 1];
        int count = bst_text_split_csv(&line, scratch, fields, COLUMNS);
        if (count < 1 || count > COLUMNS) {
            return bst_text_fail_at(source, &line, "the row does not have four or five fields",
                                    line.text, line.length, header_form);
        }
        BST_TRY(t->fields ? read_row(source, &line, fields, count, t)
                          : read_header(source, &line, fields, count, t));
    }
    if (t->count == 0) {
        return bst_fail(source->ctx, BST_ERR_FORMAT,
                        "%.400s: has no rows; give a table of places of a ghost: a line \"%s\" and "
                        "rows of numbers",
                        source->name, header_form);
    }
    return BST_OK;
}

bst_status bst_ghost_map_read(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                              bst_ghost_map *out) {
    *out = (bst_ghost_map){0};
    const bst_text_source source = {ctx, name};
    table t = {.count = 0};
    bst_status status = read_lines(&source, text, bytes, &t);
    if (status == BST_OK) {
        qsort(t.rows, (size_t)t.count, sizeof *t.rows, by_source);
        status = make_grid(&source, &t, out);
    }
    free(t.rows);
    if (status != BST_OK) {
        bst_ghost_map_free(out);
    }
    return status;
}

bst_status bst_ghost_map_load(bst_ctx *ctx, const char *file, const char *base_dir,
                              bst_ghost_map *out) {
    char path[1100], *text = NULL;
    size_t bytes = 0;
    *out = (bst_ghost_map){0};
    bst_file_resolve(base_dir, file, path, sizeof path);
    BST_TRY(
        bst_file_read(ctx, path, MAX_FILE_BYTES, "a table of places of a ghost", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    if (status == BST_OK) {
        status = bst_ghost_map_read(ctx, path, text, bytes, out);
    }
    free(text);
    return status;
}

/* Cell of a coordinate and the place in it: 0 to 1 within the grid. */
static int cell_of(const double *at, int count, double v, double *part) {
    int low = 0, high = count - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(at[middle] <= v ? &low : &high) = middle;
    }
    *part = (v - at[low]) / (at[high] - at[low]);
    return low;
}

/* Bilinear interpolation in a cell of an array. */
static double between(const double *value, int columns, double s, double t) {
    double left = value[0] + t * (value[columns] - value[0]);
    double right = value[1] + t * (value[columns + 1] - value[1]);
    return left + s * (right - left);
}

void bst_ghost_map_place(const bst_ghost_map *m, double x_px, double y_px, double to[2]) {
    double s, t;
    int i = cell_of(m->source_x, m->columns, x_px, &s), j = cell_of(m->source_y, m->rows, y_px, &t);
    int k = j * m->columns + i;
    to[0] = between(m->x + k, m->columns, s, t);
    to[1] = between(m->y + k, m->columns, s, t);
}

double bst_ghost_map_intensity(const bst_ghost_map *m, double x_px, double y_px) {
    double s, t;
    int i = cell_of(m->source_x, m->columns, x_px, &s), j = cell_of(m->source_y, m->rows, y_px, &t);
    return between(m->intensity + j * m->columns + i, m->columns, fmin(fmax(s, 0.0), 1.0),
                   fmin(fmax(t, 0.0), 1.0));
}
