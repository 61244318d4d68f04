#include "scenegen/upload_ring.h"

#include <assert.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

typedef struct staged {
    cl_mem buffer;
    size_t bytes;
    bool result;    /* filled by the device */
    void *mapped;   /* NULL: owned by the device */
    cl_event ready; /* of the mapping; NULL: already mapped */
} staged;

struct bst_upload_ring {
    cl_context context;
    cl_command_queue queue;
    cl_ulong most_bytes; /* largest buffer */
    int present;
    staged parts[BST_STAGE_SETS][BST_STAGE_PARTS];
};

bst_status bst_upload_ring_create(bst_ctx *ctx, bst_device *device, bst_upload_ring **out) {
    assert(device && out);
    bst_upload_ring *s = calloc(1, sizeof *s);
    *out = s;
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for what goes to the device");
    }
    s->context = bst_device_context(device);
    s->queue = bst_device_queue(device);
    clRetainContext(s->context);
    clRetainCommandQueue(s->queue);
    cl_int code = clGetDeviceInfo(bst_device_id(device), CL_DEVICE_MAX_MEM_ALLOC_SIZE,
                                  sizeof s->most_bytes, &s->most_bytes, NULL);
    return bst_device_check(ctx, code, "asking for the device's largest buffer");
}

/* Waits until the part is mapped for the host. */
static bst_status await(bst_ctx *ctx, staged *p) {
    cl_int code = CL_SUCCESS;
    if (p->ready) {
        code = clWaitForEvents(1, &p->ready);
        clReleaseEvent(p->ready);
        p->ready = NULL;
    }
    return bst_device_check(ctx, code, "waiting for a frame");
}

/* Unmaps the part for the device. */
static bst_status hand_over(bst_ctx *ctx, bst_upload_ring *s, staged *p) {
    if (!p->mapped) {
        return BST_OK;
    }
    BST_TRY(await(ctx, p));
    cl_int code = clEnqueueUnmapMemObject(s->queue, p->buffer, p->mapped, 0, NULL, NULL);
    p->mapped = NULL;
    return bst_device_check(ctx, code, "unmapping scene memory");
}

static bst_status map(bst_ctx *ctx, bst_upload_ring *s, staged *p) {
    cl_int code;
    cl_map_flags flags = p->result ? CL_MAP_READ : CL_MAP_WRITE_INVALIDATE_REGION;
    p->mapped = clEnqueueMapBuffer(s->queue, p->buffer, CL_FALSE, flags, 0, p->bytes, 0, NULL,
                                   &p->ready, &code);
    return bst_device_check(ctx, code, "mapping scene memory");
}

void bst_upload_ring_free(bst_upload_ring *s) {
    if (!s) {
        return;
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    for (int i = 0; i < BST_STAGE_SETS; i++) {
        for (int n = 0; n < BST_STAGE_PARTS; n++) {
            (void)hand_over(&ctx, s, &s->parts[i][n]);
        }
    }
    clFinish(s->queue);
    for (int i = 0; i < BST_STAGE_SETS; i++) {
        for (int n = 0; n < BST_STAGE_PARTS; n++) {
            if (s->parts[i][n].buffer) {
                clReleaseMemObject(s->parts[i][n].buffer);
            }
        }
    }
    clReleaseCommandQueue(s->queue);
    clReleaseContext(s->context);
    free(s);
}

int bst_upload_ring_archive(bst_upload_ring *s, bst_archive *archive) {
    s->present = (int)bst_archive_integer(archive, s->present, 0, BST_STAGE_SETS - 1);
    return s->present;
}

int bst_upload_ring_begin(bst_upload_ring *s) {
    s->present = (s->present + 1) % BST_STAGE_SETS;
    return s->present;
}

/* Ensures room for `bytes`; the content is lost if the buffer grows. */
static bst_status grow(bst_ctx *ctx, bst_upload_ring *s, staged *p, size_t bytes) {
    if (p->buffer && p->bytes >= bytes) {
        return BST_OK;
    }
    BST_TRY(hand_over(ctx, s, p));
    if (p->buffer) {
        clReleaseMemObject(p->buffer);
    }
    size_t room = bytes + bytes / 2;
    room = room > s->most_bytes ? bytes : room;
    p->bytes = room < 4096 ? 4096 : room;
    return bst_device_buffer(ctx, s->context, p->bytes, NULL, "allocating scene memory",
                             &p->buffer);
}

bst_status bst_upload_ring_put(bst_ctx *ctx, bst_upload_ring *s, bst_upload_ring_part part,
                               const void *data, size_t bytes, cl_mem *buffer) {
    assert(s && buffer && (data || bytes == 0));
    staged *p = &s->parts[s->present][part];
    BST_TRY(grow(ctx, s, p, bytes));
    if (!p->mapped) {
        /* the device may still read what was handed over before, for another band of the frame:
         * NVIDIA's driver lends the same memory again before it is copied */
        BST_TRY(bst_device_check(ctx, clFinish(s->queue), "waiting for scene memory"));
        BST_TRY(map(ctx, s, p));
    }
    BST_TRY(await(ctx, p));
    if (bytes > 0) {
        memcpy(p->mapped, data, bytes);
    }
    *buffer = p->buffer;
    return hand_over(ctx, s, p);
}

bst_status bst_upload_ring_room(bst_ctx *ctx, bst_upload_ring *s, bst_upload_ring_part part,
                                size_t bytes, cl_mem *buffer) {
    staged *p = &s->parts[s->present][part];
    p->result = true;
    BST_TRY(grow(ctx, s, p, bytes));
    *buffer = p->buffer;
    return hand_over(ctx, s, p);
}

bst_status bst_upload_ring_result(bst_ctx *ctx, bst_upload_ring *s, int set,
                                  bst_upload_ring_part part, const void **data) {
    staged *p = &s->parts[set][part];
    *data = NULL;
    BST_TRY(await(ctx, p));
    *data = p->mapped;
    return p->mapped ? BST_OK
                     : bst_fail(ctx, BST_ERR_STATE, "the device has not left anything there");
}

bst_status bst_upload_ring_end(bst_ctx *ctx, bst_upload_ring *s) {
    for (int n = 0; n < BST_STAGE_PARTS; n++) {
        staged *p = &s->parts[s->present][n];
        if (p->buffer && !p->mapped) {
            BST_TRY(map(ctx, s, p));
        }
    }
    return BST_OK;
}
