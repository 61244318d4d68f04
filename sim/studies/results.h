/* Results of runs: rows in memory, and the files of shards that carry them. */
#ifndef BST_STUDIES_RESULTS_H
#define BST_STUDIES_RESULTS_H

#include "sim/studies/kind.h"

typedef enum bst_row_state { BST_ROW_MISSING, BST_ROW_DONE, BST_ROW_FAILED } bst_row_state;

/* Why a run failed. */
typedef struct bst_study_row_error {
    int64_t run;
    char *text;
} bst_study_row_error;

/* Rows of a series of one run. */
typedef struct bst_study_series_part {
    int64_t run;
    size_t first; /* row */
    int rows;
} bst_study_series_part;

typedef struct bst_results {
    const bst_study *study;
    const bst_study_kind *kind;
    uint8_t *state;  /* [runs], bst_row_state */
    double *metrics; /* [runs][metric_count] */
    double *wall_s;  /* [runs] */
    double *cpu_s;   /* [runs], of all threads */
    bst_study_row_error *errors;
    int64_t error_count, error_room;
    bst_study_series_part *parts;
    int64_t part_count, part_room;
    double *series; /* [series_rows][series_count] */
    size_t series_rows, series_room;
    int64_t done, failed; /* runs of these states */
    int64_t doubled;      /* rows that were there already */
    int64_t differing;    /* of them: other than what was there */
} bst_results;

/* Forgets the row of a run: it is to be made again. */
void bst_results_forget(bst_results *results, int64_t run);

/* Allocates empty results for all runs of a study.
 *
 * Given:     study, kind  must outlive the results
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_results_free */
bst_status bst_results_create(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                              bst_results *out) BST_MUST_CHECK;
/* Frees the memory of the results and clears the struct, which belongs to the caller. */
void bst_results_free(bst_results *results);

/* Why a run failed; NULL when it did not. */
const char *bst_results_error(const bst_results *results, int64_t run);
/* Sorts errors and series by run, once all is loaded. */
void bst_results_sort(bst_results *results);

/* ------------------------------------------------------------------ files of shards */

/* A shard's rows on their way to its file. */
typedef struct bst_study_shard_draft {
    FILE *stream;
    char *text;
    size_t bytes;
    int64_t first, count;
    const bst_study_kind *kind;
} bst_study_shard_draft;

/* Begins the file of a shard in memory: writes its header.
 *
 * Given:     first  number of the shard's first run
 * Errors:    BST_ERR_MEMORY */
bst_status bst_study_shard_begin(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                                 int64_t first, bst_study_shard_draft *out) BST_MUST_CHECK;
/* The next run's row. `error`: NULL when it did what it should. */
void bst_study_shard_add(bst_study_shard_draft *draft, const bst_study_result *result,
                         double wall_s, const char *error);
/* Publishes the rows as OUT/shards/FIRST-LAST.rows: whole, on the disk, and only if no such file is
 * there yet (then what is there stands). Without rows: nothing. Frees the draft in every case. */
bst_status bst_study_shard_publish(bst_ctx *ctx, bst_study_shard_draft *draft,
                                   const char *out) BST_MUST_CHECK;
/* Frees a draft without writing it, and clears it. */
void bst_study_shard_drop(bst_study_shard_draft *draft);

/* Path of the file of runs first .. first + count - 1. */
bst_status bst_study_shard_path(bst_ctx *ctx, const char *out, int64_t first, int64_t count,
                                char *path, size_t bytes) BST_MUST_CHECK;
/* Takes the rows of a file. Rows that are there already stay as they are. BST_ERR_NOT_FOUND: there
 * is no such file; BST_ERR_FORMAT: it is damaged, or its rows are not those of the runs of its
 * name; BST_ERR_STATE: it is another study's. */
bst_status bst_results_load(bst_ctx *ctx, bst_results *results, const char *path) BST_MUST_CHECK;
/* Takes all files of OUT/shards that have runs of first .. first + count - 1. `clean`: removes what
 * dead workers left, and puts aside (bst_results_reject) damaged files and what is no file. */
bst_status bst_results_load_folder(bst_ctx *ctx, bst_results *results, const char *out,
                                   int64_t first, int64_t count, bool clean) BST_MUST_CHECK;
/* Puts a shard's file aside as PATH.rejected, so that its runs can be made again under its name,
 * and logs a warning that begins with `why`. */
void bst_results_reject(bst_ctx *ctx, const char *path, const char *why);

#endif
