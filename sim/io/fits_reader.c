#include "sim/io/fits_reader.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/io/fits_cards_internal.h"
#include "sim/io/fits_reader_internal.h"

enum {
    READ_BLOCKS = 4,     /* blocks of a header per read; our headers have 3 or 4 */
    MOST_BLOCKS = 1000,  /* maximum blocks of a header */
    MOST_RICE_BLOCK = 64 /* maximum pixels of a Rice block */
};

/* Reads `bytes` at offset `at`, within the size that the file had when opened. */
bst_status bst_fits_read_at(bst_ctx *ctx, const bst_fits_reader *reader, void *out, uint64_t bytes,
                            uint64_t at) {
    if (at > reader->bytes || bytes > reader->bytes - at) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: is cut short", reader->path);
    }
    if (reader->fd < 0) {
        memcpy(out, reader->data + at, bytes);
        return BST_OK;
    }
    for (uint64_t done = 0; done < bytes;) {
        ssize_t n = pread(reader->fd, (char *)out + done, bytes - done, (off_t)(at + done));
        if (n == 0) {
            return bst_fail(ctx, BST_ERR_IO, "%.400s: became shorter while it was read",
                            reader->path);
        }
        if (n < 0 && errno != EINTR) {
            return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", reader->path,
                            strerror(errno));
        }
        done += n > 0 ? (uint64_t)n : 0;
    }
    return BST_OK;
}

static bool has_end(const char *cards, size_t bytes) {
    for (size_t at = 0; at < bytes; at += BST_FITS_CARD) {
        if (memcmp(cards + at, "END     ", 8) == 0) {
            return true;
        }
    }
    return false;
}

/* Loads a header up to the block with END. */
static bst_status load_header(bst_ctx *ctx, bst_fits_reader *reader, const bst_fits_hdu *h,
                              bst_fits_cards *cards) {
    reader->header_bytes = 0;
    uint64_t left = reader->bytes - h->at;
    for (bool ended = false; !ended && reader->header_bytes < left;) {
        uint64_t more = READ_BLOCKS * BST_FITS_BLOCK;
        more = more < left - reader->header_bytes ? more : left - reader->header_bytes;
        more -= more % BST_FITS_BLOCK;
        size_t bytes = reader->header_bytes + (size_t)more;
        if (more == 0 || bytes > (size_t)MOST_BLOCKS * BST_FITS_BLOCK) {
            break;
        }
        if (bytes > reader->header_room) {
            char *header = realloc(reader->header, bytes * 2);
            if (!header) {
                return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a FITS header");
            }
            reader->header = header;
            reader->header_room = bytes * 2;
        }
        char *start = reader->header + reader->header_bytes;
        BST_TRY(bst_fits_read_at(ctx, reader, start, more, h->at + reader->header_bytes));
        reader->header_bytes = bytes;
        /* without SIMPLE or XTENSION it is no header: do not search for END */
        ended = has_end(start, (size_t)more) || (memcmp(reader->header, "SIMPLE", 6) != 0 &&
                                                 memcmp(reader->header, "XTENSION", 8) != 0);
    }
    return bst_fits_read_cards(ctx, reader->path, h->number, reader->header, reader->header_bytes,
                               cards);
}

static int64_t int_of(const bst_fits_reader *reader, const char *key, int64_t fallback) {
    int64_t value;
    return bst_fits_card_int(reader->header, reader->header_bytes, key, &value) ? value : fallback;
}

static bool is_text(const bst_fits_reader *reader, const char *key, const char *expected) {
    char value[BST_FITS_CARD];
    return bst_fits_card_text(reader->header, reader->header_bytes, key, value) &&
           strncmp(value, expected, strlen(expected)) == 0;
}

/* Checks for 16-bit unsigned pixels, or 32-bit signed ones in a file of masks; "32768" and "32768."
 * both occur. */
static bool are_known_pixels(const bst_fits_reader *reader, int64_t bitpix) {
    char value[BST_FITS_CARD] = "", *end;
    double zero = 0.0, scale = 1.0;
    if (bst_fits_card_text(reader->header, reader->header_bytes, "BZERO", value)) {
        zero = strtod(value, &end);
    }
    if (bst_fits_card_text(reader->header, reader->header_bytes, "BSCALE", value)) {
        scale = strtod(value, &end);
    }
    return reader->items ? bitpix == 32 && zero == 0.0 && scale == 1.0
                         : bitpix == 16 && zero == 32768.0 && scale == 1.0;
}

static bst_status not_a_frame(bst_ctx *ctx, const bst_fits_reader *reader, const bst_fits_hdu *h,
                              const char *what) {
    return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: HDU %d: %s (allowed: %s)", reader->path,
                    h->number, what,
                    reader->items ? "32-bit images that are not compressed"
                                  : "16-bit unsigned images, as they are or compressed by RICE_1, "
                                    "a row to a tile");
}

