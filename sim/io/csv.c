#include "sim/io/csv.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/draft_file.h"

void bst_csv_put_text(FILE *file, const char *text) {
    char *end;
    bool number = strspn(text, "+-.eE0123456789") == strlen(text) && (strtod(text, &end), !*end);
    bool formula = *text && strchr("=+-@\t\r", *text) && !number;
    if (!strpbrk(text, ",\"\r\n") && *text && !formula) {
        fputs(text, file);
        return;
    }
    /* empty text is quoted: an empty field means NULL */
    fputs(formula ? "\"'" : "\"", file);
    for (const char *c = text; *c; c++) {
        if (*c == '"') {
            putc('"', file);
        }
        putc(*c, file);
    }
    putc('"', file);
}

/* Writes a CSV cell, quoted if needed. */
static void put_cell(FILE *file, const bst_io_rows *rows, int column) {
    switch (bst_io_rows_kind(rows, column)) {
        case BST_CELL_NULL:
            break;
        case BST_CELL_INT:
            fprintf(file, "%" PRId64, bst_io_rows_int(rows, column));
            break;
        case BST_CELL_REAL:
            fprintf(file, "%.17g", bst_io_rows_real(rows, column));
            break;
        case BST_CELL_TEXT:
            bst_csv_put_text(file, bst_io_rows_text(rows, column));
            break;
    }
}

static bst_status write_rows(bst_ctx *ctx, bst_io_rows *rows, FILE *file, bst_csv_progress progress,
                             void *user, int64_t *count) {
    int columns = bst_io_rows_columns(rows);
    for (int i = 0; i < columns; i++) {
        bst_csv_put_text(file, bst_io_rows_column_name(rows, i));
        fputs(i + 1 < columns ? "," : "\r\n", file);
    }
    for (;;) {
        bool more;
        BST_TRY(bst_io_rows_next(ctx, rows, &more));
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
    bst_draft draft;
    int64_t count = 0;
    bst_io_rows *query;
    BST_TRY(bst_io_rows_open(ctx, reader, sql, 0, 0, &query));
    bst_status status = bst_draft_open(ctx, path, &draft);
    if (status == BST_OK) {
        status = write_rows(ctx, query, draft.stream, progress, user, &count);
        status = bst_draft_close(ctx, &draft, status);
    }
    bst_io_rows_close(query);
    if (status == BST_OK && rows) {
        *rows = count;
    }
    return status;
}
