/* Has the runs of a study executed: what is missing goes to an executor, shard by shard, until all
 * rows are there or nothing more can be done. */
#ifndef BST_STUDIES_DRIVER_H
#define BST_STUDIES_DRIVER_H

#include "sim/studies/executor.h"
#include "sim/studies/results.h"

typedef struct bst_driver_progress {
    int64_t runs, done, failed;           /* with what is at work */
    double elapsed_s, runs_per_s, left_s; /* NAN: not known yet */
} bst_driver_progress;

typedef struct bst_driver_options {
    const char *out; /* the study's folder */
    const bst_study_kind *kind;
    double shard_s;     /* how long a shard is to take, seconds */
    double run_s;       /* a run, as far as that is known; 0: not at all */
    int64_t shard_runs; /* so many runs a shard; 0: by the two above */
    int parallel;       /* shards that will go at a time; towards the end they get shorter, so
                           that all are busy to the last. 0: not known, all are alike */
    bool probe;         /* one run goes first, alone, to tell how long a run takes */
    void (*progress)(void *user, const bst_driver_progress *progress); /* NULL: none */
    void *user;
} bst_driver_options;

typedef struct bst_driver_outcome {
    int64_t done, failed, missing;
    int64_t attempts_lost;          /* shards that were killed or could not go on */
    char why[BST_SHARD_TEXT_BYTES]; /* the latest of them; "" when there was none */
} bst_driver_outcome;

/* Attempts at a run before it is given up: after the first that is lost its shard is cut into small
 * ones, after the second into single runs, so that a run that kills its shard is alone in it. */
enum { BST_DRIVER_ATTEMPTS = 4 };

/* Executes what `results` lacks, and takes the rows into it. With runs that stay missing it returns
 * BST_OK too: *outcome tells. BST_ERR_INTERRUPTED: the user asked to stop; what was done is
 * published. */
bst_status bst_driver_run(bst_ctx *ctx, bst_results *results, bst_executor *executor,
                          const bst_driver_options *options,
                          bst_driver_outcome *outcome) BST_MUST_CHECK;

#endif
