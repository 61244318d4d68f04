/* Writes the tables of a study to a database and to CSV files. */
#ifndef BST_STUDIES_TABLE_OUT_H
#define BST_STUDIES_TABLE_OUT_H

#include "sim/io/draft_file.h"
#include "sim/io/run_store.h"

struct sqlite3;
struct sqlite3_stmt;

/* A new database "FOLDER/study.sqlite" and its CSV files: all appear at the end, or none. */
typedef struct bst_tables_out {
    struct sqlite3 *db;
    char folder[2048], draft[2176];
} bst_tables_out;

typedef struct bst_table_out {
    bst_tables_out *tables;
    struct sqlite3_stmt *insert;
    bst_draft csv;
    bool with_csv;
    int columns;
    char name[80];
} bst_table_out;

/* Begins the tables of a study: a draft of study.sqlite in a folder.
 *
 * Errors:    BST_ERR_ARGUMENT for too long a path, BST_ERR_IO */
bst_status bst_tables_begin(bst_ctx *ctx, const char *folder, bst_tables_out *out) BST_MUST_CHECK;
/* Ends the tables. Status BST_OK: renames the database to its final name. Otherwise, or on failure:
 * removes it. */
bst_status bst_tables_end(bst_ctx *ctx, bst_tables_out *tables, bst_status status) BST_MUST_CHECK;

/* Definition of a table. */
typedef struct bst_table_design {
    const char *name, *doc;
    const bst_io_column *columns; /* [count] */
    int count;
    bool csv; /* also as a CSV file */
} bst_table_design;

/* Begins a table of `count` columns, and FOLDER/<name>.csv if `csv`; the table "columns" describes
 * unit and meaning. */
bst_status bst_table_begin(bst_ctx *ctx, bst_tables_out *tables, const bst_table_design *design,
                           bst_table_out *out) BST_MUST_CHECK;

/* Appends a row to a table and to its CSV file.
 *
 * Given:     values  one for each column
 * Errors:    BST_ERR_IO */
bst_status bst_table_row(bst_ctx *ctx, bst_table_out *table,
                         const bst_io_value *values) BST_MUST_CHECK;

/* Ends a table.
 *
 * Given:     status  result so far; an error drops the CSV file
 * Returned:  status, or the error of closing the CSV file */
bst_status bst_table_end(bst_ctx *ctx, bst_table_out *table, bst_status status) BST_MUST_CHECK;

#endif
