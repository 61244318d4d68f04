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

static int close_device(void **state) {
    bst_device_close(((fixture *)*state)->device);
    return 0;
}

#endif
