#include "scenegen/frame_pool.h"

#include <assert.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>

typedef struct pooled_frame {
    bst_frame frame;
    bst_frame_pool *pool;
    cl_mem buffer;
    void *mapped;
    cl_event ready; /* of the mapping; NULL: already mapped */
    bool lent;
    bool shared; /* a clone of the simulation may hold it */
} pooled_frame;

/* Frames of a pool that clones may hold. More would leave too few for the simulation itself. */
enum { MOST_SHARED = 4 };

struct bst_frame_pool {
    cl_command_queue queue;
    int count;
    pthread_mutex_t waiting; /* protects the frames' `ready` */
    pthread_mutex_t lock;    /* protects lent, shared and closed */
    int lent, shared;
    bool closed; /* freed by its creator: destroyed with the last frame */
    pooled_frame frames[];
};

static void destroy(bst_frame_pool *pool) {
    for (int i = 0; i < pool->count; i++) {
        if (pool->frames[i].buffer) {
            clReleaseMemObject(pool->frames[i].buffer);
        }
    }
    if (pool->queue) {
        clReleaseCommandQueue(pool->queue);
    }
    pthread_mutex_destroy(&pool->lock);
    pthread_mutex_destroy(&pool->waiting);
    free(pool);
}

bst_status bst_frame_pool_enqueued(bst_ctx *ctx, bst_frame *frame) {
    pooled_frame *f = frame->owner;
    cl_int code;
    size_t bytes = (size_t)frame->width * (size_t)frame->height * sizeof(uint16_t);
    void *p = clEnqueueMapBuffer(f->pool->queue, f->buffer, CL_FALSE, CL_MAP_READ, 0, bytes, 0,
                                 NULL, &f->ready, &code);
    BST_TRY(bst_device_check(ctx, code, "mapping a frame"));
    f->mapped = p;
    return BST_OK;
}

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    pooled_frame *f = owner;
    cl_int code = CL_SUCCESS;
    pthread_mutex_lock(&f->pool->waiting);
    cl_event ready = f->ready;
    if (ready) {
        clRetainEvent(ready);
    }
    pthread_mutex_unlock(&f->pool->waiting);
    if (ready) { /* other threads may map finished frames meanwhile */
        code = clWaitForEvents(1, &ready);
        pthread_mutex_lock(&f->pool->waiting);
        if (f->ready) {
            clReleaseEvent(f->ready);
            f->ready = NULL;
        }
        pthread_mutex_unlock(&f->pool->waiting);
        clReleaseEvent(ready);
    }
    *pixels = f->mapped;
    return bst_device_check(ctx, code, "rendering a frame");
}

bst_status bst_frame_pool_pixels(bst_ctx *ctx, bst_frame *frame, uint16_t **out) {
    pooled_frame *f = frame->owner;
    const uint16_t *pixels;
    cl_int code;
    size_t bytes = (size_t)frame->width * (size_t)frame->height * sizeof(uint16_t);
    BST_TRY(map(f, ctx, &pixels));
    /* a buffer mapped for reading must not be written */
    clEnqueueUnmapMemObject(f->pool->queue, f->buffer, f->mapped, 0, NULL, NULL);
    f->mapped = clEnqueueMapBuffer(f->pool->queue, f->buffer, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE,
                                   0, bytes, 0, NULL, NULL, &code);
    *out = f->mapped;
    return bst_device_check(ctx, code, "mapping a frame for writing");
}

/* The mapping is kept for the next reader. */
static void unmap(void *owner) {
    (void)owner;
}

static void *device_buffer(void *owner) {
    return ((pooled_frame *)owner)->buffer;
}

static void recycle(void *owner) {
    pooled_frame *f = owner;
    bst_frame_pool *pool = f->pool;
    if (f->ready) {
        clReleaseEvent(f->ready);
        f->ready = NULL;
    }
    if (f->mapped) {
        clEnqueueUnmapMemObject(pool->queue, f->buffer, f->mapped, 0, NULL, NULL);
        f->mapped = NULL;
    }
    pthread_mutex_lock(&pool->lock);
    f->lent = false;
    pool->lent--;
    pool->shared -= f->shared;
    f->shared = false;
    bool last = pool->closed && pool->lent == 0;
    pthread_mutex_unlock(&pool->lock);
    if (last) {
        clFinish(pool->queue);
        destroy(pool);
    }
}

static bool share(void *owner) {
    pooled_frame *f = owner;
    bst_frame_pool *pool = f->pool;
    pthread_mutex_lock(&pool->lock);
    if (!f->shared && pool->shared < MOST_SHARED) {
        f->shared = true;
        pool->shared++;
    }
    bool shared = f->shared;
    pthread_mutex_unlock(&pool->lock);
    return shared;
}

static const bst_frame_ops ops = {
    .map = map, .unmap = unmap, .device_buffer = device_buffer, .recycle = recycle, .share = share};

bst_status bst_frame_pool_create(bst_ctx *ctx, bst_device *device, int width, int height, int count,
                                 bst_frame_pool **out) {
    assert(device && out && width > 0 && height > 0 && count > 0);
    *out = NULL;
    bst_frame_pool *pool = calloc(1, sizeof *pool + (size_t)count * sizeof *pool->frames);
    if (!pool) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a pool of %d frames", count);
    }
    pthread_mutex_init(&pool->lock, NULL);
    pthread_mutex_init(&pool->waiting, NULL);
    pool->queue = bst_device_queue(device);
    clRetainCommandQueue(pool->queue);
    pool->count = count;
    for (int i = 0; i < count; i++) {
        size_t bytes = (size_t)width * (size_t)height * sizeof(uint16_t);
        pool->frames[i].pool = pool;
        bst_status status = bst_device_buffer(ctx, bst_device_context(device), bytes, NULL,
                                              "allocating a frame", &pool->frames[i].buffer);
        if (status != BST_OK) {
            destroy(pool);
            return status;
        }
    }
    *out = pool;
    return BST_OK;
}

void bst_frame_pool_free(bst_frame_pool *pool) {
    if (!pool) {
        return;
    }
    pthread_mutex_lock(&pool->lock);
    pool->closed = true;
    bool unused = pool->lent == 0;
    pthread_mutex_unlock(&pool->lock);
    if (unused) {
        destroy(pool);
    }
}

bst_status bst_frame_pool_take(bst_ctx *ctx, bst_frame_pool *pool, int width, int height,
                               bst_frame **out, cl_mem *buffer) {
    assert(pool && out && buffer && width > 0 && height > 0);
    pooled_frame *f = NULL;
    pthread_mutex_lock(&pool->lock);
    for (int i = 0; i < pool->count && !f; i++) {
        f = pool->frames[i].lent ? NULL : &pool->frames[i];
    }
    if (f) {
        f->lent = true;
        pool->lent++;
    }
    pthread_mutex_unlock(&pool->lock);
    if (!f) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "all %d frames are in use: raise scenegen's pool_frames above the number "
                        "of frames that queues hold",
                        pool->count);
    }
    f->frame =
        (bst_frame){.ops = &ops, .owner = f, .width = width, .height = height, .references = 1};
    *out = &f->frame;
    *buffer = f->buffer;
    return BST_OK;
}
