/* The reader of FITS images, cfitsio under our checks, on any bytes. */
#include <stdint.h>
#include <stdlib.h>

#include "sim/io/fits_image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    int width = 0, height = 0;
    float *pixels = NULL;
    bst_status status =
        bst_fits_read_image_buffer(&ctx, "input", data, bytes, &width, &height, &pixels);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (pixels != NULL) ||
        (status == BST_OK) != (width > 0 && height > 0)) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    free(pixels);
    return 0;
}
