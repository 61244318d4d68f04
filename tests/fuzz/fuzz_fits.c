/* The readers of FITS on any bytes: of images, which is cfitsio under our checks, and of frames. */
#include <stdint.h>
#include <stdlib.h>

#include "sim/io/fits_image.h"
#include "sim/io/fits_reader.h"

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
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_fits_reader *reader;
    status = bst_fits_reader_open_buffer(&ctx, "input", data, bytes, &reader);
    if ((status == BST_OK) != (ctx.message[0] == '\0') || (status == BST_OK) != (reader != NULL)) {
        abort();
    }
    for (int64_t i = 0; reader && i < bst_fits_reader_info(reader)->frames && i < 4; i++) {
        bst_fits_read_frame frame;
        int64_t id;
        if (bst_fits_reader_id(&ctx, reader, i, &id) == BST_OK &&
            bst_fits_reader_frame(&ctx, reader, i, &frame) == BST_OK && frame.exposure_id != id) {
            abort();
        }
    }
    bst_fits_reader_close(reader);
    return 0;
}
