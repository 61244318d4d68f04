#include "sim/io/fits_frames.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/io/fits_internal.h"
#include "sim/io/manifest.h"

static void copy_name(char to[BST_FITS_NAME_BYTES], const char *from) {
    snprintf(to, BST_FITS_NAME_BYTES, "%s", from ? from : "");
}

static void copy_names(bst_fits *fits, const bst_fits_info *info) {
    copy_name(fits->names.observer, info->observer);
    copy_name(fits->names.instrument, info->instrument);
    copy_name(fits->names.object, info->object);
    copy_name(fits->names.image_type, info->image_type);
    copy_name(fits->names.program, info->program);
    fits->names.camera = *info->camera;
}

/* Writes the primary HDU of a file of extensions, or of an empty cube. */
static bst_status write_primary(bst_ctx *ctx, bst_fits *fits) {
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    errno = 0;
    bst_fits_memory_open(&fits->memory, true, &code);
    bst_fits_put_run_keys(fits->memory.file, &fits->names, &code);
    bst_fits_put_content(fits->memory.file, fits->content, &code);
    bst_fits_put_statements(fits->memory.file, &code);
    bst_fits_put_sums(fits, fits->memory.file, &code);
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    bst_status status = bst_fits_check(ctx, fits, code, "cannot be made");
    if (status == BST_OK) {
        status = bst_fits_sign_hdu(ctx, fits, hdu, bytes, NULL, 0);
    }
    if (status == BST_OK) {
        status = bst_fits_start_file(ctx, fits, hdu, bytes);
    }
    bst_fits_memory_close(&fits->memory, &code);
    return status;
}

static void free_fits(bst_fits *fits) {
    bst_fits_queue_free(fits);
    bst_fits_cube_free(fits);
    if (fits->file >= 0) {
        close(fits->file);
    }
    bst_fits_memory_free(&fits->memory);
    free(fits->buffer);
    free(fits);
}

/* Checks the arguments and makes a bst_fits without a file. */
static bst_status make(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                       const bst_fits_info *info, bst_fits **out) {
    *out = NULL;
    if (layout == BST_FITS_CUBE && info->compression != BST_FITS_RAW) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a cube is not compressed", path);
    }
    if (info->content != BST_FITS_COUNTS &&
        (layout == BST_FITS_CUBE || info->compression != BST_FITS_RAW)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: planes are extensions, not compressed", path);
    }
    bst_fits *fits = calloc(1, sizeof *fits);
    if (!fits) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    fits->file = fits->cube.rows = -1;
    fits->buffer = malloc(BST_FITS_BUFFER_PIXELS * sizeof *fits->buffer);
    if (!fits->buffer) {
        free_fits(fits);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    int n = snprintf(fits->path, sizeof fits->path, "%s", path);
    if (n < 0 || (size_t)n + 16 >= sizeof fits->path) {
        free_fits(fits);
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    }
    fits->layout = layout;
    fits->compression = info->compression;
    fits->content = info->content;
    fits->checksums = info->checksums;
    copy_names(fits, info);
    *out = fits;
    return BST_OK;
}

/* Starts the thread of a compressed file; gives the file to the caller, or frees it after an
 * error. */
static bst_status complete(bst_ctx *ctx, bst_status status, bst_fits *fits, bst_fits **out) {
    if (status == BST_OK && fits->compression == BST_FITS_RICE) {
        status = bst_fits_queue_create(ctx, fits);
    }
    if (status != BST_OK) {
        free_fits(fits);
        return status;
    }
    *out = fits;
    return BST_OK;
}

bst_status bst_fits_create(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) {
    bst_fits *fits;
    *out = NULL;
    BST_TRY(make(ctx, path, layout, info, &fits));
    bst_status status = BST_OK;
    struct stat there;
    if (lstat(fits->path, &there) == 0) {
        errno = EEXIST;
        status = bst_fits_fail_errno(ctx, fits, "cannot be made");
    } else if (layout == BST_FITS_CUBE) {
        status = bst_fits_cube_open(ctx, fits);
    } else {
        status = write_primary(ctx, fits);
    }
    return complete(ctx, status, fits, out);
}

bst_status bst_fits_reopen(bst_ctx *ctx, const char *path, bst_fits_layout layout,
                           const bst_fits_info *info, bst_fits **out) {
    bst_fits *fits;
    *out = NULL;
    BST_TRY(make(ctx, path, layout, info, &fits));
    bst_status status = BST_OK;
    fits->file = open(fits->path, O_RDWR | O_NOFOLLOW | O_CLOEXEC);
    if (fits->file < 0) {
        status = bst_fits_fail_errno(ctx, fits, "cannot be opened");
    } else if (layout == BST_FITS_CUBE) {
        status = bst_fits_cube_open(ctx, fits);
    }
    return complete(ctx, status, fits, out);
}

