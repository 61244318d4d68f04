/* OpenCL device: selection, programs from embedded kernel sources, buffers. */
#ifndef BST_DEVICE_DEVICE_H
#define BST_DEVICE_DEVICE_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <stdbool.h>

#include "boresight/status.h"

typedef struct bst_device bst_device;

/* Opens an OpenCL device. `selector`: "": default (PoCL's CPU device, else the first device); part
 * of a platform's or device's name, ignoring case; or "P:D" by index. threads > 0 limits a CPU
 * device to that many compute units (sub-device). The error for an unknown selector lists the
 * devices. */
bst_status bst_device_open(bst_ctx *ctx, const char *selector, int threads,
                           bst_device **out) BST_MUST_CHECK;
/* Opens a device a second time: with a queue of its own, and the context and the programs of the
 * first one.
 *
 * Given:     device  must outlive *out
 * Errors:    BST_ERR_DEVICE, BST_ERR_MEMORY
 * Ownership: free *out with bst_device_close */
bst_status bst_device_share(bst_ctx *ctx, bst_device *device, bst_device **out) BST_MUST_CHECK;
/* Waits for the queue and frees a device with its programs; NULL is allowed. */
void bst_device_close(bst_device *device);

/* OpenCL context of a device; it belongs to the device. */
cl_context bst_device_context(const bst_device *device);
/* OpenCL command queue of a device; it belongs to the device. */
cl_command_queue bst_device_queue(const bst_device *device);
/* OpenCL identity of a device; it belongs to the device. */
cl_device_id bst_device_id(const bst_device *device);
/* True if a device is the processor itself, so that its work takes time from that of the host. */
bool bst_device_is_cpu(const bst_device *device);
/* Number of processors that a CPU device uses; 0: another device. */
int bst_device_processors(const bst_device *device);
/* Description of a device for the manifest: "PoCL 3.1: cpu-..., 2 compute units". */
const char *bst_device_description(const bst_device *device);

/* Creates a buffer shared by device and host, without copies and on large pages (sim/core/pages.h)
 * for a CPU device. data: initial content; NULL: none. `what`: prefix of error messages. Release
 * with clReleaseMemObject. */
bst_status bst_device_buffer(bst_ctx *ctx, cl_context context, size_t bytes, const void *data,
                             const char *what, cl_mem *out) BST_MUST_CHECK;

/* A kernel source embedded at build time (see cmake/embed.cmake). */
typedef struct bst_device_kernel_source {
    const char *name; /* file name, for messages */
    const char *text;
    unsigned hash_high, hash_low; /* FNV-1a 64 of the text, for the manifest */
} bst_device_kernel_source;

/* Builds the concatenation of `count` kernel sources with options, or returns the cached program;
 * programs are cached until the device is closed. A build error has the first lines of the log with
 * file names. */
bst_status bst_device_build(bst_ctx *ctx, bst_device *device,
                            const bst_device_kernel_source *const *sources, int count,
                            const char *options, cl_program *out) BST_MUST_CHECK;

/* Kernel sources that were built on this device, in order of first use; NULL after the last. */
const bst_device_kernel_source *bst_device_built(const bst_device *device, int index);
/* Number of programs that were built with the headers of the OpenCL implementation: with PoCL
 * on a CPU those that call a built-in function that sim/device/kernels/builtins.cl does not
 * declare, or that have an error; with others all. */
int bst_device_header_builds(const bst_device *device);
/* Clears the list of built sources, for a new user of the device. */
void bst_device_begin_list(bst_device *device);

/* BST_OK for CL_SUCCESS, else BST_ERR_DEVICE with "what: CL_NAME". */
bst_status bst_device_check(bst_ctx *ctx, cl_int code, const char *what) BST_MUST_CHECK;

#endif
