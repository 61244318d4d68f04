/* Internal types of the Slurm executor. */
#ifndef BST_STUDIES_SLURM_INTERNAL_H
#define BST_STUDIES_SLURM_INTERNAL_H

#include <stdbool.h>

#include "sim/studies/slurm.h"

enum { BST_SLURM_NAME_BYTES = 32, BST_SLURM_TOKEN_BYTES = 32, BST_SLURM_PATH_BYTES = 4096 };

typedef struct bst_slurm_task {
    bst_study_shard_job job;
    int64_t array;   /* Slurm's job number of the array; 0: not submitted */
    int64_t index;   /* in the array */
    int batch;       /* number of the array in this driver, used in file names */
    double gone_s;   /* wall time at which the queue first lacked it; 0: in the queue */
    bool seen, gone; /* seen: in the latest queue listing; gone: gone_s is set */
    bool held;       /* Slurm holds it after a failure; it would wait forever */
    char reason[64]; /* reason from Slurm while held */
} bst_slurm_task;

typedef struct bst_slurm {
    bst_slurm_site site;
    char folder[BST_SLURM_PATH_BYTES]; /* folder "slurm" of the study */
    char name[BST_SLURM_NAME_BYTES];   /* name of the study's jobs */
    char token[BST_SLURM_TOKEN_BYTES]; /* prefix of this driver's files */
    char **program;                    /* NULL-terminated copy */
    bst_slurm_task *tasks;
    int64_t count, capacity;
    int batches;
    double looked_s, silent_s; /* wall times of the latest query, and of the last answer */
    bool cancelled;
} bst_slurm;

/* Path of a file in the folder "slurm". */
bst_status bst_slurm_path(bst_ctx *ctx, const bst_slurm *s, char out[BST_SLURM_PATH_BYTES],
                          const char *file) BST_MUST_CHECK;
/* Reads the end of a text file as one line, as much as fits; "": none. */
void bst_slurm_read_tail(const char *path, char *out, size_t out_bytes);
/* Runs a Slurm program; passes its output line by line to `take` and its errors to `said`. *code:
 * exit status. */
bst_status bst_slurm_run(bst_ctx *ctx, const bst_slurm *s, const char *const argv[],
                         void (*take)(void *user, const char *line), void *user, int *code,
                         char said[BST_SHARD_TEXT_BYTES]) BST_MUST_CHECK;
/* Callback of bst_slurm_run: reads the job number at the beginning of a line into an int64_t. */
void bst_slurm_take_array(void *user, const char *line);
/* Submits waiting tasks in arrays of at most the site's size; stops if the controller does not
 * answer. */
bst_status bst_slurm_submit(bst_ctx *ctx, bst_slurm *s) BST_MUST_CHECK;

#endif
