/* Queue of frames that a thread compresses and writes as FITS extensions, in order. */
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/parallel.h"
#include "sim/io/fits_internal.h"

/* maximum number of queued frames: enough to balance the load, few to lose if the process dies */
#define DEPTH 4

typedef struct slot {
    bst_fits_frame frame;
    uint16_t *pixels;
    size_t capacity;
    int width, height;
    int64_t number;
} slot;

typedef struct bst_fits_queue {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    slot slots[DEPTH];
    int first, count; /* the first frame is being written */
    bool stop;
    bst_status status; /* of the writing thread; it keeps the first error */
    bst_ctx ctx;       /* of the writing thread */
} bst_fits_queue;

/* Thread that writes the queued frames to the FITS file. */
static void *work(void *argument) {
    bst_fits *fits = argument;
    bst_fits_queue *q = fits->queue;
    pthread_mutex_lock(&q->lock);
    for (;;) {
        while (q->count == 0 && !q->stop) {
            pthread_cond_wait(&q->changed, &q->lock);
        }
        if (q->count == 0) {
            break;
        }
        slot *s = &q->slots[q->first];
        bst_status status = q->status;
        pthread_mutex_unlock(&q->lock);
        if (status == BST_OK) {
            status = bst_fits_write_extension(&q->ctx, fits, &s->frame, s->pixels, s->width,
                                              s->height, s->number);
        }
        pthread_mutex_lock(&q->lock);
        q->status = status;
        q->first = (q->first + 1) % DEPTH;
        q->count--;
        pthread_cond_broadcast(&q->changed);
    }
    pthread_mutex_unlock(&q->lock);
    return NULL;
}

bst_status bst_fits_queue_create(bst_ctx *ctx, bst_fits *fits) {
    if (!fits_is_reentrant()) {
        return BST_OK; /* cfitsio without thread support: compress in the caller's thread */
    }
    bst_fits_queue *q = calloc(1, sizeof *q);
    if (!q) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bst_ctx_init(&q->ctx, NULL, NULL, BST_LOG_ERROR);
    pthread_mutex_init(&q->lock, NULL);
    pthread_cond_init(&q->changed, NULL);
    fits->queue = q;
    /* signals go to the main thread */
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = bst_core_thread_start(&q->thread, work, fits);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (error) {
        pthread_cond_destroy(&q->changed);
        pthread_mutex_destroy(&q->lock);
        free(q);
        fits->queue = NULL;
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: cannot start a thread: %s", fits->path,
                        strerror(error));
    }
    return BST_OK;
}

/* Returns the error of the writing thread; the lock is held. */
static bst_status report(bst_ctx *ctx, const bst_fits_queue *q) {
    return q->status == BST_OK ? BST_OK : bst_fail(ctx, q->status, "%s", q->ctx.message);
}

bst_status bst_fits_queue_put(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                              const uint16_t *pixels, int width, int height, int64_t number) {
    bst_fits_queue *q = fits->queue;
    pthread_mutex_lock(&q->lock);
    while (q->count == DEPTH && q->status == BST_OK) {
        pthread_cond_wait(&q->changed, &q->lock);
    }
    bst_status status = report(ctx, q);
    if (status != BST_OK) {
        pthread_mutex_unlock(&q->lock);
        return status;
    }
    slot *s = &q->slots[(q->first + q->count) % DEPTH];
    pthread_mutex_unlock(&q->lock);
    /* only this thread fills slots: a free slot stays free */
    size_t bytes = (size_t)width * (size_t)height * sizeof *pixels;
    if (bytes > s->capacity) {
        free(s->pixels);
        s->pixels = malloc(bytes);
        s->capacity = s->pixels ? bytes : 0;
        if (!s->pixels) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory for a frame", fits->path);
        }
    }
    memcpy(s->pixels, pixels, bytes);
    s->frame = *frame;
    s->width = width;
    s->height = height;
    s->number = number;
    pthread_mutex_lock(&q->lock);
    q->count++;
    pthread_cond_broadcast(&q->changed);
    pthread_mutex_unlock(&q->lock);
    return BST_OK;
}

bst_status bst_fits_queue_drain(bst_ctx *ctx, bst_fits *fits) {
    bst_fits_queue *q = fits->queue;
    pthread_mutex_lock(&q->lock);
    while (q->count > 0) {
        pthread_cond_wait(&q->changed, &q->lock);
    }
    bst_status status = report(ctx, q);
    pthread_mutex_unlock(&q->lock);
    return status;
}

void bst_fits_queue_free(bst_fits *fits) {
    bst_fits_queue *q = fits->queue;
    if (!q) {
        return;
    }
    pthread_mutex_lock(&q->lock);
    q->stop = true;
    pthread_cond_broadcast(&q->changed);
    pthread_mutex_unlock(&q->lock);
    pthread_join(q->thread, NULL);
    for (int i = 0; i < DEPTH; i++) {
        free(q->slots[i].pixels);
    }
    pthread_cond_destroy(&q->changed);
    pthread_mutex_destroy(&q->lock);
    free(q);
    fits->queue = NULL;
}
