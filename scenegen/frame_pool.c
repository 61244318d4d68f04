#include "scenegen/frame_pool.h"

#include <stdbool.h>
#include <stdlib.h>

typedef struct pooled_frame {
    bst_frame frame;
    bst_frame_pool *pool;
    cl_mem buffer;
    void *mapped;
    bool lent;
} pooled_frame;

struct bst_frame_pool {
    cl_command_queue queue;
    int count, lent;
    bool closed; /* by its maker: goes with the last frame */
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
    free(pool);
}

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    pooled_frame *f = owner;
    if (!f->mapped) {
        cl_int code;
        size_t bytes = (size_t)f->frame.width * (size_t)f->frame.height * sizeof(uint16_t);
        void *p = clEnqueueMapBuffer(f->pool->queue, f->buffer, CL_TRUE, CL_MAP_READ, 0, bytes, 0,
                                     NULL, NULL, &code);
        BST_TRY(bst_device_check(ctx, code, "mapping a frame"));
        f->mapped = p;
    }
    *pixels = f->mapped;
    return BST_OK;
}

static void unmap(void *owner) {
    pooled_frame *f = owner;
    if (f->mapped) {
        clEnqueueUnmapMemObject(f->pool->queue, f->buffer, f->mapped, 0, NULL, NULL);
        f->mapped = NULL;
    }
}

static void *device_buffer(void *owner) {
    return ((pooled_frame *)owner)->buffer;
}

static void recycle(void *owner) {
    pooled_frame *f = owner;
    bst_frame_pool *pool = f->pool;
    unmap(f);
    f->lent = false;
    pool->lent--;
    if (pool->closed && pool->lent == 0) {
        clFinish(pool->queue);
        destroy(pool);
    }
}

static const bst_frame_ops ops = {map, unmap, device_buffer, recycle};

bst_status bst_frame_pool_create(bst_ctx *ctx, bst_device *device, int width, int height, int count,
                                 bst_frame_pool **out) {
    *out = NULL;
    bst_frame_pool *pool = calloc(1, sizeof *pool + (size_t)count * sizeof *pool->frames);
    if (!pool) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a pool of %d frames", count);
    }
    pool->queue = bst_device_queue(device);
    clRetainCommandQueue(pool->queue);
    pool->count = count;
    for (int i = 0; i < count; i++) {
        cl_int code;
        size_t bytes = (size_t)width * (size_t)height * sizeof(uint16_t);
        pool->frames[i].pool = pool;
        pool->frames[i].buffer =
            clCreateBuffer(bst_device_context(device), CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR,
                           bytes, NULL, &code);
        bst_status status = bst_device_check(ctx, code, "allocating a frame");
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
    if (pool->lent > 0) {
        pool->closed = true;
    } else {
        destroy(pool);
    }
}

bst_status bst_frame_pool_take(bst_ctx *ctx, bst_frame_pool *pool, int width, int height,
                               bst_frame **out, cl_mem *buffer) {
    for (int i = 0; i < pool->count; i++) {
        pooled_frame *f = &pool->frames[i];
        if (!f->lent) {
            f->frame = (bst_frame){
                .ops = &ops, .owner = f, .width = width, .height = height, .references = 1};
            f->lent = true;
            pool->lent++;
            *out = &f->frame;
            *buffer = f->buffer;
            return BST_OK;
        }
    }
    return bst_fail(ctx, BST_ERR_STATE,
                    "all %d frames are in use: raise scenegen's pool_frames above the number of "
                    "frames that queues hold",
                    pool->count);
}
