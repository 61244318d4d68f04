#include "scenegen/detector/saved_floats.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

bst_status bst_saved_floats(bst_archive *archive, bst_device *device, cl_mem buffer, size_t bytes,
                            double least, double most, const char *what) {
    assert(archive && device && buffer && what);
    bst_ctx *ctx = bst_archive_ctx(archive);
    bool restoring = bst_archive_is_restoring(archive);
    cl_command_queue queue = bst_device_queue(device);
    char doing[96];
    void *copy = malloc(bytes);
    if (!copy) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the %s", what);
    }
    snprintf(doing, sizeof doing, "%s the %s", restoring ? "restoring" : "reading", what);
    bst_status status = BST_OK;
    if (!restoring) {
        status = bst_device_check(
            ctx, clEnqueueReadBuffer(queue, buffer, CL_TRUE, 0, bytes, copy, 0, NULL, NULL), doing);
    }
    bst_archive_bytes(archive, copy, bytes);
    if (restoring) {
        const float *numbers = copy;
        for (size_t i = 0; i < bytes / sizeof *numbers; i++) {
            double found = (double)numbers[i];
            if (!(found >= least && found < most)) {
                free(copy);
                return bst_fail(ctx, BST_ERR_FORMAT,
                                "the saved state has a %s of %g e- (allowed: %g to %g)", what,
                                found, least, most);
            }
        }
        status = bst_device_check(
            ctx, clEnqueueWriteBuffer(queue, buffer, CL_TRUE, 0, bytes, copy, 0, NULL, NULL),
            doing);
    }
    free(copy);
    return status;
}
