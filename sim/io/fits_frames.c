#include "sim/io/fits_frames.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/fits_internal.h"

bst_status bst_fits_check(bst_ctx *ctx, const bst_fits *fits, int code, const char *what) {
    if (code == 0) {
        return BST_OK;
    }
    int error = errno;
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_IO, "%s: %s: %s%s%s%s", fits->path, what, reason,
                    error ? " (" : "", error ? strerror(error) : "", error ? ")" : "");
}

bst_status bst_fits_fail_errno(bst_ctx *ctx, const bst_fits *fits, const char *what) {
    return bst_fail(ctx, BST_ERR_IO, "%s: %s: %s", fits->path, what, strerror(errno));
}

static void copy_name(char to[BST_FITS_NAME_BYTES], const char *from) {
    snprintf(to, BST_FITS_NAME_BYTES, "%s", from ? from : "");
}

bst_status bst_fits_create(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) {
    *out = NULL;
    bst_fits *fits = calloc(1, sizeof *fits);
    if (!fits) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    int n = snprintf(fits->path, sizeof fits->path, "%s", path);
    if (n < 0 || (size_t)n + 16 >= sizeof fits->path) {
        free(fits);
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    }
    fits->layout = layout;
    copy_name(fits->names.observer, info->observer);
    copy_name(fits->names.instrument, info->instrument);
    copy_name(fits->names.object, info->object);
    copy_name(fits->names.program, info->program);
    fits->names.camera = *info->camera;
    fits->cube.file = fits->cube.rows = -1;

    /* "disk file": a path with brackets is a path, not cfitsio's extended syntax */
    int code = 0;
    errno = 0;
    fits_create_diskfile(&fits->file, fits->path, &code);
    bst_status status = bst_fits_check(ctx, fits, code, "cannot be made");
    if (status == BST_OK && layout == BST_FITS_CUBE) {
        status = bst_fits_cube_open(ctx, fits);
    } else if (status == BST_OK) {
        fits_create_img(fits->file, BYTE_IMG, 0, NULL, &code);
        bst_fits_put_run_keys(fits->file, &fits->names, &code);
        bst_fits_put_statements(fits->file, &code);
        fits_flush_file(fits->file, &code);
        status = bst_fits_check(ctx, fits, code, "cannot be written");
    }
    if (status != BST_OK) {
        int ignored = 0;
        if (fits->file) {
            fits_close_file(fits->file, &ignored);
        }
        bst_fits_cube_free(fits);
        free(fits);
        return status;
    }
    *out = fits;
    return BST_OK;
}

static bst_status write_extension(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                                  const uint16_t *pixels, int width, int height) {
    long size[2] = {width, height};
    int code = 0;
    errno = 0;
    fits_create_img(fits->file, USHORT_IMG, 2, size, &code);
    fits_write_key_str(fits->file, "EXTNAME", "FRAME", "", &code);
    fits_write_key_lng(fits->file, "EXTVER", fits->frames + 1, "counted from 1", &code);
    fits_write_key_log(fits->file, "INHERIT", 1, "keys of the primary header hold here", &code);
    bst_fits_put_frame_keys(fits->file, &fits->names, frame, &code);
    bst_fits_put_statements(fits->file, &code);
    /* cfitsio's prototype lacks const; it does not write to the array */
    fits_write_img(fits->file, TUSHORT, 1, (LONGLONG)width * height, (void *)(uintptr_t)pixels,
                   &code);
    fits_flush_file(fits->file, &code);
    return bst_fits_check(ctx, fits, code, "cannot be written");
}

bst_status bst_fits_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                          const uint16_t *pixels, int width, int height, int64_t *index) {
    if (width < 1 || height < 1 || frame->bits < 1 || frame->bits > 16) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a frame of %d x %d pixels at %d bits",
                        fits->path, width, height, frame->bits);
    }
    if (fits->layout == BST_FITS_CUBE) {
        BST_TRY(bst_fits_cube_write(ctx, fits, frame, pixels, width, height));
    } else {
        BST_TRY(write_extension(ctx, fits, frame, pixels, width, height));
    }
    fits->frames++;
    if (index) {
        *index = fits->layout == BST_FITS_CUBE ? fits->frames - 1 : fits->frames;
    }
    return BST_OK;
}

bst_status bst_fits_close(bst_ctx *ctx, bst_fits *fits) {
    if (!fits) {
        return BST_OK;
    }
    bst_status status = BST_OK;
    if (fits->layout == BST_FITS_CUBE) {
        status = bst_fits_cube_finish(ctx, fits);
    }
    if (fits->file) {
        int code = 0;
        errno = 0;
        fits_close_file(fits->file, &code);
        if (status == BST_OK) {
            status = bst_fits_check(ctx, fits, code, "cannot be completed");
        }
    }
    bst_fits_cube_free(fits);
    free(fits);
    return status;
}
