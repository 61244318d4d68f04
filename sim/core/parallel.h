/* A few threads that share loops. */
#ifndef BST_CORE_PARALLEL_H
#define BST_CORE_PARALLEL_H

#include <pthread.h>
#include "boresight/status.h"

typedef struct bst_parallel bst_parallel;

/* Starts threads - 1 threads (the caller of a loop is the other one); 0: one per processor that
 * this process may run on, 32 at most. They sleep between loops. When fewer can be started the
 * loops run on those there are. */
bst_status bst_parallel_create(bst_ctx *ctx, int threads, bst_parallel **out) BST_MUST_CHECK;
/* NULL allowed; no loop may be running. */
void bst_parallel_free(bst_parallel *pool);
/* Threads that a loop runs on, the caller's included. */
int bst_parallel_threads(const bst_parallel *pool);

/* Part of a loop: indices begin <= i < end. Called from several threads at a time. */
typedef void (*bst_parallel_fn)(void *user, int begin, int end);

/* Calls fn for parts of at most `grain` >= 1 indices that together are 0 <= i < count, each once,
 * and returns when all are done. pool NULL: on the caller's thread alone. A pool runs one loop at a
 * time: callers on several threads take turns by a lock of their own. */
void bst_parallel_for(bst_parallel *pool, int count, int grain, bst_parallel_fn fn, void *user);

/* Stack of every thread that is started: frames take up to 192 KiB, an OpenCL compiler more. */
#define BST_THREAD_STACK_BYTES (8 << 20)

/* pthread_create with a stack of BST_THREAD_STACK_BYTES, whatever the limit of the process is.
 * Returned: 0, or the error's number. */
int bst_core_thread_start(pthread_t *thread, void *(*body)(void *user), void *user);

#endif
