#define _GNU_SOURCE /* sched_getaffinity */
#include "sim/core/parallel.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdlib.h>

enum { MOST_THREADS = 32 };

struct bst_parallel {
    pthread_mutex_t lock;
    pthread_cond_t work, done;
    pthread_t workers[MOST_THREADS];
    int worker_count;
    bool stop;
    /* the current loop */
    bst_parallel_fn fn;
    void *user;
    int count, grain, next;
    int busy; /* parts in progress */
};

/* Executes parts of the loop until none is left; called and left with the lock held. */
static void take_parts(bst_parallel *pool) {
    while (pool->next < pool->count) {
        int begin = pool->next;
        int end = pool->count - begin > pool->grain ? begin + pool->grain : pool->count;
        pool->next = end;
        pool->busy++;
        pthread_mutex_unlock(&pool->lock);
        pool->fn(pool->user, begin, end);
        pthread_mutex_lock(&pool->lock);
        pool->busy--;
    }
}

/* Main loop of a worker thread. */
static void *work(void *argument) {
    bst_parallel *pool = argument;
    pthread_mutex_lock(&pool->lock);
    while (!pool->stop) {
        if (pool->next < pool->count) {
            take_parts(pool);
            if (pool->busy == 0) {
                pthread_cond_signal(&pool->done);
            }
        } else {
            pthread_cond_wait(&pool->work, &pool->lock);
        }
    }
    pthread_mutex_unlock(&pool->lock);
    return NULL;
}

bst_status bst_parallel_create(bst_ctx *ctx, int threads, bst_parallel **out) {
    *out = NULL;
    bst_parallel *pool = calloc(1, sizeof *pool);
    if (!pool) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a pool of threads");
    }
    if (threads <= 0) {
        cpu_set_t own;
        int processors = sched_getaffinity(0, sizeof own, &own) == 0 ? CPU_COUNT(&own) : 1;
        threads = processors < 1 ? 1 : processors > MOST_THREADS ? MOST_THREADS : processors;
    }
    pthread_mutex_init(&pool->lock, NULL);
    pthread_cond_init(&pool->work, NULL);
    pthread_cond_init(&pool->done, NULL);
    for (int i = 0; i < threads - 1 && i < MOST_THREADS; i++) {
        if (bst_core_thread_start(&pool->workers[i], work, pool) != 0) {
            break;
        }
        pool->worker_count++;
    }
    *out = pool;
    return BST_OK;
}

void bst_parallel_free(bst_parallel *pool) {
    if (!pool) {
        return;
    }
    pthread_mutex_lock(&pool->lock);
    pool->stop = true;
    pthread_cond_broadcast(&pool->work);
    pthread_mutex_unlock(&pool->lock);
    for (int i = 0; i < pool->worker_count; i++) {
        pthread_join(pool->workers[i], NULL);
    }
    pthread_cond_destroy(&pool->work);
    pthread_cond_destroy(&pool->done);
    pthread_mutex_destroy(&pool->lock);
    free(pool);
}

int bst_parallel_threads(const bst_parallel *pool) {
    return pool ? pool->worker_count + 1 : 1;
}

void bst_parallel_for(bst_parallel *pool, int count, int grain, bst_parallel_fn fn, void *user) {
    assert(count >= 0 && grain >= 1 && fn);
    if (!pool || pool->worker_count == 0 || count <= grain) {
        for (int begin = 0; begin < count;) {
            int end = count - begin > grain ? begin + grain : count;
            fn(user, begin, end);
            begin = end;
        }
        return;
    }
    pthread_mutex_lock(&pool->lock);
    pool->fn = fn;
    pool->user = user;
    pool->grain = grain;
    pool->next = 0;
    pool->count = count;
    /* no more than there are parts: the others would only contend for the lock */
    for (int i = 0; i < pool->worker_count && i < (count - 1) / grain; i++) {
        pthread_cond_signal(&pool->work);
    }
    take_parts(pool);
    while (pool->busy > 0) {
        pthread_cond_wait(&pool->done, &pool->lock);
    }
    pool->count = 0;
    pthread_mutex_unlock(&pool->lock);
}

int bst_core_thread_start(pthread_t *thread, void *(*body)(void *user), void *user) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error) {
        return error;
    }
    error = pthread_attr_setstacksize(&attributes, BST_THREAD_STACK_BYTES);
    if (!error) {
        error = pthread_create(thread, &attributes, body, user);
    }
    pthread_attr_destroy(&attributes);
    return error;
}
