/* The structure of a FITS file before cfitsio sees it: cfitsio believes what headers say of sizes.
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/fits_check.h"

enum { BLOCK = 2880, CARD = 80, MAX_AXES = 9, MAX_FIELDS = 999, MAX_HDUS = 10000 };

/* Values of the keys that sizes hang on; UNSET where the header has none. */
typedef struct header {
    int64_t bitpix, naxis, axes[MAX_AXES], pcount, gcount, tfields;
    bool is_compressed;
} header;

static const int64_t UNSET = INT64_MIN;

typedef struct checker {
    bst_ctx *ctx;
    const char *name;
    const char *data;
    uint64_t bytes, at;
    int hdu; /* from 1 */
    header h;
} checker;

/* The value field of a card, without quotes, comment and blanks around it. */
static void card_value(const char *card, char *out, size_t room) {
    const char *value = card + 10, *end = card + CARD;
    while (value < end && *value == ' ') {
        value++;
    }
    const char *stop;
    if (value < end && *value == '\'') {
        value++;
        stop = memchr(value, '\'', (size_t)(end - value));
    } else {
        stop = memchr(value, '/', (size_t)(end - value));
    }
    stop = stop ? stop : end;
    while (stop > value && stop[-1] == ' ') {
        stop--;
    }
    snprintf(out, room, "%.*s", (int)(stop - value), value);
}

static bst_status wrong(const checker *c, const char *card, const char *allowed) {
    char value[CARD];
    card_value(card, value, sizeof value);
    return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: %.*s is wrong (found %s; allowed: %s)",
                    c->name, c->hdu, (int)strcspn(card, " ="), card, *value ? value : "nothing",
                    allowed);
}

/* Whether a card's key is `stem` followed by a number from 1 to `count`; *index is that less 1. */
static bool is_indexed(const char *card, const char *stem, int count, int *index) {
    size_t length = strlen(stem);
    char digit = card[length];
    if (strncmp(card, stem, length) != 0 || digit < '1' || digit > '0' + count) {
        return false;
    }
    *index = digit - '1';
    return strspn(card + length + 1, " ") == 8 - length - 1;
}

static bool is_key(const char *card, const char *key) {
    size_t length = strlen(key);
    return strncmp(card, key, length) == 0 && strspn(card + length, " ") >= 8 - length;
}

static bst_status set_int(const checker *c, const char *card, int64_t low, int64_t high,
                          const char *allowed, int64_t *out) {
    char value[CARD], *end;
    card_value(card, value, sizeof value);
    bool is_plain = strspn(value, "+-0123456789") == strlen(value) && strlen(value) < 19;
    int64_t number = is_plain ? strtoll(value, &end, 10) : 0;
    if (!is_plain || end == value || *end || number < low || number > high) {
        return wrong(c, card, allowed);
    }
    if (*out != UNSET) {
        return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: %.*s is given twice", c->name,
                        c->hdu, (int)strcspn(card, " ="), card);
    }
    *out = number;
    return BST_OK;
}

static bst_status set_bitpix(const checker *c, const char *card, int64_t *out) {
    const char *allowed = "8, 16, 32, 64, -32, -64";
    BST_TRY(set_int(c, card, -64, 64, allowed, out));
    bool known = *out == 8 || *out == 16 || *out == 32 || *out == 64 || *out == -32 || *out == -64;
    return known ? BST_OK : wrong(c, card, allowed);
}

