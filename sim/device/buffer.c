#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/pages.h"
#include "sim/device/device.h"

static bool on_host(cl_context context) {
    cl_device_id device;
    cl_device_type type = 0;
    return clGetContextInfo(context, CL_CONTEXT_DEVICES, sizeof device, &device, NULL) ==
               CL_SUCCESS &&
           clGetDeviceInfo(device, CL_DEVICE_TYPE, sizeof type, &type, NULL) == CL_SUCCESS &&
           (type & CL_DEVICE_TYPE_CPU);
}

static void CL_CALLBACK release(cl_mem buffer, void *memory) {
    (void)buffer;
    free(memory);
}

bst_status bst_device_buffer(bst_ctx *ctx, cl_context context, size_t bytes, const void *data,
                             const char *what, cl_mem *out) {
    cl_int code;
    *out = NULL;
    if (!on_host(context)) {
        cl_mem_flags flags = CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR;
        *out = clCreateBuffer(context, data ? flags | CL_MEM_COPY_HOST_PTR : flags, bytes,
                              (void *)(uintptr_t)data, &code);
        return bst_device_check(ctx, code, what);
    }
    void *memory = bst_pages_alloc(bytes);
    if (!memory) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: no memory for %zu bytes", what, bytes);
    }
    if (data) {
        memcpy(memory, data, bytes);
    }
    *out = clCreateBuffer(context, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, memory, &code);
    if (code == CL_SUCCESS) {
        code = clSetMemObjectDestructorCallback(*out, release, memory);
    }
    if (code != CL_SUCCESS) {
        if (*out) {
            clReleaseMemObject(*out);
            *out = NULL;
        }
        free(memory);
    }
    return bst_device_check(ctx, code, what);
}
