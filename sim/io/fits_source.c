#include "sim/io/fits_source.h"

#include <assert.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/file.h"
#include "sim/io/fits_source_internal.h"

enum { LONGEST_SIDE = 32768, MOST_HEADER_BLOCKS = 1000, READ_BLOCKS = 8, MOST_FRAMES = 1 << 24 };
static const uint64_t MAX_FILE_BYTES = (uint64_t)1 << 46;

/* True if a block of cards holds END. */
static bool has_end(const char *cards, size_t bytes) {
    for (size_t at = 0; at + BST_FITS_CARD <= bytes; at += BST_FITS_CARD) {
        if (memcmp(cards + at, "END     ", 8) == 0) {
            return true;
        }
    }
    return false;
}

bst_status bst_fits_source_load_header(bst_ctx *ctx, const bst_fits_source *s, int number,
                                       uint64_t at, bst_fits_source_header *h) {
    h->bytes = 0;
    for (bool ended = false; !ended;) {
        uint64_t left = s->bytes - at - h->bytes, more = (uint64_t)READ_BLOCKS * BST_FITS_BLOCK;
        more = more < left ? more : left - left % BST_FITS_CARD;
        size_t bytes = h->bytes + (size_t)more;
        if (more == 0 || bytes > (size_t)MOST_HEADER_BLOCKS * BST_FITS_BLOCK) {
            break; /* the parser says what is missing */
        }
        if (bytes > h->room) {
            char *text = realloc(h->text, 2 * bytes);
            if (!text) {
                return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for a header", s->path);
            }
            h->text = text;
            h->room = 2 * bytes;
        }
        BST_TRY(bst_fits_source_read_at(ctx, s, h->text + h->bytes, more, at + h->bytes));
        ended = has_end(h->text + h->bytes, (size_t)more) ||
                (h->bytes == 0 && memcmp(h->text, "SIMPLE", 6) != 0 &&
                 memcmp(h->text, "XTENSION", 8) != 0);
        h->bytes = bytes;
    }
    return bst_fits_read_cards(ctx, s->path, number, h->text, h->bytes, &h->cards);
}

/* Value of a key as a number; `fallback` if it is missing or no number. */
static double real_of(const bst_fits_source_header *h, const char *key, double fallback) {
    char text[BST_FITS_CARD], *end;
    if (!bst_fits_card_text(h->text, h->bytes, key, text)) {
        return fallback;
    }
    for (char *d = text; *d; d++) {
        *d = *d == 'D' || *d == 'd' ? 'E' : *d; /* FITS writes 1.0D0 too */
    }
    double value = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(value) ? value : fallback;
}

/* Checks the sides of an image. */
static bst_status check_sides(bst_ctx *ctx, const bst_fits_source *s, const bst_fits_source_hdu *h,
                              bool compressed) {
    for (int i = 0; i < 3; i++) {
        int64_t most = i < 2 ? LONGEST_SIDE : MOST_FRAMES;
        if (h->size[i] < 1 || h->size[i] > most) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: %sNAXIS%d is %" PRId64 " (allowed: 1 to %" PRId64 ")",
                            s->path, h->number, compressed ? "Z" : "", i + 1, h->size[i], most);
        }
    }
    return BST_OK;
}

/* Describes an image by its header; size[0] 0: the HDU is none. */
static bst_status describe(bst_ctx *ctx, const bst_fits_source *s, const bst_fits_source_header *h,
                           bst_fits_source_hdu *out) {
    static const char *const keys[] = {"ZNAXIS1", "ZNAXIS2", "ZNAXIS3"};
    const bst_fits_cards *c = &h->cards;
    out->compressed = c->is_compressed;
    int64_t axes = c->is_compressed ? bst_fits_source_int(h, "ZNAXIS", 0) : c->naxis;
    out->size[0] = 0;
    out->size[1] = out->size[2] = 1;
    if ((c->is_table && !c->is_compressed) || axes < 2 || axes > 3) {
        return BST_OK;
    }
    for (int i = 0; i < axes; i++) {
        out->size[i] = c->is_compressed ? bst_fits_source_int(h, keys[i], -1) : c->axes[i];
    }
    out->planes = axes == 3;
    out->bitpix = (int)(c->is_compressed ? bst_fits_source_int(h, "ZBITPIX", 0) : c->bitpix);
    out->zero = real_of(h, "BZERO", 0.0);
    out->scale = real_of(h, "BSCALE", 1.0);
    out->has_blank = out->bitpix > 0 && bst_fits_card_int(h->text, h->bytes, "BLANK", &out->blank);
    return check_sides(ctx, s, out, c->is_compressed);
}

