#include "sim/app/study_devices.h"

#include <stdio.h>
#include <string.h>

void bst_study_devices_read(const char *text, bst_study_devices *out) {
    out->count = 0;
    while (text && *text && out->count < BST_STUDY_DEVICES) {
        size_t length = strcspn(text, ",");
        if (length > 0) {
            char *name = out->names[out->count];
            snprintf(name, BST_STUDY_DEVICE_BYTES, "%.*s", (int)length, text);
            out->list[out->count++] = name;
        }
        text += length + (text[length] == ',');
    }
}

const char *bst_study_device(const bst_study_devices *devices, int64_t index) {
    return devices->count > 0 ? devices->list[index % devices->count] : "";
}