/* Takes what matters of one card. */
static bst_status read_card(checker *c, const char *card) {
    const char *size = "an integer from 0 to 1000000000000";
    const int64_t most = 1000000000000;
    header *h = &c->h;
    int i;
    if (is_key(card, "BITPIX")) {
        return set_bitpix(c, card, &h->bitpix);
    }
    if (is_key(card, "NAXIS")) {
        return set_int(c, card, 0, MAX_AXES, "an integer from 0 to 9", &h->naxis);
    }
    if (is_indexed(card, "NAXIS", MAX_AXES, &i)) {
        return set_int(c, card, 0, most, size, &h->axes[i]);
    }
    if (is_key(card, "PCOUNT")) {
        return set_int(c, card, 0, most, size, &h->pcount);
    }
    if (is_key(card, "GCOUNT")) {
        return set_int(c, card, 1, 1, "1", &h->gcount);
    }
    if (is_key(card, "TFIELDS")) {
        return set_int(c, card, 0, MAX_FIELDS, "an integer from 0 to 999", &h->tfields);
    }
    if (is_key(card, "ZIMAGE")) {
        char value[CARD];
        card_value(card, value, sizeof value);
        h->is_compressed = strcmp(value, "T") == 0;
    }
    return BST_OK;
}

/* Reads cards up to END and moves behind the header's last block. */
static bst_status read_header(checker *c) {
    c->h = (header){
        .bitpix = UNSET, .naxis = UNSET, .pcount = UNSET, .gcount = UNSET, .tfields = UNSET};
    for (int i = 0; i < MAX_AXES; i++) {
        c->h.axes[i] = UNSET;
    }
    const uint64_t start = c->at;
    for (; c->bytes - c->at >= CARD; c->at += CARD) {
        char card[CARD + 1] = "";
        memcpy(card, c->data + c->at, CARD);
        if (c->at == start) {
            if (!is_key(card, c->hdu == 1 ? "SIMPLE" : "XTENSION")) {
                return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: does not begin with %s",
                                c->name, c->hdu, c->hdu == 1 ? "SIMPLE" : "XTENSION");
            }
        }
        if (is_key(card, "END")) {
            c->at = (c->at + CARD - start + BLOCK - 1) / BLOCK * BLOCK + start;
            return BST_OK;
        }
        BST_TRY(read_card(c, card));
    }
    return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: the header has no END", c->name,
                    c->hdu);
}

/* Bytes of the data, or more than the file can have; *ok is false when a key is missing. */
static uint64_t data_bytes(const header *h, bool *ok) {
    uint64_t count = h->naxis > 0;
    *ok = h->bitpix != UNSET && h->naxis != UNSET;
    for (int64_t i = 0; *ok && i < h->naxis; i++) {
        *ok = h->axes[i] != UNSET;
        bool overflows = *ok && h->axes[i] > 0 && count > (UINT64_MAX >> 8) / (uint64_t)h->axes[i];
        count = overflows ? UINT64_MAX >> 8 : count * (uint64_t)(*ok ? h->axes[i] : 0);
    }
    count += h->pcount == UNSET ? 0 : (uint64_t)h->pcount;
    return *ok ? count * (uint64_t)(llabs(h->bitpix) / 8) : 0;
}

bst_status bst_fits_check_structure(bst_ctx *ctx, const char *name, const void *data,
                                    uint64_t bytes) {
    checker c = {.ctx = ctx, .name = name, .data = data, .bytes = bytes};
    while (c.at < bytes) {
        if (++c.hdu > MAX_HDUS) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: more than %d HDUs", name, MAX_HDUS);
        }
        BST_TRY(read_header(&c));
        bool ok;
        uint64_t needed = data_bytes(&c.h, &ok);
        if (!ok) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: BITPIX, NAXIS or one of NAXISn is missing", name,
                            c.hdu);
        }
        if (c.at > bytes || needed > bytes - c.at) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: is cut short: %" PRIu64 " bytes of data, %" PRIu64
                            " in the file",
                            name, c.hdu, needed, c.at > bytes ? 0 : bytes - c.at);
        }
        if (c.h.is_compressed) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s: HDU %d: is a compressed image (allowed: images that are not "
                            "compressed); unpack the file with funpack",
                            name, c.hdu);
        }
        c.at += (needed + BLOCK - 1) / BLOCK * BLOCK;
    }
    return BST_OK;
}
