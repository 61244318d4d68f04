/* What the parts of the Slurm executor share. */
#ifndef BST_STUDIES_SLURM_INTERNAL_H
#define BST_STUDIES_SLURM_INTERNAL_H

#include <stdbool.h>

#include "sim/studies/slurm.h"

enum { BST_SLURM_NAME_BYTES = 32, BST_SLURM_TOKEN_BYTES = 32, BST_SLURM_PATH_BYTES = 4096 };

typedef struct bst_slurm_task {
    bst_study_shard_job job;
    int64_t array;   /* Slurm's number of the array; 0: not submitted yet */
    int64_t index;   /* in the array */
    int batch;       /* number of the array in this driver, for its file names */
    double gone_s;   /* wall time when the queue first did not show it; 0: it does */
    bool seen, gone; /* in the latest look at the queue; gone: gone_s is set */
    bool held;       /* Slurm holds it after a failure: it would wait forever */
    char reason[64]; /* Slurm's, while it is held */
} bst_slurm_task;

typedef struct bst_slurm {
    bst_slurm_site site;
    char folder[BST_SLURM_PATH_BYTES]; /* the study's "slurm" */
    char name[BST_SLURM_NAME_BYTES];   /* of the study's jobs */
    char token[BST_SLURM_TOKEN_BYTES]; /* begins the names of this driver's files */
    char **program;                    /* NULL-terminated copy */
    bst_slurm_task *tasks;
    int64_t count, capacity;
    int batches;
    double looked_s, silent_s; /* wall times of the latest look, and of the last answer */
    bool cancelled;
} bst_slurm;

/* The path of a file in the folder "slurm". */
bst_status bst_slurm_path(bst_ctx *ctx, const bst_slurm *s, char out[BST_SLURM_PATH_BYTES],
                          const char *file) BST_MUST_CHECK;
/* The end of a text file as one line, the latest bytes that fit; "" when there is none. */
void bst_slurm_read_tail(const char *path, char *out, size_t out_bytes);
/* Runs a program of Slurm; its output goes line by line to `take`, what it says of errors to
 * `said`. *code is its exit status. */
bst_status bst_slurm_run(bst_ctx *ctx, const bst_slurm *s, const char *const argv[],
                         void (*take)(void *user, const char *line), void *user, int *code,
                         char said[BST_SHARD_TEXT_BYTES]) BST_MUST_CHECK;
/* For bst_slurm_run: a line that begins with a job's number, for an int64_t. */
void bst_slurm_take_array(void *user, const char *line);
/* Submits what waits, as arrays of at most the site's size; stops where the controller is silent.
 */
bst_status bst_slurm_submit(bst_ctx *ctx, bst_slurm *s) BST_MUST_CHECK;

#endif
