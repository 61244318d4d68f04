/* The executor of one machine: worker processes, each on cores of its own. */
#ifndef BST_STUDIES_LOCAL_POOL_H
#define BST_STUDIES_LOCAL_POOL_H

#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

typedef struct bst_local_pool_options {
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out;
    int workers;   /* as bst_local_workers has it */
    int lock_fd;   /* closed by workers, -1: none */
    int cores;     /* of each worker, 0: all, in equal parts */
    bool unpinned; /* leave the choice of cores to the system */
    /* OpenCL devices, which the workers take in turn; NULL: the default one for all */
    const char *const *devices;
    int device_count;
} bst_local_pool_options;

/* Cores that this process may run on. */
int bst_local_cores(void);

/* How many workers there are where so many are asked for, 0: one for each device, or without
 * devices for each core that this process may run on. */
int bst_local_workers(int asked, int devices);

/* Workers are started when they get their first shard: forks of this process, so that no OpenCL
 * device may have been opened in it. Before anything else each is bound to its own cores, limits
 * PoCL to as many threads (POCL_MAX_PTHREAD_COUNT, and POCL_AFFINITY unset: that binds the threads
 * of every process from core 0), and takes a cache of kernels that no other worker uses
 * (POCL_CACHE_DIR, in the user's cache folder, so that the next study finds it warm). What is given
 * is to live as long as the executor. */
bst_status bst_local_pool_open(bst_ctx *ctx, const bst_local_pool_options *options,
                               bst_executor *out) BST_MUST_CHECK;

/* Settles this process as such a worker: number `index` of `workers`, with so many cores (0: its
 * part of all). Returns its cores. */
int bst_local_settle(int index, int workers, int cores, bool unpinned);

#endif