/* Reads the layout of a compressed image from its header. */
static bst_status read_packed_layout(bst_ctx *ctx, const bst_fits_reader *reader,
                                     const bst_fits_cards *cards, bst_fits_hdu *h) {
    static const char *const sizes[] = {"ZNAXIS1", "ZNAXIS2", "ZNAXIS3"};
    static const char *const tiles[] = {"ZTILE1", "ZTILE2", "ZTILE3"};
    h->compressed = true;
    h->axes = int_of(reader, "ZNAXIS", 0);
    if (h->axes != 2 && h->axes != 3) {
        h->axes = 0;
        return BST_OK;
    }
    int64_t rows = 1;
    bool row_tiles = true;
    for (int i = 0; i < h->axes; i++) {
        h->size[i] = int_of(reader, sizes[i], -1);
        row_tiles = row_tiles &&
                    int_of(reader, tiles[i], i == 0 ? h->size[0] : 1) == (i == 0 ? h->size[0] : 1);
        rows *= i > 0 && h->size[i] <= INT32_MAX ? h->size[i] : 1;
    }
    h->p.block = (int)int_of(reader, "ZVAL1", 32);
    h->p.wide = is_text(reader, "TFORM1", "1Q") || is_text(reader, "TFORM1", "Q");
    h->p.row_bytes = cards->axes[0];
    if (reader->items || !is_text(reader, "ZCMPTYPE", "RICE_1") || !row_tiles) {
        return not_a_frame(ctx, reader, h, "is compressed in another way");
    }
    if (!are_known_pixels(reader, int_of(reader, "ZBITPIX", 0)) ||
        int_of(reader, "ZVAL2", 4) != 2) {
        return not_a_frame(ctx, reader, h, "has pixels of another kind");
    }
    bool known = is_text(reader, "TTYPE1", "COMPRESSED_DATA") &&
                 (h->p.wide || is_text(reader, "TFORM1", "1P") || is_text(reader, "TFORM1", "P")) &&
                 is_text(reader, "ZNAME1", "BLOCKSIZE") && is_text(reader, "ZNAME2", "BYTEPIX") &&
                 h->p.block >= 1 && h->p.block <= MOST_RICE_BLOCK && cards->naxis == 2 &&
                 cards->bitpix == 8 && h->p.row_bytes >= (h->p.wide ? 16 : 8) &&
                 cards->axes[1] == rows;
    uint64_t table = known ? (uint64_t)h->p.row_bytes * (uint64_t)cards->axes[1] : 0;
    uint64_t heap = (uint64_t)int_of(reader, "THEAP", (int64_t)table);
    if (!known || heap < table || heap > cards->data_bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%.400s: HDU %d: its table is not that of the compressed image it claims "
                        "to be",
                        reader->path, h->number);
    }
    h->p.heap_at = h->data_at + heap;
    h->p.heap_bytes = cards->data_bytes - heap;
    return BST_OK;
}

/* Interprets the header in memory. *whole false: the data extend beyond the end of the file. */
static bst_status interpret(bst_ctx *ctx, const bst_fits_reader *reader,
                            const bst_fits_cards *cards, bst_fits_hdu *h, bool *whole) {
    uint64_t blocks = (cards->data_bytes + BST_FITS_BLOCK - 1) / BST_FITS_BLOCK;
    h->data_at = h->at + cards->bytes;
    h->end = h->data_at + blocks * BST_FITS_BLOCK;
    *whole = h->end <= reader->bytes;
    h->axes = 0;
    h->compressed = false;
    h->size[0] = h->size[1] = h->size[2] = 1;
    if (cards->is_compressed) {
        BST_TRY(read_packed_layout(ctx, reader, cards, h));
    } else if ((h->number == 1 || is_text(reader, "XTENSION", "IMAGE")) &&
               (cards->naxis == 2 || cards->naxis == 3)) {
        h->axes = cards->naxis;
        for (int i = 0; i < h->axes; i++) {
            h->size[i] = cards->axes[i];
        }
        if (!are_known_pixels(reader, cards->bitpix)) {
            return not_a_frame(ctx, reader, h, "has pixels of another kind");
        }
    }
    for (int i = 0; i < 2 && h->axes > 0; i++) {
        if (h->size[i] < 1 || h->size[i] > BST_FITS_LONGEST_SIDE) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: an image of %lld x %lld pixels (allowed: sides of 1 "
                            "to %d)",
                            reader->path, h->number, (long long)h->size[0], (long long)h->size[1],
                            BST_FITS_LONGEST_SIDE);
        }
    }
    return BST_OK;
}

