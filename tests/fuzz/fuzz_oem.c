/* The reader of OEM files on any bytes. What is accepted interpolates to numbers within its spans,
 * or says why not. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sim/astro/oem.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void interpolate(const bst_oem *oem, int object) {
    bst_time start, stop;
    bst_oem_span(oem, object, &start, &stop);
    double length = bst_time_diff(stop, start);
    if (!(length >= 0.0)) {
        abort();
    }
    for (int i = 0; i <= 4; i++) {
        bst_ctx ctx = {0};
        bst_vec3 r, v;
        bst_status status =
            bst_oem_state(&ctx, oem, object, NULL, bst_time_add(start, 0.25 * i * length), &r, &v);
        if ((status == BST_OK) != (ctx.message[0] == '\0')) {
            abort();
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_oem *oem = NULL;
    bst_status status = bst_oem_read_buffer(&ctx, "input", (const char *)data, bytes, &oem);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (oem != NULL)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    for (int i = 0; oem && i < bst_oem_object_count(oem); i++) {
        interpolate(oem, i);
    }
    bst_oem_free(oem);
    return 0;
}
