/* Local executor of a study: worker processes, each bound to its own cores. */
#ifndef BST_STUDIES_LOCAL_POOL_H
#define BST_STUDIES_LOCAL_POOL_H

#include "sim/studies/executor.h"
#include "sim/studies/kind.h"

typedef struct bst_local_pool_options {
    const bst_study *study;
    const bst_study_kind *kind;
    const char *out;
    int workers;   /* as returned by bst_local_workers */
    int lock_fd;   /* closed in workers; -1: none */
    int cores;     /* per worker; 0: all cores in equal parts */
    bool unpinned; /* do not bind workers to cores */
    /* OpenCL devices, used in rotation; NULL: the default for all */
    const char *const *devices;
    int device_count;
} bst_local_pool_options;

/* Number of cores that this process may use. */
int bst_local_cores(void);

/* Number of workers: as requested; 0: one per device, or without devices one per available core. */
int bst_local_workers(int asked, int devices);

/* Creates the executor; workers are forked with their first shard. No OpenCL device may be open in
 * this process. Each worker first binds to its cores, limits PoCL to as many threads
 * (POCL_MAX_PTHREAD_COUNT; POCL_AFFINITY unset, because it binds all processes from core 0), and
 * takes a kernel cache of its own (POCL_CACHE_DIR, in the user's cache folder, reused by the next
 * study). The arguments must outlive the executor. */
bst_status bst_local_pool_open(bst_ctx *ctx, const bst_local_pool_options *options,
                               bst_executor *out) BST_MUST_CHECK;

/* Sets up this process as worker `index` of `workers` with a number of cores (0: equal parts).
 * Returns its cores. */
int bst_local_settle(int index, int workers, int cores, bool unpinned);

#endif
