/* Keywords of a frame: columns of a cube's table, header of the HDU, primary header. */
#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/io/fits_source_internal.h"

enum { MOST_ELEMENTS = 1 << 20 };

/* Bytes of an element of a column by the letter of its TFORM; 0: of no use here. */
static int width_of(char letter) {
    switch (letter) {
        case 'L':
        case 'B':
        case 'A':
            return 1;
        case 'I':
            return 2;
        case 'J':
        case 'E':
            return 4;
        case 'K':
        case 'D':
        case 'C':
        case 'P':
            return 8;
        case 'M':
        case 'Q':
            return 16;
        default:
            return 0;
    }
}

bool bst_fits_source_find_column(const bst_fits_source_header *h, const char *name, size_t length,
                                 bst_fits_source_column *out) {
    int64_t offset = 0, fields = bst_fits_source_int(h, "TFIELDS", 0);
    for (int64_t i = 1; i <= fields && i <= 999; i++) {
        char key[16], form[BST_FITS_CARD], type[BST_FITS_CARD], *letter;
        snprintf(key, sizeof key, "TFORM%" PRId64, i);
        if (!bst_fits_card_text(h->text, h->bytes, key, form)) {
            return false;
        }
        long repeat = isdigit((unsigned char)form[0]) ? strtol(form, &letter, 10) : 1;
        letter = isdigit((unsigned char)form[0]) ? letter : form;
        int width = *letter == 'X' ? 1 : width_of(*letter);
        if (width == 0 || repeat < 0 || repeat > MOST_ELEMENTS) {
            return false;
        }
        int64_t bytes = *letter == 'X' ? (repeat + 7) / 8 : repeat * width;
        snprintf(key, sizeof key, "TTYPE%" PRId64, i);
        if (bst_fits_card_text(h->text, h->bytes, key, type) && strlen(type) == length &&
            strncasecmp(type, name, length) == 0 && *letter != 'X') {
            *out = (bst_fits_source_column){offset, repeat, *letter, width};
            return offset + bytes <= h->cards.axes[0];
        }
        offset += bytes;
    }
    return false;
}

/* Reads an element of a column as text. */
static bool element(const bst_fits_source *s, const bst_fits_source_column *c, int64_t index,
                    char *value) {
    uint8_t bytes[BST_FITS_SOURCE_TEXT] = {0};
    bst_ctx unheard = {0};
    bool text = c->letter == 'A';
    int64_t length = text ? c->repeat : c->width;
    length = length < BST_FITS_SOURCE_TEXT ? length : BST_FITS_SOURCE_TEXT - 1;
    uint64_t at = s->table_at + (uint64_t)s->plane * (uint64_t)s->table.cards.axes[0] +
                  (uint64_t)c->offset + (uint64_t)(text ? 0 : index * c->width);
    if ((text ? index > 0 : index >= c->repeat) ||
        bst_fits_source_read_at(&unheard, s, bytes, (uint64_t)length, at) != BST_OK) {
        return false;
    }
    if (text) {
        snprintf(value, BST_FITS_SOURCE_TEXT, "%.*s", (int)length, (const char *)bytes);
        for (size_t end = strlen(value); end > 0 && value[end - 1] == ' '; end--) {
            value[end - 1] = '\0';
        }
        return true;
    }
    if (c->letter == 'E' || c->letter == 'D') {
        snprintf(value, BST_FITS_SOURCE_TEXT, "%.17g", bst_fits_source_real_at(bytes, c->width));
        return true;
    }
    bool whole = strchr("BIJK", c->letter) != NULL;
    if (whole) {
        snprintf(value, BST_FITS_SOURCE_TEXT, "%" PRId64,
                 bst_fits_source_integer_at(bytes, c->width));
    }
    return whole;
}

/* Value from the table of a cube. */
static bool table_text(const bst_fits_source *s, const char *keyword, char *value) {
    size_t length = strcspn(keyword, "[");
    char *end;
    long index = keyword[length] == '[' ? strtol(keyword + length + 1, &end, 10) : 1;
    bst_fits_source_column c;
    return s->table.bytes > 0 && index >= 1 &&
           bst_fits_source_find_column(&s->table, keyword, length, &c) &&
           element(s, &c, index - 1, value);
}

bool bst_fits_source_text(bst_fits_source *s, const char *keyword,
                          char value[BST_FITS_SOURCE_TEXT]) {
    if (table_text(s, keyword, value)) {
        return true;
    }
    char card[BST_FITS_CARD];
    bool found = *keyword && (bst_fits_card_text(s->header.text, s->header.bytes, keyword, card) ||
                              bst_fits_card_text(s->primary.text, s->primary.bytes, keyword, card));
    if (found) {
        snprintf(value, BST_FITS_SOURCE_TEXT, "%s", card);
    }
    return found;
}
