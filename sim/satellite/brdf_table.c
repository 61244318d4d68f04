/* Measured BRDF in the plane of incidence: its file and interpolation. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/core/file.h"
#include "sim/satellite/brdf.h"

enum { ROWS_MAX = 64, POINTS_MAX = 2000, FILE_BYTES_MAX = 4 << 20 };

/* Values at one angle of incidence, ascending in sin_out. */
typedef struct row {
    double sin_in;
    int first, count; /* in the table's points */
} row;

typedef struct point {
    double sin_in, sin_out, log10_value;
} point;

struct bst_brdf_table {
    row rows[ROWS_MAX];
    int row_count;
    point *points;
    int count, capacity;
};

void bst_brdf_table_free(bst_brdf_table *table) {
    if (table) {
        free(table->points);
        free(table);
    }
}

/* Reads the five numbers of a line: true if it has exactly these. */
static bool numbers_of(const char *line, double out[5]) {
    for (int i = 0; i < 5; i++) {
        char *end;
        line += strspn(line, " \t,");
        out[i] = strtod(line, &end);
        if (end == line || !isfinite(out[i])) {
            return false;
        }
        line = end;
    }
    return line[strspn(line, " \t,\r")] == '\0';
}

static bst_status add_line(bst_ctx *ctx, bst_brdf_table *t, const double v[5]) {
    if (!(v[0] >= 0.0 && v[0] <= 90.0 && fabs(v[2]) <= 90.0 && v[4] >= 0.0 && v[4] <= 1e9)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "incidence %g, reflection %g degrees, BRDF %g (allowed: 0 to 90, -90 to "
                        "90, 0 to 1e9)",
                        v[0], v[2], v[4]);
    }
    if (t->count == t->capacity) {
        int capacity = t->capacity ? 2 * t->capacity : 256;
        point *points = realloc(t->points, (size_t)capacity * sizeof *points);
        if (!points) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a table of %d values", capacity);
        }
        t->points = points;
        t->capacity = capacity;
    }
    t->points[t->count++] =
        (point){sin(v[0] * BST_DEG_RAD), sin(v[2] * BST_DEG_RAD), log10(fmax(v[4], 1e-12))};
    return BST_OK;
}

static int compare_points(const void *a, const void *b) {
    const point *x = a, *y = b;
    if (x->sin_in != y->sin_in) {
        return x->sin_in < y->sin_in ? -1 : 1;
    }
    return x->sin_out < y->sin_out ? -1 : x->sin_out > y->sin_out;
}

/* Sorts the points into rows of one angle of incidence. */
static bst_status make_rows(bst_ctx *ctx, bst_brdf_table *t) {
    if (t->count > 0) { /* qsort takes no NULL */
        qsort(t->points, (size_t)t->count, sizeof *t->points, compare_points);
    }
    for (int i = 0; i < t->count; i++) {
        row *last = t->row_count ? &t->rows[t->row_count - 1] : NULL;
        if (!last || t->points[i].sin_in != last->sin_in) {
            if (t->row_count == ROWS_MAX) {
                return bst_fail(ctx, BST_ERR_FORMAT,
                                "more than %d angles of incidence (allowed: %d)", ROWS_MAX,
                                ROWS_MAX);
            }
            t->rows[t->row_count++] = (row){t->points[i].sin_in, i, 0};
            last = &t->rows[t->row_count - 1];
        }
        last->count++;
    }
    if (t->row_count == 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "no values; give lines of five numbers");
    }
    return BST_OK;
}

static bst_status read_lines(bst_ctx *ctx, char *text, bst_brdf_table *t) {
    int line = 0;
    for (char *at = text, *next; at; at = next) {
        next = strchr(at, '\n');
        if (next) {
            *next++ = '\0';
        }
        line++;
        at += strspn(at, " \t\r");
        if (!*at || *at == '#' || isalpha((unsigned char)*at)) {
            continue;
        }
        double v[5];
        if (!numbers_of(at, v)) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "line %d: \"%.40s\" (allowed: five numbers, or a comment with #)", line,
                            at);
        }
        bst_status status = add_line(ctx, t, v);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "line %d", line);
        }
        if (t->count > ROWS_MAX * POINTS_MAX) {
            return bst_fail(ctx, BST_ERR_FORMAT, "more than %d values", ROWS_MAX * POINTS_MAX);
        }
    }
    return make_rows(ctx, t);
}

bst_status bst_brdf_table_load(bst_ctx *ctx, const char *path, bst_brdf_table **out) {
    char *text;
    size_t bytes;
    *out = NULL;
    BST_TRY(bst_file_read(ctx, path, FILE_BYTES_MAX, "a table of a BRDF", &text, &bytes));
    bst_status status = bst_file_check_text(ctx, path, text, bytes);
    bst_brdf_table *t = calloc(1, sizeof *t);
    if (status == BST_OK) {
        status = t ? read_lines(ctx, text, t)
                   : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a table of a BRDF");
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%.400s", path);
        }
    }
    free(text);
    if (status != BST_OK) {
        bst_brdf_table_free(t);
        return status;
    }
    *out = t;
    return BST_OK;
}

/* log10 of a row's value at a direction cosine; constant beyond the ends. */
static double row_at(const bst_brdf_table *t, const row *r, double sin_out) {
    const point *p = t->points + r->first;
    int low = 0, high = r->count - 1;
    if (sin_out <= p[low].sin_out) {
        return p[low].log10_value;
    }
    if (sin_out >= p[high].sin_out) {
        return p[high].log10_value;
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(p[middle].sin_out <= sin_out ? &low : &high) = middle;
    }
    double span = p[high].sin_out - p[low].sin_out;
    double u = span > 0.0 ? (sin_out - p[low].sin_out) / span : 0.0;
    return p[low].log10_value + u * (p[high].log10_value - p[low].log10_value);
}

double bst_brdf_table_value(const bst_brdf_table *t, double sin_in, double sin_out) {
    int k = 0;
    while (k + 1 < t->row_count && t->rows[k + 1].sin_in <= sin_in) {
        k++;
    }
    const row *a = &t->rows[k], *b = k + 1 < t->row_count ? a + 1 : a;
    double offset = sin_out - sin_in; /* signed D */
    double span = b->sin_in - a->sin_in;
    double u = span > 0.0 ? fmin(fmax((sin_in - a->sin_in) / span, 0.0), 1.0) : 0.0;
    double low = row_at(t, a, a->sin_in + offset), high = row_at(t, b, b->sin_in + offset);
    return pow(10.0, low + u * (high - low));
}
