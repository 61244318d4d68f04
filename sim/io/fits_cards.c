/* Reads FITS header cards that determine sizes, and other cards by key. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/fits_cards_internal.h"

enum { CARD = BST_FITS_CARD, MAX_FIELDS = 999 };

/* State of parsing a header. */
typedef struct scan {
    bst_ctx *ctx;
    const char *name;
    int hdu;
    bst_fits_cards *cards;
} scan;

static const int64_t UNSET = BST_FITS_UNSET;

/* Extracts the value of a card without quotes, comment and surrounding blanks. */
static void value_from(const char *card, size_t column, char out[CARD]) {
    const char *value = card + column, *end = card + CARD;
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
    snprintf(out, CARD, "%.*s", (int)(stop - value), value);
}

static void card_value(const char *card, char out[CARD]) {
    value_from(card, 10, out);
}

/* Fails with the value of a FITS card and the allowed values. */
static bst_status wrong(const scan *c, const char *card, const char *allowed) {
    char value[CARD];
    card_value(card, value);
    return bst_fail(c->ctx, BST_ERR_FORMAT, "%.400s: HDU %d: %.*s is wrong (found %s; allowed: %s)",
                    c->name, c->hdu, (int)strcspn(card, " ="), card, *value ? value : "nothing",
                    allowed);
}

/* Checks whether a card's key is `stem` with a number from 1 to `count`; *index: the number minus
 * 1. */
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

static bst_status set_int(const scan *c, const char *card, int64_t low, int64_t high,
                          const char *allowed, int64_t *out) {
    char value[CARD], *end;
    card_value(card, value);
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

static bst_status set_bitpix(const scan *c, const char *card, int64_t *out) {
    const char *allowed = "8, 16, 32, 64, -32, -64";
    BST_TRY(set_int(c, card, -64, 64, allowed, out));
    bool known = *out == 8 || *out == 16 || *out == 32 || *out == 64 || *out == -32 || *out == -64;
    return known ? BST_OK : wrong(c, card, allowed);
}

/* Stores the value of one card if it determines sizes. */
static bst_status read_card(scan *c, const char *card) {
    const char *size = "an integer from 0 to 1000000000000";
    const int64_t most = 1000000000000;
    bst_fits_cards *h = c->cards;
    int i;
    if (is_key(card, "BITPIX")) {
        return set_bitpix(c, card, &h->bitpix);
    }
    if (is_key(card, "NAXIS")) {
        return set_int(c, card, 0, BST_FITS_AXES, "an integer from 0 to 9", &h->naxis);
    }
    if (is_indexed(card, "NAXIS", BST_FITS_AXES, &i)) {
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
    if (is_key(card, "XTENSION")) {
        char value[CARD];
        card_value(card, value);
        h->is_table = strcmp(value, "IMAGE") != 0;
    }
    /* cfitsio accepts more spellings of the key, and uses the first letter of the value */
    if (strstr(card, "ZIMAGE")) {
        char value[CARD];
        card_value(card, value);
        bool is_so = is_key(card, "ZIMAGE") ? value[0] != 'F' : h->is_table;
        h->is_compressed = h->is_compressed || is_so;
    }
    return BST_OK;
}

/* Computes the size of the data from the keys; on overflow a value larger than any file. */
static bst_status set_data_bytes(const scan *c) {
    bst_fits_cards *h = c->cards;
    uint64_t count = h->naxis > 0;
    bool ok = h->bitpix != UNSET && h->naxis != UNSET;
    for (int64_t i = 0; ok && i < h->naxis; i++) {
        ok = h->axes[i] != UNSET;
        bool overflows = ok && h->axes[i] > 0 && count > (UINT64_MAX >> 8) / (uint64_t)h->axes[i];
        count = overflows ? UINT64_MAX >> 8 : count * (uint64_t)(ok ? h->axes[i] : 0);
    }
    if (!ok) {
        return bst_fail(c->ctx, BST_ERR_FORMAT,
                        "%.400s: HDU %d: BITPIX, NAXIS or one of NAXISn is missing", c->name,
                        c->hdu);
    }
    /* if these keys are missing, cfitsio 4.2 uses uninitialised memory */
    if (h->is_table && (h->pcount == UNSET || h->gcount == UNSET || h->tfields == UNSET)) {
        return bst_fail(c->ctx, BST_ERR_FORMAT,
                        "%.400s: HDU %d: PCOUNT, GCOUNT or TFIELDS is missing", c->name, c->hdu);
    }
    count += h->pcount == UNSET ? 0 : (uint64_t)h->pcount;
    h->data_bytes = count * (uint64_t)(llabs(h->bitpix) / 8);
    return BST_OK;
}

bst_status bst_fits_read_cards(bst_ctx *ctx, const char *name, int hdu, const void *data,
                               uint64_t bytes, bst_fits_cards *out) {
    scan c = {.ctx = ctx, .name = name, .hdu = hdu, .cards = out};
    *out = (bst_fits_cards){
        .bitpix = UNSET, .naxis = UNSET, .pcount = UNSET, .gcount = UNSET, .tfields = UNSET};
    for (int i = 0; i < BST_FITS_AXES; i++) {
        out->axes[i] = UNSET;
    }
    for (uint64_t at = 0; bytes - at >= CARD; at += CARD) {
        char card[CARD + 1] = "";
        memcpy(card, (const char *)data + at, CARD);
        if (at == 0 && !is_key(card, hdu == 1 ? "SIMPLE" : "XTENSION")) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: HDU %d: does not begin with %s", name,
                            hdu, hdu == 1 ? "SIMPLE" : "XTENSION");
        }
        if (is_key(card, "END")) {
            out->bytes = (at + CARD + BST_FITS_BLOCK - 1) / BST_FITS_BLOCK * BST_FITS_BLOCK;
            return set_data_bytes(&c);
        }
        BST_TRY(read_card(&c, card));
    }
    return bst_fail(ctx, BST_ERR_FORMAT, "%.400s: HDU %d: the header has no END", name, hdu);
}

