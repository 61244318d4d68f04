/* Tables of a run as CSV (RFC 4180). */
#ifndef BST_IO_CSV_H
#define BST_IO_CSV_H

#include <stdio.h>

#include "sim/io/run_reader.h"

/* Told from time to time how many rows are written; `user` is the caller's. */
typedef void (*bst_csv_progress)(void *user, int64_t rows);

/* Writes a cell of text: quoted where it must be, and where it is empty. Spreadsheets run a cell
 * that begins with = + - @, a tab or a carriage return as a formula, unless it is a number; an
 * apostrophe before it makes it text (OWASP, CSV Injection). */
void bst_csv_put_text(FILE *file, const char *text);

/* Writes what `sql` selects to `path`: a header row with the columns' names, then a row each; lines
 * end with CR LF as RFC 4180 has it. Reals have 17 significant digits, so that they read back as
 * the same double; NULL is an empty field; text as bst_csv_put_text writes it. The file appears
 * whole or not at all. Memory does not grow with the rows. `rows` (may be NULL) gets their number.
 * BST_ERR_IO with path and reason; BST_ERR_FORMAT when the database is damaged. */
bst_status bst_csv_write(bst_ctx *ctx, const bst_run_reader *reader, const char *sql,
                         const char *path, bst_csv_progress progress, void *user,
                         int64_t *rows) BST_MUST_CHECK;

#endif
