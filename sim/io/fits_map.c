/* Writes a map as a FITS file. */
#include <assert.h>
#include <fitsio.h>
#include <string.h>

#include "sim/io/fits_image.h"
#include "sim/io/fits_internal.h"
#include "sim/io/manifest.h"

/* Makes the file in memory; false: see *code. */
static bool make(bst_fits_memory *memory, int width, int height, const float *pixels,
                 const char *unit, int *code) {
    long size[2] = {width, height};
    bst_fits_memory_open(memory, false, code);
    fits_create_img(memory->file, FLOAT_IMG, 2, size, code);
    fits_update_key_str(memory->file, "BUNIT", unit, "unit of the pixels", code);
    /* cfitsio's declaration lacks const */
    fits_write_img(memory->file, TFLOAT, 1, (LONGLONG)width * height, (float *)(uintptr_t)pixels,
                   code);
    return *code == 0;
}

bst_status bst_fits_write_map(bst_ctx *ctx, const char *path, int width, int height,
                              const float *pixels, const char *unit) {
    assert(path && width > 0 && height > 0 && pixels && unit && strlen(unit) <= 60);
    bst_fits_memory memory = {0};
    char *bytes = NULL;
    long long count = 0;
    int code = 0;
    bst_status status;
    if (make(&memory, width, height, pixels, unit, &code)) {
        bst_fits_memory_hdu(&memory, &bytes, &count, &code);
    }
    if (code != 0) {
        char reason[FLEN_STATUS];
        fits_get_errstatus(code, reason);
        status = bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be made: %s", path, reason);
    } else {
        status = bst_io_write_file_atomic(ctx, path, bytes, (size_t)count);
    }
    bst_fits_memory_close(&memory, &code);
    bst_fits_memory_free(&memory);
    return status;
}