/* Removes what was appended to the file after the saved state. */
static bst_status cut(bst_ctx *ctx, bst_fits *fits) {
    struct stat there;
    if (fstat(fits->file, &there) != 0) {
        return bst_fits_fail_errno(ctx, fits, "cannot be read");
    }
    if (there.st_size < fits->end) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: has %lld bytes, the saved state needs %lld: the run cannot go on from "
                        "it; run it again from the start",
                        fits->path, (long long)there.st_size, fits->end);
    }
    if (fits->layout == BST_FITS_CUBE) {
        BST_TRY(bst_fits_cube_cut(ctx, fits));
    }
    return bst_fits_close_tail(fits) ? BST_OK : bst_fits_fail_errno(ctx, fits, "cannot be cut");
}

bst_status bst_fits_archive(bst_ctx *ctx, bst_fits *fits, bst_archive *archive) {
    if (!bst_archive_is_restoring(archive)) {
        BST_TRY(bst_fits_flush(ctx, fits));
        if (fits->file >= 0 && fdatasync(fits->file) != 0) {
            return bst_fits_fail_errno(ctx, fits, "cannot be flushed to disk");
        }
    }
    fits->end = bst_archive_integer(archive, fits->end, 0, INT64_MAX);
    fits->frames = bst_archive_integer(archive, fits->frames, 0, INT64_MAX);
    if (fits->layout == BST_FITS_CUBE) {
        BST_TRY(bst_fits_cube_archive(ctx, fits, archive));
    }
    bst_status status = bst_archive_is_restoring(archive) ? cut(ctx, fits) : BST_OK;
    if (status != BST_OK) { /* so that bst_fits_close does not complete the file */
        close(fits->file);
        fits->file = -1;
    }
    return status;
}

bst_status bst_fits_write(bst_ctx *ctx, bst_fits *fits, const bst_fits_frame *frame,
                          const uint16_t *pixels, int width, int height, int64_t *index) {
    if (width < 1 || height < 1 || frame->bits < 1 || frame->bits > 16) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: a frame of %d x %d pixels at %d bits",
                        fits->path, width, height, frame->bits);
    }
    int64_t number = fits->frames + 1;
    if (fits->layout == BST_FITS_CUBE) {
        BST_TRY(bst_fits_cube_write(ctx, fits, frame, pixels, width, height));
    } else if (fits->queue) {
        BST_TRY(bst_fits_queue_put(ctx, fits, frame, pixels, width, height, number));
    } else {
        BST_TRY(bst_fits_write_extension(ctx, fits, frame, pixels, width, height, number));
    }
    fits->frames++;
    if (index) {
        *index = fits->layout == BST_FITS_CUBE ? fits->frames - 1 : fits->frames;
    }
    return BST_OK;
}

bst_status bst_fits_write_single(bst_ctx *ctx, const char *path, const bst_fits_info *info,
                                 const bst_fits_frame *frame, const uint16_t *pixels, int width,
                                 int height) {
    bst_fits *fits = calloc(1, sizeof *fits);
    if (!fits) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    fits->file = fits->cube.rows = -1;
    snprintf(fits->path, sizeof fits->path, "%s", path);
    copy_names(fits, info);
    long size[2] = {width, height};
    char *hdu = NULL;
    long long bytes = 0;
    int code = 0;
    errno = 0;
    bst_fits_memory_open(&fits->memory, false, &code);
    fitsfile *file = fits->memory.file;
    fits_create_img(file, USHORT_IMG, 2, size, &code);
    fits_write_key_str(file, "CREATOR", fits->names.program, "program that made this file", &code);
    fits_write_key_str(file, "TELESCOP", fits->names.observer, "observing spacecraft", &code);
    bst_fits_put_frame_keys(file, &fits->names, frame, &code);
    bst_fits_put_statements(file, &code);
    /* cfitsio's prototype lacks const; it does not write to the array */
    fits_write_img(file, TUSHORT, 1, (LONGLONG)width * height, (void *)(uintptr_t)pixels, &code);
    bst_fits_memory_hdu(&fits->memory, &hdu, &bytes, &code);
    bst_status status = bst_fits_check(ctx, fits, code, "cannot be made");
    if (status == BST_OK) {
        status = bst_io_write_file_atomic(ctx, path, hdu, (size_t)bytes);
    }
    bst_fits_memory_close(&fits->memory, &code);
    free_fits(fits);
    return status;
}

bst_status bst_fits_flush(bst_ctx *ctx, bst_fits *fits) {
    return fits && fits->queue ? bst_fits_queue_drain(ctx, fits) : BST_OK;
}

bst_status bst_fits_close(bst_ctx *ctx, bst_fits *fits) {
    if (!fits) {
        return BST_OK;
    }
    bst_status status = bst_fits_flush(ctx, fits);
    if (fits->layout == BST_FITS_CUBE) {
        status = bst_fits_cube_finish(ctx, fits);
    }
    int file = fits->file;
    fits->file = -1;
    if (file >= 0 && close(file) != 0 && status == BST_OK) {
        status = bst_fits_fail_errno(ctx, fits, "cannot be completed");
    }
    free_fits(fits);
    return status;
}
