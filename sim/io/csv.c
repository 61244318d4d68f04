#include "sim/io/csv.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void put_text(FILE *file, const char *text) {
    if (!strpbrk(text, ",\"\r\n") && *text) {
        fputs(text, file);
        return;
    }
    /* an empty text is quoted, so that it is not taken for NULL */
    putc('"', file);
    for (const char *c = text; *c; c++) {
        if (*c == '"') {
            putc('"', file);
        }
        putc(*c, file);
    }
    putc('"', file);
}

static void put_cell(FILE *file, const bst_rows *rows, int column) {
    switch (bst_rows_kind(rows, column)) {
        case BST_CELL_NULL:
            break;
        case BST_CELL_INT:
            fprintf(file, "%" PRId64, bst_rows_int(rows, column));
            break;
        case BST_CELL_REAL:
            fprintf(file, "%.17g", bst_rows_real(rows, column));
            break;
        case BST_CELL_TEXT:
            put_text(file, bst_rows_text(rows, column));
            break;
    }
}

static bst_status write_rows(bst_ctx *ctx, bst_rows *rows, FILE *file, bst_csv_progress progress,
                             void *user, int64_t *count) {
    int columns = bst_rows_columns(rows);
    for (int i = 0; i < columns; i++) {
        put_text(file, bst_rows_column_name(rows, i));
        fputs(i + 1 < columns ? "," : "\r\n", file);
    }
    for (;;) {
        bool more;
        BST_TRY(bst_rows_next(ctx, rows, &more));
        if (!more || ferror(file)) {
            return BST_OK;
        }
        for (int i = 0; i < columns; i++) {
            put_cell(file, rows, i);
            fputs(i + 1 < columns ? "," : "\r\n", file);
        }
        if (++*count % 1024 == 0 && progress) {
            progress(user, *count);
        }
    }
}

bst_status bst_csv_write(bst_ctx *ctx, const bst_run_reader *reader, const char *sql,
                         const char *path, bst_csv_progress progress, void *user, int64_t *rows) {
    char draft[4096];
    int64_t count = 0;
    bst_rows *query;
    BST_TRY(bst_rows_open(ctx, reader, sql, 0, 0, &query));
    int n = snprintf(draft, sizeof draft, "%s.tmp.%ld", path, (long)getpid());
    FILE *file = n > 0 && (size_t)n < sizeof draft ? fopen(draft, "wbe") : NULL;
    if (!file) {
        bst_rows_close(query);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
    }
    errno = 0;
    bst_status status = write_rows(ctx, query, file, progress, user, &count);
    bst_rows_close(query);
    bool ok = fflush(file) == 0 && !ferror(file) && fsync(fileno(file)) == 0;
    ok = fclose(file) == 0 && ok;
    if (status == BST_OK && (!ok || rename(draft, path) != 0)) {
        status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
    }
    if (status != BST_OK) {
        unlink(draft);
    } else if (rows) {
        *rows = count;
    }
    return status;
}
