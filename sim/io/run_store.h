/* The run store: folder "<out>.partial", renamed to "<out>" when complete, with SQLite tables
 * (run.sqlite). */
#ifndef BST_IO_RUN_STORE_H
#define BST_IO_RUN_STORE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* File of an unfinished run's folder: the saved state from which the run can go on. */
#define BST_RUN_STATE "state"

typedef struct bst_run bst_run;
typedef struct bst_io_table bst_io_table;

/* Creates "<out>.partial" (and its parents) with an empty database. Nothing is written before this
 * call.
 *
 * Errors:    BST_ERR_IO with path and reason; BST_ERR_ARGUMENT: empty path. Nothing
 *            remains after an error.
 * Notes:     An existing <out> is refused (BST_ERR_IO) unless `overwrite` is set. Then
 *            its run is replaced when the new one completes, provided that the folder is empty or
 *            contains a run (run.sqlite). Only files of a run (bst_run_owns) and its page are
 *            removed.
 *            The .partial folder of a dead run is replaced with a warning; that of a running
 *            process (lock) is refused. */
bst_status bst_run_create(bst_ctx *ctx, const char *out_path, bool overwrite,
                          bst_run **out) BST_MUST_CHECK;

/* Opens "<out>.partial" of an interrupted run to go on writing it. Create its tables next, by the
 * same calls as before, then restore what they held with bst_run_archive.
 *
 * Errors:    as bst_run_create; BST_ERR_NOT_FOUND: there is no interrupted run
 * Notes:     nothing is changed before bst_run_archive. */
bst_status bst_run_reopen(bst_ctx *ctx, const char *out_path, bool overwrite,
                          bst_run **out) BST_MUST_CHECK;
/* True if a run was opened by bst_run_reopen. */
bool bst_run_is_reopened(const bst_run *run);

/* Saves how many rows each table has, or removes the rows after the saved ones.
 *
 * Errors:    BST_ERR_FORMAT: a table has fewer rows than were saved, or a saved one is not made;
 *            BST_ERR_IO
 * Notes:     commits the rows; saving also flushes them to disk. Tables that the saved run did not
 *            have are emptied. */
bst_status bst_run_archive(bst_ctx *ctx, bst_run *run, bst_archive *archive) BST_MUST_CHECK;

/* The folder that is being written ("<out>.partial"); owned by the run. */
const char *bst_run_folder(const bst_run *run);

/* Path of a file in the run's folder. BST_ERR_ARGUMENT: too long. */
bst_status bst_run_file(bst_ctx *ctx, const bst_run *run, const char *name, char *buffer,
                        size_t bytes) BST_MUST_CHECK;

/* Closes the tables (run.sqlite without journal) and flushes all files to disk; no more rows are
 * accepted. Then write the manifest and call bst_run_finish or bst_run_abandon. BST_ERR_IO with
 * file and reason. */
bst_status bst_run_seal(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Completes a run: seals it if necessary and renames its folder. Frees `run`, also after an error,
 * when the .partial folder stays. BST_ERR_IO: another run has taken the name. */
bst_status bst_run_finish(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Abandons a run: commits its rows if possible and frees `run`; "<out>.partial" stays readable.
 * NULL is allowed. */
void bst_run_abandon(bst_run *run);

/* Free disk space for this user at `path` or its nearest existing parent, bytes; -1: unknown. */
int64_t bst_run_free_bytes(const char *path);

typedef enum bst_io_column_type {
    BST_COLUMN_INT,
    BST_COLUMN_REAL,
    BST_COLUMN_TEXT,
} bst_io_column_type;

/* A table column. `name` includes the unit (x_px, ra_deg); unit and doc go to the table
 * "columns". */
typedef struct bst_io_column {
    const char *name;
    bst_io_column_type type;
    const char *unit; /* "px", "deg", "" ... */
    const char *doc;
} bst_io_column;

/* A table cell. Non-finite numbers and NULL text are stored as SQL NULL. */
typedef struct bst_io_value {
    bst_io_column_type type;
    bool is_null;
    union {
        int64_t integer;
        double real;
        const char *text;
    } as;
} bst_io_value;

static inline bst_io_value bst_io_int_value(int64_t value) {
    bst_io_value v;
    v.type = BST_COLUMN_INT;
    v.is_null = false;
    v.as.integer = value;
    return v;
}
static inline bst_io_value bst_io_real_value(double value) {
    bst_io_value v;
    v.type = BST_COLUMN_REAL;
    v.is_null = !isfinite(value);
    v.as.real = value;
    return v;
}
static inline bst_io_value bst_io_text_value(const char *value) {
    bst_io_value v;
    v.type = BST_COLUMN_TEXT;
    v.is_null = value == NULL;
    v.as.text = value;
    return v;
}

static inline bst_io_value bst_io_null_value(bst_io_column_type type) {
    bst_io_value v = bst_io_int_value(0);
    v.type = type;
    v.is_null = true;
    return v;
}

/* An integer, or NULL unless it is known. */
static inline bst_io_value bst_io_known_int_value(int64_t value, bool known) {
    return known ? bst_io_int_value(value) : bst_io_null_value(BST_COLUMN_INT);
}

/* Creates a table of `count` columns (1 to BST_TABLE_COLUMNS) and notes it in "tables" and
 * "columns". Names are ASCII letters, digits and underscores. The handle is owned by the run. */
#define BST_TABLE_COLUMNS 64

/* Creates a table of the run's database and describes its columns there.
 *
 * Given:     name     letters, digits and underscores, at most 63
 *            doc      one sentence
 *            columns  [count]
 *            count    1 to BST_TABLE_COLUMNS
 * Returned:  *out  NULL on error; it belongs to the run
 * Errors:    BST_ERR_ARGUMENT, BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_io_table_create(bst_ctx *ctx, bst_run *run, const char *name, const char *doc,
                               const bst_io_column *columns, int count,
                               bst_io_table **out) BST_MUST_CHECK;

/* True if the database has this table: also of a reopened run, whose program made it. */
bool bst_run_has_table(const bst_run *run, const char *name);

/* Appends a row with a value per column, of the column's type. Rows are committed in batches: after
 * 50,000 rows, or at the first row 2 s after the batch began. A killed run loses at most one
 * batch. */
bst_status bst_io_table_append(bst_ctx *ctx, bst_io_table *table,
                               const bst_io_value *values) BST_MUST_CHECK;

/* Commits the current batch. BST_ERR_IO also if the folder was moved. */
bst_status bst_run_commit(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Called before each commit, so that files contain what the rows refer to. If it fails, the batch
 * is rolled back and the commit fails. */
typedef bst_status (*bst_run_before_commit)(bst_ctx *ctx, void *user);
/* Sets the function that runs before each commit of the database; NULL: none. */
void bst_run_set_before_commit(bst_run *run, bst_run_before_commit before, void *user);

#ifdef __cplusplus
}
#endif

#endif
