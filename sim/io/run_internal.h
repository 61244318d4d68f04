/* Internal state of the run store, shared by run_store.c, run_folder.c (folder) and run_tables.c
 * (database). */
#ifndef BST_IO_RUN_INTERNAL_H
#define BST_IO_RUN_INTERNAL_H

#include <sqlite3.h>
#include <time.h>

#include "sim/io/run_store.h"

#define BST_RUN_PATH_BYTES 4096
#define BST_RUN_DATABASE "run.sqlite"
#define BST_RUN_LOCK "lock"

struct bst_io_table {
    bst_run *run;
    bst_io_table *next;
    sqlite3_stmt *insert;
    char name[64];
    int columns;
    int64_t rows;
    bst_io_column_type types[BST_TABLE_COLUMNS];
};

struct bst_run {
    char out[BST_RUN_PATH_BYTES];    /* final name */
    char folder[BST_RUN_PATH_BYTES]; /* out + ".partial" */
    bool overwrite;
    bool reopened; /* the tables are there already */
    int lock;      /* file descriptor with the lock on folder/lock */
    sqlite3 *db;
    bst_io_table *tables;
    sqlite3_stmt *note_table, *note_column;
    bool in_batch;
    int batch_rows;
    struct timespec batch_start;
    bst_run_before_commit before_commit;
    void *before_commit_user;
};

/* Joins folder and file name; BST_ERR_ARGUMENT: too long. */
bst_status bst_run_path_join(bst_ctx *ctx, char *buffer, size_t bytes, const char *folder,
                             const char *name) BST_MUST_CHECK;

/* Checks that the run's folder was not removed, moved or replaced. */
bst_status bst_run_check_folder(bst_ctx *ctx, const bst_run *run) BST_MUST_CHECK;

/* Creates the run's SQLite database with the tables that describe all others; opens that of a
 * reopened run.
 *
 * Errors:    BST_ERR_IO */
bst_status bst_run_open_database(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;
/* Commits, merges the journal and closes the run's database, also after an error. Nothing happens
 * if it is closed. */
bst_status bst_run_close_database(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

#endif