/* Column of the value of a card HIERARCH with these words before the =; 0: it is another card. */
static size_t hierarch_value(const char *card, const char *words) {
    const char *at = card + strlen("HIERARCH");
    for (const char *w = words;; w += strspn(w, " ")) {
        size_t length = strcspn(w, " "), blanks = strspn(at, " ");
        at += blanks;
        if (length == 0) {
            return *at == '=' ? (size_t)(at + 1 - card) : 0;
        }
        if (blanks == 0 || strncmp(at, w, length) != 0) {
            return 0;
        }
        at += length;
        w += length;
    }
}

/* Column of the value of a card with this key; 0: it is another card. */
static size_t column_of_value(const char *card, const char *key) {
    if (strlen(key) <= 8 && !strchr(key, ' ')) {
        return is_key(card, key) ? 10 : 0;
    }
    key += strncmp(key, "HIERARCH ", 9) == 0 ? 9 : 0;
    key += strspn(key, " ");
    return *key && is_key(card, "HIERARCH") ? hierarch_value(card, key) : 0;
}

bool bst_fits_card_text(const void *header, uint64_t bytes, const char *key, char value[CARD]) {
    const char *cards = header;
    for (uint64_t at = 0; bytes - at >= CARD; at += CARD) {
        char card[CARD + 1] = "";
        memcpy(card, cards + at, CARD);
        size_t column = column_of_value(card, key);
        if (column > 0) {
            value_from(card, column, value);
            return true;
        }
        if (is_key(card, "END")) {
            break;
        }
    }
    return false;
}

bool bst_fits_card_int(const void *header, uint64_t bytes, const char *key, int64_t *value) {
    char text[CARD], *end;
    if (!bst_fits_card_text(header, bytes, key, text) || !*text || strlen(text) > 18 ||
        strspn(text, "+-0123456789") != strlen(text)) {
        return false;
    }
    *value = strtoll(text, &end, 10);
    return *end == '\0';
}