/* Adds an HDU with frames to the list. */
static bst_status add(bst_ctx *ctx, bst_fits_source *s, const bst_fits_source_hdu *h) {
    if (s->count == s->room) {
        size_t room = s->room ? 2 * s->room : 16;
        bst_fits_source_hdu *hdus = realloc(s->hdus, room * sizeof *hdus);
        if (!hdus) {
            return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for %zu images", s->path, room);
        }
        s->hdus = hdus;
        s->room = room;
    }
    s->hdus[s->count] = *h;
    s->hdus[s->count].first = s->frames;
    s->frames += h->size[2];
    s->count++;
    return s->frames <= MOST_FRAMES
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT, "%.400s: more than %d frames (allowed: that many)",
                          s->path, MOST_FRAMES);
}

/* Checks that the data of an HDU are in the file. */
static bst_status check_data(bst_ctx *ctx, const bst_fits_source *s, int number, uint64_t data_at,
                             uint64_t data_bytes) {
    uint64_t there = s->bytes > data_at ? s->bytes - data_at : 0;
    return there >= data_bytes
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: HDU %d: is cut short: BITPIX and NAXISn ask for %" PRIu64
                          " bytes of data, the file has %" PRIu64
                          "; copy or download the file again",
                          s->path, number, data_bytes, there);
}

/* Lists the frames of all HDUs. */
static bst_status list_frames(bst_ctx *ctx, bst_fits_source *s) {
    uint64_t at = 0;
    for (int number = 1; at < s->bytes; number++) {
        bst_fits_source_header *h = number == 1 ? &s->primary : &s->header;
        char begins[8] = "";
        uint64_t left = s->bytes - at < sizeof begins ? s->bytes - at : sizeof begins;
        BST_TRY(bst_fits_source_read_at(ctx, s, begins, left, at));
        if (number > 1 && memcmp(begins, "XTENSION", 8) != 0) {
            break; /* special records, or padding */
        }
        BST_TRY(bst_fits_source_load_header(ctx, s, number, at, h));
        bst_fits_source_hdu hdu = {.number = number, .at = at, .data_at = at + h->cards.bytes};
        BST_TRY(describe(ctx, s, h, &hdu));
        BST_TRY(check_data(ctx, s, number, hdu.data_at, h->cards.data_bytes));
        hdu.end = hdu.data_at +
                  (h->cards.data_bytes + BST_FITS_BLOCK - 1) / BST_FITS_BLOCK * BST_FITS_BLOCK;
        if (hdu.size[0] > 0) {
            BST_TRY(add(ctx, s, &hdu));
        }
        at = hdu.end;
    }
    return s->frames > 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: has no image (allowed: HDUs with NAXIS 2 or 3)", s->path);
}

