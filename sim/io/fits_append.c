/* Appends HDUs to a FITS file so that a killed process leaves no damaged HDU. cfitsio makes the HDU
 * in memory. The three letters of its END card are written last. Until then the file length is no
 * multiple of a block; readers (astropy, cfitsio) therefore ignore the data after the last HDU. */
#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/io/fits_internal.h"
#include "sim/io/manifest.h"

#define CARD 80

bool bst_fits_write_at(int fd, const void *data, size_t bytes, long long offset) {
    const char *p = data;
    while (bytes > 0) {
        ssize_t n = pwrite(fd, p, bytes, (off_t)offset);
        if (n < 0 && errno != EINTR) {
            return false;
        }
        if (n > 0) {
            p += n;
            bytes -= (size_t)n;
            offset += n;
        }
    }
    return true;
}

/* Big-endian signed integers for BZERO 32768: v - 32768 inverts the top bit. */
static void to_fits(uint16_t *restrict out, const uint16_t *restrict in, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint16_t v = (uint16_t)(in[i] ^ 0x8000u);
        uint8_t *b = (uint8_t *)&out[i];
        b[0] = (uint8_t)(v >> 8);
        b[1] = (uint8_t)v;
    }
}

bool bst_fits_write_pixels(bst_fits *fits, const uint16_t *pixels, size_t count, long long offset,
                           long long fill) {
    static const char zeros[BST_FITS_BLOCK] = {0};
    bool ok = true;
    for (size_t done = 0; ok && done < count;) {
        size_t n = count - done < BST_FITS_BUFFER_PIXELS ? count - done : BST_FITS_BUFFER_PIXELS;
        to_fits(fits->buffer, pixels + done, n);
        ok = bst_fits_write_at(fits->file, fits->buffer, n * 2, offset + (long long)done * 2);
        done += n;
    }
    return ok && bst_fits_write_at(fits->file, zeros, (size_t)fill, offset + (long long)count * 2);
}

/* cfitsio takes the size of its memory as the length of the file; memory that is reused stores its
 * size in front. */
typedef union memory_head {
    size_t capacity;
    max_align_t align;
} memory_head;

static void *grow_kept(void *bytes, size_t size) {
    memory_head *head = bytes ? (memory_head *)bytes - 1 : NULL;
    if (head && size <= head->capacity) {
        return bytes;
    }
    size_t capacity = size + size / 4;
    head = realloc(head, sizeof *head + capacity);
    if (!head) {
        return NULL;
    }
    head->capacity = capacity;
    return head + 1;
}

void bst_fits_memory_free(bst_fits_memory *memory) {
    if (memory->bytes) {
        free((memory_head *)memory->bytes - 1);
    }
}

void bst_fits_memory_open(bst_fits_memory *memory, bool primary, int *code) {
    if (!memory->bytes && *code == 0) {
        memory->bytes = grow_kept(NULL, BST_FITS_BLOCK);
        if (!memory->bytes) {
            *code = MEMORY_ALLOCATION;
        }
    }
    memory->size = 0;
    /* grows by one block at a time: cfitsio 4.2 loses the end of a file that grows by more */
    fits_create_memfile(&memory->file, &memory->bytes, &memory->size, BST_FITS_BLOCK, grow_kept,
                        code);
    if (primary) {
        fits_create_img(memory->file, BYTE_IMG, 0, NULL, code);
    }
}

void bst_fits_memory_hdu(bst_fits_memory *memory, char **bytes, long long *count, int *code) {
    LONGLONG head = 0, data, end = 0;
    fits_flush_file(memory->file, code);
    fits_get_hduaddrll(memory->file, &head, &data, &end, code);
    if (*code == 0) {
        *bytes = (char *)memory->bytes + head;
        *count = end - head;
    }
}

void bst_fits_memory_close(bst_fits_memory *memory, int *code) {
    if (memory->file) {
        int own = 0;
        fits_close_file(memory->file, *code == 0 ? code : &own);
        memory->file = NULL;
    }
}

bst_status bst_fits_start_file(bst_ctx *ctx, bst_fits *fits, const char *hdu, long long bytes) {
    BST_TRY(bst_io_write_file_atomic(ctx, fits->path, hdu, (size_t)bytes));
    fits->file = open(fits->path, O_RDWR | O_NOFOLLOW | O_CLOEXEC);
    if (fits->file < 0) {
        return bst_fits_fail_errno(ctx, fits, "cannot be opened");
    }
    fits->end = bytes;
    return BST_OK;
}

bool bst_fits_open_tail(const bst_fits *fits, long long bytes) {
    return bst_fits_write_at(fits->file, "", 1, fits->end + bytes);
}

bool bst_fits_close_tail(const bst_fits *fits) {
    return ftruncate(fits->file, (off_t)fits->end) == 0;
}

/* Offset of the header's END card; -1 without one. */
static long long find_end_card(const char *hdu, long long bytes) {
    for (long long at = 0; at + CARD <= bytes; at += CARD) {
        if (memcmp(hdu + at, "END     ", 8) == 0) {
            return at;
        }
    }
    return -1;
}

/* Appends `bytes` of an HDU, then pixels (NULL: none). */
static bst_status append(bst_ctx *ctx, bst_fits *fits, const char *hdu, long long bytes,
                         const uint16_t *pixels, size_t count) {
    long long end_card = find_end_card(hdu, bytes);
    if (end_card < 0 || bytes % BST_FITS_BLOCK != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: an HDU without an end", fits->path);
    }
    long long data = (long long)count * 2,
              fill = (BST_FITS_BLOCK - data % BST_FITS_BLOCK) % BST_FITS_BLOCK;
    long long whole = bytes + data + fill, after = end_card + 3;
    /* cards start at multiples of 16 bytes: the three letters are in one memory page, and the last
     * write is atomic */
    bool ok =
        bst_fits_open_tail(fits, whole) &&
        bst_fits_write_at(fits->file, hdu, (size_t)end_card, fits->end) &&
        bst_fits_write_at(fits->file, hdu + after, (size_t)(bytes - after), fits->end + after) &&
        bst_fits_write_pixels(fits, pixels, count, fits->end + bytes, fill) &&
        bst_fits_write_at(fits->file, hdu + end_card, 3, fits->end + end_card);
    if (ok) {
        fits->end += whole;
        if (bst_fits_close_tail(fits)) {
            return BST_OK;
        }
        fits->end -= whole;
    }
    bst_status status = bst_fits_fail_errno(ctx, fits, "cannot be written");
    if (!bst_fits_close_tail(fits)) {
        bst_log(ctx, BST_LOG_WARNING, "%s: what follows the last whole frame is not valid",
                fits->path);
    }
    return status;
}

bst_status bst_fits_append_hdu(bst_ctx *ctx, bst_fits *fits, const char *hdu, long long bytes) {
    return append(ctx, fits, hdu, bytes, NULL, 0);
}

bst_status bst_fits_append_image(bst_ctx *ctx, bst_fits *fits, const char *header, long long bytes,
                                 const uint16_t *pixels, size_t count) {
    return append(ctx, fits, header, bytes, pixels, count);
}
