/* OpenCL devices that the workers of a study use in rotation. */
#ifndef BST_STUDY_KINDS_STUDY_DEVICES_H
#define BST_STUDY_KINDS_STUDY_DEVICES_H

#include <stdint.h>

#include "boresight/status.h"

enum { BST_STUDY_DEVICES = 64, BST_STUDY_DEVICE_BYTES = 128 };

typedef struct bst_study_devices {
    char names[BST_STUDY_DEVICES][BST_STUDY_DEVICE_BYTES];
    const char *list[BST_STUDY_DEVICES]; /* pointers into names: do not copy the struct */
    int count;                           /* 0: the default device for all */
} bst_study_devices;

/* Splits a list such as "0:0,0:1"; NULL: none. BST_ERR_ARGUMENT: too many or too long names. */
bst_status bst_study_devices_read(bst_ctx *ctx, const char *text,
                                  bst_study_devices *out) BST_MUST_CHECK;
/* Device of worker `index`; "": the default. */
const char *bst_study_device(const bst_study_devices *devices, int64_t index);

#endif
