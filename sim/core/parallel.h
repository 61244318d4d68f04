/* Thread pool for parallel loops. */
#ifndef BST_CORE_PARALLEL_H
#define BST_CORE_PARALLEL_H

#include <pthread.h>
#include "boresight/status.h"

typedef struct bst_parallel bst_parallel;

/* Creates a pool of `threads` threads, including the caller of a loop; 0: one per available
 * processor, at most 32. They sleep between loops. If fewer can be started, loops use those. */
bst_status bst_parallel_create(bst_ctx *ctx, int threads, bst_parallel **out) BST_MUST_CHECK;
/* Frees a pool; no loop may be running. NULL is allowed. */
void bst_parallel_free(bst_parallel *pool);
/* Number of threads of a loop, including the caller's. */
int bst_parallel_threads(const bst_parallel *pool);

/* Body of a loop: indices begin <= i < end. Called concurrently. */
typedef void (*bst_parallel_fn)(void *user, int begin, int end);

/* Calls fn for parts of at most `grain` >= 1 indices that cover 0 <= i < count once; returns when
 * all are complete. pool NULL: on the caller's thread. One loop at a time per pool: callers on
 * several threads need a lock. */
void bst_parallel_for(bst_parallel *pool, int count, int grain, bst_parallel_fn fn, void *user);

/* stack size of every thread: frames take up to 192 KiB, an OpenCL compiler more */
#define BST_THREAD_STACK_BYTES (8 << 20)

/* Starts a thread by pthread_create with a stack of BST_THREAD_STACK_BYTES, independent of the
 * process's limit.
 *
 * Returned:  0, or an error number */
int bst_core_thread_start(pthread_t *thread, void *(*body)(void *user), void *user);

#endif
