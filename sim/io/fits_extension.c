/* Writes frames and planes as FITS image extensions. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/fits_internal.h"
#include "sim/io/fits_rice.h"

bst_status bst_fits_sign_hdu(bst_ctx *ctx, const bst_fits *fits, char *hdu, long long bytes,
                             const uint16_t *pixels, size_t count) {
    bst_fits_sum sum = {0};
    if (!fits->checksums) {
        return BST_OK;
    }
    if (pixels) {
        bst_fits_sum_pixels(&sum, pixels, count);
    }
    return bst_fits_sign(hdu, (size_t)bytes, sum)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT, "%s: no place for CHECKSUM", fits->path);
}

/* Sets the image size in a header that was made without pixels; false: unexpected order of
 * cards. */
static bool set_size(char *header, int width, int height) {
    const int size[2] = {width, height};
    for (int k = 0; k < 2; k++) {
        /* after XTENSION, BITPIX and NAXIS: FITS 4.0, section 4.4.1.2 */
        char *card = header + (size_t)(3 + k) * 80, start[11], value[21];
        snprintf(start, sizeof start, "NAXIS%d  = ", k + 1);
        if (memcmp(card, start, 10) != 0) {
            return false;
        }
        snprintf(value, sizeof value, "%20d", size[k]);
        memcpy(card + 10, value, 20);
    }
    return true;
}

/* Writes the rows of an image, coded, as the tiles of a compressed image: as cfitsio does in some
 * six times the time. */
static bst_status write_rows(bst_ctx *ctx, bst_fits *fits, const uint16_t *pixels, int width,
                             int height, int *code) {
    uint8_t *coded = malloc(bst_fits_rice_bytes((size_t)width));
    if (!coded) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory for a row", fits->path);
    }
    for (int y = 0; y < height && *code == 0; y++) {
        const size_t bytes =
            bst_fits_rice_encode(pixels + (size_t)y * (size_t)width, (size_t)width, coded);
        fits_write_col(fits->memory.file, TBYTE, 1, 1 + y, 1, (LONGLONG)bytes, coded, code);
    }
    free(coded);
    return BST_OK;
}

bst_status bst_fits_write_extension(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                    const uint16_t *pixels, int width, int height, int64_t number) {
    bool rice = fits->compression == BST_FITS_RICE;
    long size[2] = {rice ? width : 0, rice ? height : 0};
    size_t count = (size_t)width * (size_t)height;
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    bst_status status = BST_OK;
    errno = 0;
    bst_fits_memory_open(&fits->memory, true, &code);
    fitsfile *file = fits->memory.file;
    if (rice) {
        fits_set_compression_type(file, RICE_1, &code);
    }
    fits_create_img(file, USHORT_IMG, 2, size, &code);
    fits_write_key_str(file, "EXTNAME", "FRAME", "", &code);
    fits_write_key_lng(file, "EXTVER", number, "counted from 1", &code);
    fits_write_key_log(file, "INHERIT", 1, "keys of the primary header hold here", &code);
    bst_fits_put_frame_keys(file, &fits->names, frame, &code);
    bst_fits_put_statements(file, &code);
    bst_fits_put_sums(fits, file, &code);
    if (rice) {
        status = write_rows(ctx, fits, pixels, width, height, &code);
    }
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    if (status == BST_OK) {
        status = bst_fits_check(ctx, fits, code, "cannot be written");
    }
    if (status == BST_OK && !rice && !set_size(hdu, width, height)) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "%s: NAXIS1 is not where it belongs", fits->path);
    }
    const uint16_t *behind = rice ? NULL : pixels;
    count = rice ? 0 : count;
    if (status == BST_OK) {
        status = bst_fits_sign_hdu(ctx, fits, hdu, bytes, behind, count);
    }
    if (status == BST_OK) {
        status = bst_fits_append_image(ctx, fits, hdu, bytes, behind, count);
    }
    bst_fits_memory_close(&fits->memory, &code);
    return status;
}

bst_status bst_fits_write_plane(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                const bst_fits_plane *plane, int64_t *index) {
    int width = plane->width, height = plane->height;
    if (width < 1 || height < 1 || fits->content == BST_FITS_COUNTS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: no plane of %d x %d pixels", fits->path, width,
                        height);
    }
    static const int images[] = {[BST_FITS_ELECTRONS] = FLOAT_IMG,
                                 [BST_FITS_ITEMS] = LONG_IMG,
                                 [BST_FITS_PARTS] = LONG_IMG,
                                 [BST_FITS_FLAGS] = BYTE_IMG},
                     types[] = {[BST_FITS_ELECTRONS] = TFLOAT,
                                [BST_FITS_ITEMS] = TINT,
                                [BST_FITS_PARTS] = TINT,
                                [BST_FITS_FLAGS] = TBYTE};
    long size[2] = {width, height};
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    errno = 0;
    bst_fits_memory_open(&fits->memory, true, &code);
    fitsfile *file = fits->memory.file;
    fits_create_img(file, images[fits->content], 2, size, &code);
    fits_write_key_str(file, "EXTNAME", plane->name, "", &code);
    fits_write_key_lng(file, "EXTVER", fits->frames + 1, "counted from 1", &code);
    fits_write_key_log(file, "INHERIT", 1, "keys of the primary header hold here", &code);
    bst_fits_put_frame_keys(file, &fits->names, frame, &code);
    bst_fits_put_content(file, fits->content, &code);
    bst_fits_put_statements(file, &code);
    bst_fits_put_sums(fits, file, &code);
    /* cfitsio's prototype lacks const; it does not write to the array */
    fits_write_img(file, types[fits->content], 1, (LONGLONG)width * height,
                   (void *)(uintptr_t)plane->pixels, &code);
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    bst_status status = bst_fits_check(ctx, fits, code, "cannot be written");
    if (status == BST_OK) {
        status = bst_fits_sign_hdu(ctx, fits, hdu, bytes, NULL, 0);
    }
    if (status == BST_OK) {
        status = bst_fits_append_hdu(ctx, fits, hdu, bytes);
    }
    bst_fits_memory_close(&fits->memory, &code);
    if (status == BST_OK) {
        fits->frames++;
        if (index) {
            *index = fits->frames;
        }
    }
    return status;
}
