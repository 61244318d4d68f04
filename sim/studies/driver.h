/* Driver of a study: assigns missing runs to an executor in shards, until all rows exist or no
 * progress is possible. */
#ifndef BST_STUDIES_DRIVER_H
#define BST_STUDIES_DRIVER_H

#include "sim/studies/executor.h"
#include "sim/studies/results.h"

typedef struct bst_driver_progress {
    int64_t runs, done, failed;           /* including runs in progress */
    double elapsed_s, runs_per_s, left_s; /* NAN: not known yet */
} bst_driver_progress;

typedef struct bst_driver_options {
    const char *out; /* the study's folder */
    const bst_study_kind *kind;
    double shard_s;     /* intended duration of a shard, s */
    double run_s;       /* expected duration of a run, s; 0: unknown */
    int64_t shard_runs; /* runs per shard; 0: from the two values above */
    int parallel; /* number of concurrent shards; shards get shorter towards the end, so that all
                     workers stay busy; 0: unknown, all shards are equal */
    bool probe;   /* executes one run first to measure its duration */
    void (*progress)(void *user, const bst_driver_progress *progress); /* NULL: none */
    void *user;
} bst_driver_options;

typedef struct bst_driver_outcome {
    int64_t done, failed, missing;
    int64_t attempts_lost;          /* shards that were killed or could not continue */
    char why[BST_SHARD_TEXT_BYTES]; /* reason of the latest loss; "": none */
} bst_driver_outcome;

/* Attempts per run. After the first loss the shard is cut into small ones, after the second into
 * single runs, which isolates a run that kills its shard. */
enum { BST_DRIVER_ATTEMPTS = 4 };

/* Executes the runs that `results` lacks and loads their rows. If runs stay missing it returns
 * BST_OK with *outcome. BST_ERR_INTERRUPTED: stop requested; completed runs are published. */
bst_status bst_driver_run(bst_ctx *ctx, bst_results *results, bst_executor *executor,
                          const bst_driver_options *options,
                          bst_driver_outcome *outcome) BST_MUST_CHECK;

#endif
