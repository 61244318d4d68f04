#include "scenegen/device_array.h"

bst_status bst_device_array_reserve(bst_ctx *ctx, cl_context context, uint64_t most_bytes,
                                    bst_device_array *g, size_t bytes) {
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
    g->bytes = room;
    return bst_device_buffer(ctx, context, room, NULL, "allocating scene memory", &g->buffer);
}
