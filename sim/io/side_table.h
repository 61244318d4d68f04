/* Side tables: CSV files with a row for each frame of picture files, which have no header. */
#ifndef BST_IO_SIDE_TABLE_H
#define BST_IO_SIDE_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_side_table bst_side_table;

/* Columns that say which picture a row is of, "A|B": the first one that the table has. */
typedef struct bst_side_table_columns {
    const char *file; /* path, relative to the table's folder */
    const char *page; /* of a TIFF file, from 1; a table may have none */
} bst_side_table_columns;

/* A row. */
typedef struct bst_side_table_row {
    const char *file; /* path; belongs to the table */
    int64_t page;     /* from 1; 0: the table does not say */
    int64_t line;     /* of the CSV file, from 1 */
} bst_side_table_row;

/* Reads a table: a line of column names, then rows (RFC 4180, no line ends in fields). Empty lines
 * and lines that begin with # are skipped. Upper and lower case of names are the same.
 *
 * Errors:    BST_ERR_NOT_FOUND, BST_ERR_IO, BST_ERR_MEMORY; BST_ERR_FORMAT with file, line and
 *            column: no row, a name twice, no column of files, another number of fields, an empty
 *            file name, a page that is no number
 * Ownership: free *out with bst_side_table_close */
bst_status bst_side_table_open(bst_ctx *ctx, const char *path,
                               const bst_side_table_columns *columns,
                               bst_side_table **out) BST_MUST_CHECK;
/* Frees a table; NULL is allowed. */
void bst_side_table_close(bst_side_table *table);

/* Number of rows, 1 or more. */
int64_t bst_side_table_count(const bst_side_table *table);
/* A row, from 0. */
bst_side_table_row bst_side_table_at(const bst_side_table *table, int64_t row);
/* Name of the column of files, for messages; it belongs to the table. */
const char *bst_side_table_file_column(const bst_side_table *table);
/* Name of the column of pages; "": none. */
const char *bst_side_table_page_column(const bst_side_table *table);

/* Value of a column in a row.
 *
 * Given:     bytes  room of value; a longer one is cut
 * Returned:  value  text without blanks at its ends
 *            false: the table has no such column */
bool bst_side_table_text(const bst_side_table *table, int64_t row, const char *column, char *value,
                         size_t bytes);

#endif
