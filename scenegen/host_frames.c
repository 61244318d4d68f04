#include "scenegen/host_frames.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>

typedef struct host_frame {
    bst_frame frame;
    bst_host_frames *pool;
    uint16_t *pixels;
    bool lent;
} host_frame;

struct bst_host_frames {
    pthread_mutex_t lock; /* protects lent and closed */
    size_t room;          /* pixels of a frame */
    int count, lent;
    bool closed; /* freed by its creator: destroyed with the last frame */
    uint16_t *pixels;
    host_frame frames[];
};

static void destroy(bst_host_frames *pool) {
    pthread_mutex_destroy(&pool->lock);
    free(pool->pixels);
    free(pool);
}

static bst_status map(void *owner, bst_ctx *ctx, const uint16_t **pixels) {
    (void)ctx;
    *pixels = ((host_frame *)owner)->pixels;
    return BST_OK;
}

static void unmap(void *owner) {
    assert(((const host_frame *)owner)->lent);
}

static void recycle(void *owner) {
    host_frame *f = owner;
    bst_host_frames *pool = f->pool;
    pthread_mutex_lock(&pool->lock);
    f->lent = false;
    pool->lent--;
    bool last = pool->closed && pool->lent == 0;
    pthread_mutex_unlock(&pool->lock);
    if (last) {
        destroy(pool);
    }
}

static const bst_frame_ops ops = {.map = map, .unmap = unmap, .recycle = recycle};

bst_status bst_host_frames_create(bst_ctx *ctx, size_t pixels, int count, bst_host_frames **out) {
    assert(pixels > 0 && count > 0 && out);
    *out = NULL;
    bst_host_frames *pool = calloc(1, sizeof *pool + (size_t)count * sizeof *pool->frames);
    uint16_t *memory = malloc(pixels * (size_t)count * sizeof *memory);
    if (!pool || !memory) {
        free(pool);
        free(memory);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d frames of %zu pixels", count,
                        pixels);
    }
    pthread_mutex_init(&pool->lock, NULL);
    pool->room = pixels;
    pool->count = count;
    pool->pixels = memory;
    for (int i = 0; i < count; i++) {
        pool->frames[i].pool = pool;
        pool->frames[i].pixels = memory + (size_t)i * pixels;
    }
    *out = pool;
    return BST_OK;
}

void bst_host_frames_free(bst_host_frames *pool) {
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

bst_status bst_host_frames_take(bst_ctx *ctx, bst_host_frames *pool, int width, int height,
                                bst_frame **out, uint16_t **pixels) {
    assert(pool && out && pixels && width > 0 && height > 0 &&
           (size_t)width * (size_t)height <= pool->room);
    host_frame *f = NULL;
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
    *pixels = f->pixels;
    return BST_OK;
}