/* Reads and interprets the FITS header at the position of an HDU. */
static bst_status look(bst_ctx *ctx, bst_fits_reader *reader, bst_fits_hdu *h, bool *whole) {
    bst_fits_cards cards;
    BST_TRY(load_header(ctx, reader, h, &cards));
    return interpret(ctx, reader, &cards, h, whole);
}

/* Adds the HDU of a frame to the index of the file. */
static bst_status add_frame(bst_ctx *ctx, bst_fits_reader *reader, const bst_fits_hdu *h) {
    bst_fits_file_info *info = &reader->info;
    if ((size_t)info->frames == reader->frame_room) {
        size_t room = reader->frame_room ? 2 * reader->frame_room : 64;
        bst_fits_frame_place *frames = realloc(reader->frames, room * sizeof *frames);
        if (!frames) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the places of %zu frames",
                            room);
        }
        reader->frames = frames;
        reader->frame_room = room;
    }
    reader->frames[info->frames++] = (bst_fits_frame_place){h->at, h->number};
    info->compressed = info->compressed || h->compressed;
    info->width = h->size[0] > info->width ? (int)h->size[0] : info->width;
    info->height = h->size[1] > info->height ? (int)h->size[1] : info->height;
    return BST_OK;
}

/* Counts the frames of a file with one extension per frame, starting after HDU `h`. */
static bst_status count_extensions(bst_ctx *ctx, bst_fits_reader *reader, bst_fits_hdu h) {
    bool whole = true;
    bst_ctx unheard = {0};
    for (;;) {
        h.at = h.end;
        h.number++;
        if (h.at >= reader->bytes) {
            return BST_OK;
        }
        bst_fits_cards cards;
        bst_status status = load_header(&unheard, reader, &h, &cards);
        if (status == BST_ERR_FORMAT) { /* no header, or an incomplete one */
            reader->info.cut_off = true;
            return BST_OK;
        }
        if (status != BST_OK) {
            return bst_fail(ctx, status, "%s", unheard.message);
        }
        BST_TRY(interpret(ctx, reader, &cards, &h, &whole));
        if (!whole) {
            reader->info.cut_off = true;
            return BST_OK;
        }
        if (h.axes == 2) {
            BST_TRY(add_frame(ctx, reader, &h));
        }
    }
}

/* Finds the table after a cube; FRAMEID is its first column. */
static void find_ids(bst_fits_reader *reader, const bst_fits_hdu *cube) {
    bst_ctx unheard = {0};
    bst_fits_cards cards;
    bst_fits_hdu h = {.number = cube->number + 1, .at = cube->end};
    if (h.at >= reader->bytes || load_header(&unheard, reader, &h, &cards) != BST_OK ||
        !is_text(reader, "XTENSION", "BINTABLE") || !is_text(reader, "TTYPE1", "FRAMEID") ||
        !is_text(reader, "TFORM1", "1K") || cards.naxis != 2 || cards.axes[0] < 8 ||
        cards.data_bytes > reader->bytes - h.at - cards.bytes) {
        return;
    }
    reader->ids_at = h.at + cards.bytes;
    reader->id_step = cards.axes[0];
    reader->id_count = cards.axes[1];
}

static bst_status take_cube(bst_ctx *ctx, bst_fits_reader *reader, const bst_fits_hdu *h,
                            bool whole) {
    bst_fits_file_info *info = &reader->info;
    uint64_t plane = (uint64_t)h->size[0] * (uint64_t)h->size[1] * 2;
    info->cube = true;
    info->compressed = h->compressed;
    info->width = (int)h->size[0];
    info->height = (int)h->size[1];
    info->frames = h->size[2];
    reader->cube = *h;
    if (!whole) {
        uint64_t there = reader->bytes > h->data_at ? reader->bytes - h->data_at : 0;
        info->frames = h->compressed ? 0 : (int64_t)(there / plane);
        info->frames = info->frames < h->size[2] ? info->frames : h->size[2];
        info->cut_off = true;
        return BST_OK;
    }
    find_ids(reader, h);
    return h->size[2] < 0 ? bst_fail(ctx, BST_ERR_FORMAT, "%.400s: HDU %d: ZNAXIS3 is wrong",
                                     reader->path, h->number)
                          : BST_OK;
}

static bst_status count_frames(bst_ctx *ctx, bst_fits_reader *reader) {
    bst_fits_hdu h = {.number = 1};
    bool whole = true;
    BST_TRY(look(ctx, reader, &h, &whole));
    if (h.axes == 3) {
        return take_cube(ctx, reader, &h, whole);
    }
    /* a compressed cube is in the first extension, after an empty primary array */
    bst_fits_hdu second = {.number = 2, .at = h.end};
    bst_ctx unheard = {0};
    if (whole && second.at < reader->bytes && look(&unheard, reader, &second, &whole) == BST_OK &&
        second.axes == 3) {
        return take_cube(ctx, reader, &second, whole);
    }
    if (h.end > reader->bytes) {
        reader->info.cut_off = true;
        return BST_OK;
    }
    return count_extensions(ctx, reader, h);
}

