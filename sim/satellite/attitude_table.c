#include "sim/satellite/attitude_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/core/file.h"

enum { TABLE_ROWS_MAX = 1000000 };
#define TABLE_BYTES_MAX ((uint64_t)256 << 20)

/* Rows while they are read. */
typedef struct row_list {
    bst_attitude_row *rows;
    int count, capacity;
} row_list;

static bst_status append(bst_ctx *ctx, const char *path, row_list *list, double seconds,
                         bst_quat q) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 256;
        bst_attitude_row *rows = list->count < TABLE_ROWS_MAX
                                     ? realloc(list->rows, (size_t)capacity * sizeof *rows)
                                     : NULL;
        if (!rows) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for %d rows", path, capacity);
        }
        list->rows = rows;
        list->capacity = capacity;
    }
    list->rows[list->count++] = (bst_attitude_row){seconds, q};
    return BST_OK;
}

/* Reads the rows of a CSV table; `text` is changed. */
static bst_status read_csv(bst_ctx *ctx, const char *path, char *text, row_list *list) {
    int line = 0;
    for (char *at = text, *next; at; at = next) {
        next = strchr(at, '\n');
        if (next) {
            *next++ = '\0';
        }
        line++;
        double v[5];
        at += strspn(at, " \t\r");
        if (!*at || *at == '#' || strncmp(at, "time_s", 6) == 0) {
            continue;
        }
        int used = 0;
        bool good = sscanf(at, "%lf ,%lf ,%lf ,%lf ,%lf %n", &v[0], &v[1], &v[2], &v[3], &v[4],
                           &used) == 5 &&
                    at[used] == '\0';
        double norm = good ? sqrt(v[1] * v[1] + v[2] * v[2] + v[3] * v[3] + v[4] * v[4]) : 0.0;
        if (!good || !(fabs(norm - 1.0) < 1e-3) || !(fabs(v[0]) <= 1e9) ||
            (list->count > 0 && !(v[0] > list->rows[list->count - 1].seconds))) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%.400s: line %d: \"%.60s\" (allowed: time_s, qx, qy, qz, qw: "
                            "ascending times and unit quaternions)",
                            path, line, at);
        }
        BST_TRY(append(ctx, path, list, v[0], bst_quat_unit((bst_quat){v[1], v[2], v[3], v[4]})));
    }
    return list->count > 0 ? BST_OK : bst_fail(ctx, BST_ERR_CONFIG, "%.400s: no attitudes", path);
}

static bst_status read_text(bst_ctx *ctx, const bst_attitude_source *source, const char *path,
                            char *text, size_t bytes, const char *object, row_list *list) {
    if (bst_aem_is(text, bytes)) {
        return bst_aem_read(ctx, path, text, bytes, object, source->epoch, &list->rows,
                            &list->count);
    }
    BST_TRY(bst_file_check_text(ctx, path, text, bytes));
    return *object ? bst_fail(ctx, BST_ERR_CONFIG,
                              "%.400s: \"object\" is \"%.64s\", but a table is of one object "
                              "(allowed: an AEM or frame updates; or leave out \"object\")",
                              path, object)
                   : read_csv(ctx, path, text, list);
}

bst_status bst_attitude_table_load(bst_ctx *ctx, const bst_attitude_source *source,
                                   const char *file, const char *object, bst_attitude_row **rows,
                                   int *count) {
    char path[1100], *text;
    size_t bytes;
    *rows = NULL;
    *count = 0;
    bst_file_resolve(source->base_dir, file, path, sizeof path);
    size_t length = strlen(path);
    if (length > 5 && strcasecmp(path + length - 5, ".json") == 0) {
        return source->frames ? source->frames(ctx, source->user, path, object, rows, count)
                              : bst_fail(ctx, BST_ERR_CONFIG,
                                         "%.400s: frame updates need a scenario with sensors "
                                         "(allowed here: CSV, CCSDS AEM)",
                                         path);
    }
    if (bst_file_read(ctx, path, TABLE_BYTES_MAX, "a table of attitudes", &text, &bytes) !=
        BST_OK) {
        return BST_ERR_CONFIG;
    }
    row_list list = {.count = 0};
    bst_status status = read_text(ctx, source, path, text, bytes, object, &list);
    free(text);
    if (status != BST_OK) {
        free(list.rows);
        return status == BST_ERR_MEMORY ? status : BST_ERR_CONFIG;
    }
    *rows = list.rows;
    *count = list.count;
    return BST_OK;
}

bst_quat bst_attitude_table_at(const bst_attitude_row *rows, int count, double seconds) {
    int low = 0, high = count - 1;
    if (seconds < rows[low].seconds || high == 0) {
        return rows[low].q_body_from_gcrf;
    }
    if (seconds >= rows[high].seconds) {
        return rows[high].q_body_from_gcrf;
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(rows[middle].seconds <= seconds ? &low : &high) = middle;
    }
    const bst_attitude_row *a = &rows[low], *b = &rows[high];
    return bst_quat_slerp(a->q_body_from_gcrf, b->q_body_from_gcrf,
                          (seconds - a->seconds) / (b->seconds - a->seconds));
}

double bst_attitude_table_rate_radps(const bst_attitude_row *rows, int count, double seconds) {
    double most = 0.0;
    for (int i = 1; i < count; i++) {
        const bst_attitude_row *x = &rows[i - 1], *y = &rows[i];
        double dt = y->seconds - x->seconds;
        if (y->seconds < seconds - 60.0 || x->seconds > seconds + 60.0 || !(dt > 0.0)) {
            continue;
        }
        bst_quat p = x->q_body_from_gcrf, q = y->q_body_from_gcrf;
        double dot = fabs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w);
        most = fmax(most, 2.0 * acos(fmin(dot, 1.0)) / dt);
    }
    return most;
}
