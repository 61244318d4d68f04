#include "scenegen/growing.h"

bst_status bst_growing_reserve(bst_ctx *ctx, cl_context context, uint64_t most_bytes,
                               bst_growing *g, size_t bytes) {
    if (g->bytes >= bytes && g->buffer) {
        return BST_OK;
    }
    if (g->buffer) {
        clReleaseMemObject(g->buffer);
        g->buffer = NULL;
    }
    size_t room = bytes > 2 * g->bytes ? bytes : 2 * g->bytes;
    room = room > most_bytes ? bytes : room;
    room = room < 4096 ? 4096 : room;
    cl_int code;
    g->buffer =
        clCreateBuffer(context, CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR, room, NULL, &code);
    g->bytes = room;
    return bst_device_check(ctx, code, "allocating scene memory");
}
