#include "sim/io/fits_reader.h"

#include <fitsio.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { LONGEST_SIDE = 32768 };

struct bst_fits_reader {
    char path[4096];
    fitsfile *file;
    bst_fits_file_info info;
    int first_hdu; /* of the first frame */
    bool has_table;
    int id_column, table_hdu;
    uint16_t *pixels;
    size_t capacity;
};

static bst_status fail_cfitsio(bst_ctx *ctx, const bst_fits_reader *reader, int code) {
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", reader->path, reason);
}

static bst_status check_size(bst_ctx *ctx, const bst_fits_reader *reader, const LONGLONG *size) {
    if (size[0] < 1 || size[1] < 1 || size[0] > LONGEST_SIDE || size[1] > LONGEST_SIDE) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: an image of %lld x %lld pixels (allowed: sides of 1 to %d)",
                        reader->path, (long long)size[0], (long long)size[1], LONGEST_SIDE);
    }
    return BST_OK;
}

/* Type, axes and end of the current HDU's data. */
static void look(fitsfile *file, int *type, int *axes, LONGLONG size[3], LONGLONG *end, int *code) {
    LONGLONG head, data;
    size[0] = size[1] = size[2] = 0;
    *axes = 0;
    fits_get_hdu_type(file, type, code);
    if (*code == 0 && *type == IMAGE_HDU) {
        fits_get_img_dim(file, axes, code);
        fits_get_img_sizell(file, 3, size, code);
    }
    fits_get_hduaddrll(file, &head, &data, end, code);
}

/* Counts the frames of a file with an extension each. */
static bst_status count_extensions(bst_ctx *ctx, bst_fits_reader *reader, LONGLONG file_bytes) {
    bst_fits_file_info *info = &reader->info;
    int code = 0, type, axes;
    LONGLONG size[3], end;
    for (int hdu = 2;; hdu++) {
        fits_movabs_hdu(reader->file, hdu, &type, &code);
        if (code != 0) {
            /* the end, or a header that was being written when the run was killed */
            info->cut_off = info->cut_off || code != END_OF_FILE;
            fits_clear_errmsg();
            return BST_OK;
        }
        look(reader->file, &type, &axes, size, &end, &code);
        if (code != 0 || end > file_bytes) {
            info->cut_off = true;
            fits_clear_errmsg();
            return BST_OK;
        }
        if (axes != 2) {
            continue;
        }
        BST_TRY(check_size(ctx, reader, size));
        if (info->frames++ == 0) {
            reader->first_hdu = hdu;
            info->compressed = fits_is_compressed_image(reader->file, &code) != 0;
        }
        info->width = size[0] > info->width ? (int)size[0] : info->width;
        info->height = size[1] > info->height ? (int)size[1] : info->height;
    }
}

/* Whether the current HDU is the cube, and how much of it there is. */
static bst_status read_cube(bst_ctx *ctx, bst_fits_reader *reader, int hdu, const LONGLONG size[3],
                            LONGLONG file_bytes) {
    bst_fits_file_info *info = &reader->info;
    int code = 0, type;
    LONGLONG head, data, end, plane = size[0] * size[1] * 2;
    BST_TRY(check_size(ctx, reader, size));
    info->cube = true;
    info->width = (int)size[0];
    info->height = (int)size[1];
    info->frames = size[2];
    info->compressed = fits_is_compressed_image(reader->file, &code) != 0;
    reader->first_hdu = hdu;
    fits_get_hduaddrll(reader->file, &head, &data, &end, &code);
    if (code != 0) {
        return fail_cfitsio(ctx, reader, code);
    }
    if (!info->compressed && data + size[2] * plane > file_bytes) {
        info->frames = file_bytes > data ? (file_bytes - data) / plane : 0;
        info->cut_off = true;
    }
    fits_movabs_hdu(reader->file, hdu + 1, &type, &code);
    if (code == 0 && type == BINARY_TBL) {
        char name[] = "FRAMEID";
        fits_get_colnum(reader->file, CASEINSEN, name, &reader->id_column, &code);
        reader->table_hdu = hdu + 1;
        reader->has_table = code == 0;
    }
    fits_clear_errmsg();
    return BST_OK;
}

static bst_status count_frames(bst_ctx *ctx, bst_fits_reader *reader) {
    struct stat file;
    LONGLONG file_bytes = stat(reader->path, &file) == 0 ? (LONGLONG)file.st_size : 0;
    int code = 0, type, axes, count = 0;
    LONGLONG size[3], end;
    /* a compressed cube is in the first extension, below an empty primary array */
    for (int hdu = 1; hdu <= 2; hdu++) {
        fits_movabs_hdu(reader->file, hdu, &type, &code);
        if (code != 0) {
            break;
        }
        look(reader->file, &type, &axes, size, &end, &code);
        if (code == 0 && axes == 3) {
            return read_cube(ctx, reader, hdu, size, file_bytes);
        }
        count++;
    }
    fits_clear_errmsg();
    return count > 0 ? count_extensions(ctx, reader, file_bytes) : fail_cfitsio(ctx, reader, code);
}

bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path, bst_fits_reader **out) {
    *out = NULL;
    bst_fits_reader *reader = calloc(1, sizeof *reader);
    if (!reader) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bst_status status = BST_OK;
    int n = snprintf(reader->path, sizeof reader->path, "%s", path), code = 0;
    if (n < 0 || (size_t)n >= sizeof reader->path) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path);
    } else if (fits_open_diskfile(&reader->file, path, READONLY, &code) != 0) {
        status = fail_cfitsio(ctx, reader, code);
    } else {
        status = count_frames(ctx, reader);
    }
    if (status != BST_OK) {
        bst_fits_reader_close(reader);
        return status;
    }
    *out = reader;
    return BST_OK;
}

void bst_fits_reader_close(bst_fits_reader *reader) {
    if (reader) {
        int ignored = 0;
        if (reader->file) {
            fits_close_file(reader->file, &ignored);
            fits_clear_errmsg();
        }
        free(reader->pixels);
        free(reader);
    }
}

const bst_fits_file_info *bst_fits_reader_info(const bst_fits_reader *reader) {
    return &reader->info;
}

static bst_status make_room(bst_ctx *ctx, bst_fits_reader *reader, size_t count) {
    if (reader->capacity < count) {
        free(reader->pixels);
        reader->pixels = malloc(count * sizeof *reader->pixels);
        reader->capacity = reader->pixels ? count : 0;
    }
    return reader->pixels ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a frame");
}

static bst_status check_index(bst_ctx *ctx, const bst_fits_reader *reader, int64_t index) {
    if (index < 0 || index >= reader->info.frames) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: has no frame %lld; it has %lld", reader->path,
                        (long long)index, (long long)reader->info.frames);
    }
    return BST_OK;
}

bst_status bst_fits_reader_id(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                              int64_t *exposure_id) {
    BST_TRY(check_index(ctx, reader, index));
    int code = 0, type, any;
    LONGLONG id = -1;
    if (!reader->info.cube) {
        int missing = 0;
        fits_movabs_hdu(reader->file, reader->first_hdu + (int)index, &type, &code);
        if (code == 0 && fits_read_key_lnglng(reader->file, "FRAMEID", &id, NULL, &missing) != 0) {
            id = -1;
            fits_clear_errmsg();
        }
    } else if (reader->has_table) {
        fits_movabs_hdu(reader->file, reader->table_hdu, &type, &code);
        fits_read_col(reader->file, TLONGLONG, reader->id_column, (LONGLONG)index + 1, 1, 1, NULL,
                      &id, &any, &code);
    }
    *exposure_id = (int64_t)id;
    return code == 0 ? BST_OK : fail_cfitsio(ctx, reader, code);
}

static bst_status read_extension(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) {
    int code = 0, type, any;
    LONGLONG size[3] = {0, 0, 0};
    fits_movabs_hdu(reader->file, reader->first_hdu + (int)index, &type, &code);
    fits_get_img_sizell(reader->file, 2, size, &code);
    if (code != 0) {
        return fail_cfitsio(ctx, reader, code);
    }
    BST_TRY(check_size(ctx, reader, size));
    BST_TRY(make_room(ctx, reader, (size_t)(size[0] * size[1])));
    fits_read_img(reader->file, TUSHORT, 1, size[0] * size[1], NULL, reader->pixels, &any, &code);
    out->width = (int)size[0];
    out->height = (int)size[1];
    return code == 0 ? BST_OK : fail_cfitsio(ctx, reader, code);
}

static bst_status read_plane(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                             bst_fits_read_frame *out) {
    const bst_fits_file_info *info = &reader->info;
    int code = 0, type, any;
    long first[3] = {1, 1, (long)index + 1};
    long last[3] = {info->width, info->height, (long)index + 1};
    long step[3] = {1, 1, 1};
    BST_TRY(make_room(ctx, reader, (size_t)info->width * (size_t)info->height));
    fits_movabs_hdu(reader->file, reader->first_hdu, &type, &code);
    fits_read_subset(reader->file, TUSHORT, first, last, step, NULL, reader->pixels, &any, &code);
    out->width = info->width;
    out->height = info->height;
    return code == 0 ? BST_OK : fail_cfitsio(ctx, reader, code);
}

bst_status bst_fits_reader_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                                 bst_fits_read_frame *out) {
    BST_TRY(bst_fits_reader_id(ctx, reader, index, &out->exposure_id));
    BST_TRY(reader->info.cube ? read_plane(ctx, reader, index, out)
                              : read_extension(ctx, reader, index, out));
    out->pixels = reader->pixels;
    return BST_OK;
}
