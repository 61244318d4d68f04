/* Reads the folder of a run in any state (complete, running, killed). It never changes the
 * folder. */
#ifndef BST_IO_RUN_READER_H
#define BST_IO_RUN_READER_H

#include <stdbool.h>
#include <stdint.h>

#include "sim/astro/time.h"

struct cJSON;

typedef enum bst_run_state {
    BST_RUN_COMPLETE,
    BST_RUN_INTERRUPTED, /* stopped and closed before its end */
    BST_RUN_RUNNING,     /* a running process writes it */
    BST_RUN_KILLED       /* its process ended without closing it */
} bst_run_state;

typedef struct bst_run_reader bst_run_reader;

/* Opens a run's folder. Missing or damaged parts are reported as problems (below), not as errors;
 * other parts are readable. Uncommitted journal entries are read too. Errors: BST_ERR_NOT_FOUND: no
 * such path; BST_ERR_FORMAT: no folder or no run in it; BST_ERR_IO: not readable. The caller closes
 * it. */
bst_status bst_run_reader_open(bst_ctx *ctx, const char *path, bst_run_reader **out) BST_MUST_CHECK;
/* file name of a study's tables */
#define BST_STUDY_DATABASE "study.sqlite"
/* Opens the tables in a study's folder; a study has no manifest, scenario or epoch.
 * BST_ERR_NOT_FOUND: missing; BST_ERR_FORMAT: not readable. */
bst_status bst_run_reader_open_study(bst_ctx *ctx, const char *path,
                                     bst_run_reader **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_run_reader_close(bst_run_reader *reader);

/* Folder of a run; it belongs to the reader. */
const char *bst_run_reader_folder(const bst_run_reader *reader);
/* State of a run: complete, interrupted, running or killed. */
bst_run_state bst_run_reader_state(const bst_run_reader *reader);
/* Name of a run's state: "complete", "interrupted", "still running", "left over from a killed
 * run". */
const char *bst_run_state_name(bst_run_state state);

/* Description of a problem in the run's folder; NULL after the last. */
const char *bst_run_reader_problem(const bst_run_reader *reader, int index);
/* Adds a problem that was found while reading parts of the run; at most 16 are kept. */
void bst_run_reader_note_problem(bst_run_reader *reader, const char *format, ...) BST_PRINTF(2, 3);

/* manifest.json of a run; NULL if missing or damaged. It belongs to the reader. */
const struct cJSON *bst_run_reader_manifest(const bst_run_reader *reader);
/* scenario.json of a run; NULL if missing or damaged. It belongs to the reader. */
const struct cJSON *bst_run_reader_scenario(const bst_run_reader *reader);
/* True if the run's database is open. */
bool bst_run_reader_has_tables(const bst_run_reader *reader);

/* Time of tick 0; false: unknown. */
bool bst_run_reader_epoch(const bst_run_reader *reader, bst_time *epoch);

/* Path of a file in the run's folder. BST_ERR_ARGUMENT: too long. */
bst_status bst_run_reader_file(bst_ctx *ctx, const bst_run_reader *reader, const char *name,
                               char *buffer, size_t bytes) BST_MUST_CHECK;

/* Limits the work of all queries from now on until the next call, so that tables of others cannot
 * keep the program busy for ever. A query beyond it fails with BST_ERR_FORMAT.
 *
 * Given:     steps  of SQLite's virtual machine, about 1e8 in a second; 0: no limit */
void bst_run_reader_allow(bst_run_reader *reader, int64_t steps);

/* Ends the query that another thread is making, if there is one: it fails with BST_ERR_FORMAT. */
void bst_run_reader_interrupt(bst_run_reader *reader);

/* A query on the run's tables, row by row, in constant memory. */
typedef struct bst_io_rows bst_io_rows;

/* Prepares one SELECT with up to two integer parameters (?1, ?2). The SQL function utc(seconds)
 * gives the time after the epoch as ISO 8601, to 1e-6 s. BST_ERR_FORMAT with SQLite's reason: no
 * such table or column, or damaged; BST_ERR_NOT_FOUND: the run has no database. */
bst_status bst_io_rows_open(bst_ctx *ctx, const bst_run_reader *reader, const char *sql,
                            int64_t parameter1, int64_t parameter2,
                            bst_io_rows **out) BST_MUST_CHECK;
/* Begins the query again with other parameters: what it has prepared is kept. */
void bst_io_rows_restart(bst_io_rows *rows, int64_t parameter1, int64_t parameter2);
/* Fetches the next row; *more false: no further row. BST_ERR_FORMAT: damaged file. */
bst_status bst_io_rows_next(bst_ctx *ctx, bst_io_rows *rows, bool *more) BST_MUST_CHECK;
/* Number of columns of the rows; columns count from 0. */
int bst_io_rows_columns(const bst_io_rows *rows);
/* Name of a column, from 0; it belongs to the rows. */
const char *bst_io_rows_column_name(const bst_io_rows *rows, int column);
/* True if a cell of the current row is NULL. */
bool bst_io_rows_is_null(const bst_io_rows *rows, int column);
/* Cell of the current row as an integer; 0 if NULL. */
int64_t bst_io_rows_int(const bst_io_rows *rows, int column);
/* Cell of the current row as a number; NAN if NULL. */
double bst_io_rows_real(const bst_io_rows *rows, int column);
/* Cell of the current row as text; "" if NULL. Valid until the next row. */
const char *bst_io_rows_text(const bst_io_rows *rows, int column);
typedef enum bst_io_cell_kind {
    BST_CELL_NULL,
    BST_CELL_INT,
    BST_CELL_REAL,
    BST_CELL_TEXT
} bst_io_cell_kind;
/* Kind of a cell of the current row. */
bst_io_cell_kind bst_io_rows_kind(const bst_io_rows *rows, int column);
/* Ends a query; NULL is allowed. */
void bst_io_rows_close(bst_io_rows *rows);

/* First integer of a query's only row; `fallback` if there is none or the query fails. */
int64_t bst_run_reader_int(const bst_run_reader *reader, const char *sql, int64_t parameter,
                           int64_t fallback);

#endif
