/* Bytes and numbers of an open FITS file. */
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "sim/io/fits_source_internal.h"

/* Reads `bytes` at an offset inside the file. */
bst_status bst_fits_source_read_at(bst_ctx *ctx, const bst_fits_source *s, void *out,
                                   uint64_t bytes, uint64_t at) {
    if (at > s->bytes || bytes > s->bytes - at) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: is cut short", s->path);
    }
    for (uint64_t done = 0; done < bytes;) {
        ssize_t n = pread(s->fd, (char *)out + done, bytes - done, (off_t)(at + done));
        if (n == 0) {
            return bst_fail(ctx, BST_ERR_IO, "%.400s: became shorter while it was read", s->path);
        }
        if (n < 0 && errno != EINTR) {
            return bst_fail(ctx, BST_ERR_IO, "%.400s: cannot be read: %s", s->path,
                            strerror(errno));
        }
        done += n > 0 ? (uint64_t)n : 0;
    }
    return BST_OK;
}

int64_t bst_fits_source_int(const bst_fits_source_header *h, const char *key, int64_t fallback) {
    int64_t value;
    return bst_fits_card_int(h->text, h->bytes, key, &value) ? value : fallback;
}

/* Big-endian integer of 1 to 8 bytes; of one byte unsigned, else signed. */
static int64_t integer_at(const uint8_t *bytes, int width) {
    uint64_t v = width > 1 && bytes[0] & 0x80 ? UINT64_MAX : 0;
    for (int i = 0; i < width; i++) {
        v = v << 8 | bytes[i];
    }
    return (int64_t)v;
}

double bst_fits_source_real_at(const uint8_t *bytes, int width) {
    union {
        uint64_t u;
        double d;
    } wide = {.u = (uint64_t)integer_at(bytes, width)};
    union {
        uint32_t u;
        float f;
    } narrow = {.u = (uint32_t)wide.u};
    return width == 4 ? (double)narrow.f : wide.d;
}

int64_t bst_fits_source_integer_at(const uint8_t *bytes, int width) {
    return integer_at(bytes, width);
}
