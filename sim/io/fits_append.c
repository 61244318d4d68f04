/* HDUs are made by cfitsio in memory and appended to the file in an order that leaves no torn HDU
 * behind, whenever the process dies. A header without its END card is no header: the card's three
 * letters are written last. Until then the file's length is no multiple of a block, which tells
 * readers (astropy, cfitsio) that what follows the last HDU is not one. */
#include <errno.h>
#include <fcntl.h>
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

void bst_fits_memory_open(bst_fits_memory *memory, bool primary, int *code) {
    if (!memory->bytes && *code == 0) {
        memory->capacity = BST_FITS_BLOCK;
        memory->bytes = malloc(memory->capacity);
        if (!memory->bytes) {
            *code = MEMORY_ALLOCATION;
        }
    }
    fits_create_memfile(&memory->file, &memory->bytes, &memory->capacity, 64 * BST_FITS_BLOCK,
                        realloc, code);
    if (primary) {
        fits_create_img(memory->file, BYTE_IMG, 0, NULL, code);
    }
}

void bst_fits_memory_hdu(bst_fits_memory *memory, const char **bytes, long long *count, int *code) {
    LONGLONG head = 0, data, end = 0;
    fits_flush_file(memory->file, code);
    fits_get_hduaddrll(memory->file, &head, &data, &end, code);
    if (*code == 0) {
        *bytes = (const char *)memory->bytes + head;
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
    BST_TRY(bst_write_file_atomic(ctx, fits->path, hdu, (size_t)bytes));
    fits->file = open(fits->path, O_RDWR | O_CLOEXEC);
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

bst_status bst_fits_append_hdu(bst_ctx *ctx, bst_fits *fits, const char *hdu, long long bytes) {
    long long end_card = find_end_card(hdu, bytes);
    if (end_card < 0 || bytes % BST_FITS_BLOCK != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: an HDU without an end", fits->path);
    }
    long long after = end_card + 3;
    /* cards begin at multiples of 16 bytes, so that three letters never cross a memory page: the
     * last write is done or not done */
    if (bst_fits_open_tail(fits, bytes) &&
        bst_fits_write_at(fits->file, hdu, (size_t)end_card, fits->end) &&
        bst_fits_write_at(fits->file, hdu + after, (size_t)(bytes - after), fits->end + after) &&
        bst_fits_write_at(fits->file, hdu + end_card, 3, fits->end + end_card)) {
        fits->end += bytes;
        if (bst_fits_close_tail(fits)) {
            return BST_OK;
        }
        fits->end -= bytes;
    }
    bst_status status = bst_fits_fail_errno(ctx, fits, "cannot be written");
    if (!bst_fits_close_tail(fits)) {
        bst_log(ctx, BST_LOG_WARNING, "%s: its last %lld bytes are not valid", fits->path, bytes);
    }
    return status;
}
