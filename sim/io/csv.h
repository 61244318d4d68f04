/* Tables of a run as CSV (RFC 4180). */
#ifndef BST_IO_CSV_H
#define BST_IO_CSV_H

#include <stdio.h>

#include "sim/io/run_reader.h"

/* Progress callback: number of rows written so far. */
typedef void (*bst_csv_progress)(void *user, int64_t rows);

/* Writes a text cell; quotes it if required or empty. Spreadsheets execute cells that begin with =
 * + - @, tab or carriage return as formulas, unless they are numbers; an apostrophe prevents this
 * (OWASP, CSV Injection). */
void bst_csv_put_text(FILE *file, const char *text);

/* Writes the result of a query `sql` to the CSV file `path`: a header row with column names, then
 * the rows; line ends CR LF (RFC 4180). Reals have 17 significant digits and are recovered exactly;
 * NULL is an empty field; text as by bst_csv_put_text. The file appears complete or not at all.
 * Memory is constant. `rows` (may be NULL): number of rows. BST_ERR_IO with path and reason;
 * BST_ERR_FORMAT: damaged database. */
bst_status bst_csv_write(bst_ctx *ctx, const bst_run_reader *reader, const char *sql,
                         const char *path, bst_csv_progress progress, void *user,
                         int64_t *rows) BST_MUST_CHECK;

#endif