bst_status bst_fits_source_open(bst_ctx *ctx, const char *path, bst_fits_source **out) {
    assert(path && out);
    *out = NULL;
    bst_fits_source *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory to open it", path);
    }
    s->fd = -1;
    s->selected = -1;
    int n = snprintf(s->path, sizeof s->path, "%s", path);
    bst_status status = BST_OK;
    if (n < 0 || (size_t)n >= sizeof s->path) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT, "%.80s...: the path is too long", path);
    }
    if (status == BST_OK) {
        status = bst_file_open(ctx, path, MAX_FILE_BYTES, "a FITS file", &s->fd, &s->bytes);
    }
    char begins[9] = "";
    if (status == BST_OK) {
        uint64_t some = s->bytes < 8 ? s->bytes : 8;
        status = bst_fits_source_read_at(ctx, s, begins, some, 0);
    }
    if (status == BST_OK && memcmp(begins, "SIMPLE  ", 8) != 0) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%.400s: does not begin as a FITS file does (allowed: SIMPLE; unpack "
                          "files that are compressed as a whole)",
                          path);
    }
    if (status == BST_OK) {
        status = list_frames(ctx, s);
    }
    if (status != BST_OK) {
        bst_fits_source_close(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_fits_source_close(bst_fits_source *s) {
    if (!s) {
        return;
    }
    if (s->fd >= 0) {
        close(s->fd);
    }
    free(s->primary.text);
    free(s->header.text);
    free(s->table.text);
    free(s->hdus);
    free(s);
}

const char *bst_fits_source_path(const bst_fits_source *s) {
    return s->path;
}

int64_t bst_fits_source_count(const bst_fits_source *s) {
    return s->frames;
}

/* Loads the header of the HDU with number `k`, and of the table behind a cube. */
static bst_status load_hdu(bst_ctx *ctx, bst_fits_source *s, size_t k) {
    const bst_fits_source_hdu *h = &s->hdus[k];
    s->table.bytes = 0;
    BST_TRY(bst_fits_source_load_header(ctx, s, h->number, h->at, &s->header));
    s->selected = (int64_t)k;
    bst_ctx unheard = {0};
    if (h->planes && h->end < s->bytes &&
        bst_fits_source_load_header(&unheard, s, h->number + 1, h->end, &s->table) == BST_OK) {
        const bst_fits_cards *c = &s->table.cards;
        s->table_at = h->end + c->bytes;
        bool fits = c->is_table && !c->is_compressed && c->naxis == 2 && c->axes[0] > 0 &&
                    c->axes[1] == h->size[2] && c->data_bytes <= s->bytes - s->table_at;
        s->table.bytes = fits ? s->table.bytes : 0;
    } else {
        s->table.bytes = 0;
    }
    return BST_OK;
}

bst_status bst_fits_source_select(bst_ctx *ctx, bst_fits_source *s, int64_t index,
                                  bst_fits_source_frame *out) {
    assert(s && out);
    if (index < 0 || index >= s->frames) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.400s: has no frame %" PRId64 "; it has %" PRId64,
                        s->path, index, s->frames);
    }
    size_t low = 0, high = s->count;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        *(s->hdus[middle].first <= index ? &low : &high) = middle;
    }
    if (s->selected != (int64_t)low) {
        BST_TRY(load_hdu(ctx, s, low));
    }
    const bst_fits_source_hdu *h = &s->hdus[low];
    s->plane = index - h->first;
    *out = (bst_fits_source_frame){.hdu = h->number,
                                   .plane = h->planes ? s->plane : -1,
                                   .width = (int)h->size[0],
                                   .height = (int)h->size[1],
                                   .compressed = h->compressed};
    return BST_OK;
}

/* Physical values of a row of pixels. */
static void convert_row(const bst_fits_source_hdu *h, const uint8_t *row, float *out) {
    int width = abs(h->bitpix) / 8;
    for (int64_t x = 0; x < h->size[0]; x++) {
        const uint8_t *at = row + x * width;
        if (h->bitpix < 0) {
            out[x] = (float)(h->zero + h->scale * bst_fits_source_real_at(at, width));
        } else {
            int64_t v = bst_fits_source_integer_at(at, width);
            /* 64 bits without sign are stored minus 2^63, where doubles are 1024 apart */
            double value = h->zero == 0x1p63 && h->scale == 1.0
                               ? (double)((uint64_t)v ^ (uint64_t)1 << 63)
                               : h->zero + h->scale * (double)v;
            out[x] = h->has_blank && v == h->blank ? NAN : (float)value;
        }
    }
}

bst_status bst_fits_source_pixels(bst_ctx *ctx, bst_fits_source *s, float *pixels) {
    assert(s && pixels && s->selected >= 0);
    const bst_fits_source_hdu *h = &s->hdus[s->selected];
    if (h->compressed) {
        return bst_fits_source_tiles(ctx, s, h, pixels);
    }
    uint64_t row_bytes = (uint64_t)h->size[0] * (uint64_t)(abs(h->bitpix) / 8);
    uint64_t at = h->data_at + (uint64_t)s->plane * (uint64_t)h->size[1] * row_bytes;
    uint8_t *row = malloc((size_t)row_bytes);
    if (!row) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: no memory for a row", s->path);
    }
    bst_status status = BST_OK;
    for (int64_t y = 0; y < h->size[1] && status == BST_OK; y++) {
        status = bst_fits_source_read_at(ctx, s, row, row_bytes, at + (uint64_t)y * row_bytes);
        if (status == BST_OK) {
            convert_row(h, row, pixels + y * h->size[0]);
        }
    }
    free(row);
    return status;
}
