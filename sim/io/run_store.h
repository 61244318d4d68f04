/* A run's folder: written as "<out>.partial", renamed to "<out>" when complete, with its SQLite
 * tables (run.sqlite). */
#ifndef BST_IO_RUN_STORE_H
#define BST_IO_RUN_STORE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bst_run bst_run;
typedef struct bst_io_table bst_io_table;

/* Makes "<out>.partial" (and missing parents, as mkdir -p) with an empty database in it. Nothing is
 * written before this call.
 * An existing <out> is refused with BST_ERR_IO unless `overwrite` is set: then its run is replaced
 * when the new one finishes, and only if it is an empty folder or holds a run (run.sqlite). Other
 * files and folders in it stay where they are; only those of a run (bst_run_owns) and its page are
 * removed.
 * A .partial that a dead run left is logged as a warning and replaced; one that a living process
 * still writes (it holds a lock on it) is refused.
 * Errors, which leave nothing behind: BST_ERR_IO with the path and the system's reason;
 * BST_ERR_ARGUMENT for an empty path. */
bst_status bst_run_create(bst_ctx *ctx, const char *out_path, bool overwrite,
                          bst_run **out) BST_MUST_CHECK;

/* The folder that is being written ("<out>.partial"); owned by the run. */
const char *bst_run_folder(const bst_run *run);

/* Path of a file in that folder. BST_ERR_ARGUMENT when it does not fit. */
bst_status bst_run_file(bst_ctx *ctx, const bst_run *run, const char *name, char *buffer,
                        size_t bytes) BST_MUST_CHECK;

/* Closes the tables (one run.sqlite, no journal beside it) and flushes every file to disk; no rows
 * are taken after it. What is left to do is the manifest and bst_run_finish or bst_run_abandon: a
 * manifest that is written after this speaks of data that are safe. BST_ERR_IO with file and
 * reason. */
bst_status bst_run_seal(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Completes the run: seals it where that was not done, and renames the folder to its final name in
 * one step. Frees `run` in every case; on an error the .partial folder stays. BST_ERR_IO when
 * another run took the name meanwhile. */
bst_status bst_run_finish(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Commits what there is as well as it can, and frees `run`; "<out>.partial" stays, readable. NULL
 * is allowed. */
void bst_run_abandon(bst_run *run);

/* Bytes that are free for this user where `path`, or the nearest folder above it that exists, lies;
 * -1 when the system does not tell. */
int64_t bst_run_free_bytes(const char *path);

typedef enum bst_io_column_type {
    BST_COLUMN_INT,
    BST_COLUMN_REAL,
    BST_COLUMN_TEXT,
} bst_io_column_type;

/* A column. `name` carries the unit as the project names fields (x_px, ra_deg); unit and doc go
 * into the table "columns". */
typedef struct bst_io_column {
    const char *name;
    bst_io_column_type type;
    const char *unit; /* "px", "deg", "" ... */
    const char *doc;
} bst_io_column;

/* A cell. What is no finite number (the magnitude of what sends no light, say) and NULL text are
 * stored as SQL NULL. */
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

/* Appends one row of as many values as the table has columns, of their types. Rows are committed in
 * batches: after 50,000 rows, or with the first row that comes 2 s after the batch's first, so that
 * a killed run loses no more than that. */
bst_status bst_io_table_append(bst_ctx *ctx, bst_io_table *table,
                               const bst_io_value *values) BST_MUST_CHECK;

/* Commits the open batch now. BST_ERR_IO also when the folder is no longer where it was made. */
bst_status bst_run_commit(bst_ctx *ctx, bst_run *run) BST_MUST_CHECK;

/* Has `before` called before each commit, so that files that rows speak of hold it first; when it
 * fails the batch is rolled back and the commit fails with it. NULL: none. */
typedef bst_status (*bst_run_before_commit)(bst_ctx *ctx, void *user);
/* Sets the function that runs before each commit of the database; NULL: none. */
void bst_run_set_before_commit(bst_run *run, bst_run_before_commit before, void *user);

#ifdef __cplusplus
}
#endif

#endif
