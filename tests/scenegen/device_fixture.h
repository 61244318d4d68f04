/* A device that the tests of one program share: open_device and close_device as group fixtures. */
#ifndef BST_TESTS_SCENEGEN_DEVICE_FIXTURE_H
#define BST_TESTS_SCENEGEN_DEVICE_FIXTURE_H

#include "sim/device/device.h"
#include "tests/test_support.h"

typedef struct fixture {
    bst_ctx ctx;
    bst_device *device;
} fixture;

static int open_device(void **state) {
    static fixture f;
    *state = &f;
    return bst_device_open(&f.ctx, "", 0, &f.device) == BST_OK ? 0 : -1;
}

/* The kernels of the program call only functions that sim/device/kernels/builtins.cl declares: with
 * another one, each start of the program would read PoCL's headers. (A failing fixture of a group
 * does not fail the program.) */
static int close_device(void **state) {
    bst_device *device = ((fixture *)*state)->device;
    int builds = bst_device_header_builds(device);
    bool pocl = strncmp(bst_device_description(device), "PoCL", 4) == 0;
    bst_device_close(device);
    if (pocl && builds > 0) {
        print_error("%d programs need a built-in function that builtins.cl does not declare\n",
                    builds);
        exit(EXIT_FAILURE);
    }
    return 0;
}

#endif