static bst_status open_file(bst_ctx *ctx, bst_fits_reader *reader) {
    /* do not block on a pipe */
    reader->fd = open(reader->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat file;
    if (reader->fd < 0 || fstat(reader->fd, &file) != 0) {
        return bst_fail(ctx, errno == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO,
                        "%.400s: cannot be opened: %s", reader->path, strerror(errno));
    }
    if (!S_ISREG(file.st_mode)) {
        return bst_fail(ctx, BST_ERR_IO, "%.400s: is not a file", reader->path);
    }
    reader->bytes = (uint64_t)file.st_size;
    return BST_OK;
}

static bst_status open_reader(bst_ctx *ctx, const char *path, const void *data, uint64_t bytes,
                              bool items, bst_fits_reader **out) {
    *out = NULL;
    bst_fits_reader *reader = calloc(1, sizeof *reader);
    if (!reader) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    reader->fd = -1;
    reader->data = data;
    reader->bytes = bytes;
    reader->items = items;
    bst_status status = BST_OK;
    int n = snprintf(reader->path, sizeof reader->path, "%s", path);
    if (n < 0 || (size_t)n >= sizeof reader->path) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path);
    } else if (!data) {
        status = open_file(ctx, reader);
    }
    if (status == BST_OK) {
        status = count_frames(ctx, reader);
    }
    if (status != BST_OK) {
        bst_fits_reader_close(reader);
        return status;
    }
    *out = reader;
    return BST_OK;
}

bst_status bst_fits_reader_open(bst_ctx *ctx, const char *path, bst_fits_reader **out) {
    return open_reader(ctx, path, NULL, 0, false, out);
}

bst_status bst_fits_reader_open_masks(bst_ctx *ctx, const char *path, bst_fits_reader **out) {
    BST_TRY(open_reader(ctx, path, NULL, 0, true, out));
    if ((*out)->info.cube) {
        bst_fits_reader_close(*out);
        *out = NULL;
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: is a cube (allowed: an extension a mask)",
                        path);
    }
    return BST_OK;
}

bst_status bst_fits_reader_open_buffer(bst_ctx *ctx, const char *name, const void *data,
                                       uint64_t bytes, bst_fits_reader **out) {
    return open_reader(ctx, name, data ? data : "", data ? bytes : 0, false, out);
}

void bst_fits_reader_close(bst_fits_reader *reader) {
    if (reader) {
        if (reader->fd >= 0) {
            close(reader->fd);
        }
        free(reader->frames);
        free(reader->header);
        free(reader->row);
        free(reader->pixels);
        free(reader->mask);
        free(reader);
    }
}

const bst_fits_file_info *bst_fits_reader_info(const bst_fits_reader *reader) {
    return &reader->info;
}

/* Finds the HDU of a frame; loads its header unless it is the cube. */
bst_status bst_fits_find_frame(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                               bst_fits_hdu *h) {
    if (index < 0 || index >= reader->info.frames) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.400s: has no frame %lld; it has %lld",
                        reader->path, (long long)index, (long long)reader->info.frames);
    }
    if (reader->info.cube) {
        *h = reader->cube;
        return BST_OK;
    }
    bool whole;
    *h = (bst_fits_hdu){.number = reader->frames[index].number, .at = reader->frames[index].at};
    BST_TRY(look(ctx, reader, h, &whole));
    if (!whole || h->axes != 2) {
        return bst_fail(ctx, BST_ERR_IO, "%.400s: HDU %d: changed while it was read", reader->path,
                        h->number);
    }
    return BST_OK;
}

bst_status bst_fits_read_id(bst_ctx *ctx, const bst_fits_reader *reader, int64_t index,
                            int64_t *exposure_id) {
    *exposure_id = -1;
    if (!reader->info.cube) {
        *exposure_id = int_of(reader, "FRAMEID", -1);
    } else if (reader->ids_at > 0 && index < reader->id_count) {
        uint8_t bytes[8];
        BST_TRY(bst_fits_read_at(ctx, reader, bytes, 8,
                                 reader->ids_at + (uint64_t)index * (uint64_t)reader->id_step));
        *exposure_id = (int64_t)bst_fits_big_endian(bytes, 8);
    }
    return BST_OK;
}

bst_status bst_fits_reader_id(bst_ctx *ctx, bst_fits_reader *reader, int64_t index,
                              int64_t *exposure_id) {
    bst_fits_hdu h;
    BST_TRY(bst_fits_find_frame(ctx, reader, index, &h));
    return bst_fits_read_id(ctx, reader, index, exposure_id);
}
