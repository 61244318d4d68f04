#include "sim/study_kinds/study_devices.h"

#include <stdio.h>
#include <string.h>

bst_status bst_study_devices_read(bst_ctx *ctx, const char *text, bst_study_devices *out) {
    out->count = 0;
    while (text && *text) {
        size_t length = strcspn(text, ",");
        if (length >= BST_STUDY_DEVICE_BYTES) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--device: \"%.20s...\" has %zu characters, at most %d are kept: give "
                            "part of the name, or PLATFORM:DEVICE by number",
                            text, length, BST_STUDY_DEVICE_BYTES - 1);
        }
        if (length > 0 && out->count == BST_STUDY_DEVICES) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--device names more than %d devices: name fewer, and share the study "
                            "among machines with --shard I/N or --slurm",
                            BST_STUDY_DEVICES);
        }
        if (length > 0) {
            char *name = out->names[out->count];
            snprintf(name, BST_STUDY_DEVICE_BYTES, "%.*s", (int)length, text);
            out->list[out->count++] = name;
        }
        text += length + (text[length] == ',');
    }
    return BST_OK;
}

const char *bst_study_device(const bst_study_devices *devices, int64_t index) {
    return devices->count > 0 ? devices->list[index % devices->count] : "";
}
