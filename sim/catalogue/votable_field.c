#include "sim/catalogue/votable_field.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

bst_votable_type bst_votable_datatype(const char *text, int *size) {
    static const struct {
        const char *name;
        bst_votable_type type;
        int size;
    } known[] = {{"bit", BST_VOTABLE_BIT, 0},
                 {"unsignedByte", BST_VOTABLE_BYTE, 1},
                 {"short", BST_VOTABLE_SHORT, 2},
                 {"int", BST_VOTABLE_INT, 4},
                 {"long", BST_VOTABLE_LONG, 8},
                 {"float", BST_VOTABLE_FLOAT, 4},
                 {"double", BST_VOTABLE_DOUBLE, 8},
                 {"boolean", BST_VOTABLE_OTHER, 1},
                 {"char", BST_VOTABLE_OTHER, 1},
                 {"unicodeChar", BST_VOTABLE_OTHER, 2},
                 {"floatComplex", BST_VOTABLE_OTHER, 8},
                 {"doubleComplex", BST_VOTABLE_OTHER, 16}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        if (strcmp(text, known[i].name) == 0) {
            *size = known[i].size;
            return known[i].type;
        }
    }
    *size = -1;
    return BST_VOTABLE_OTHER;
}

bool bst_votable_read_size(const char *text, bst_votable_field *f) {
    f->fixed = 1;
    for (;;) {
        if (*text == '*') {
            f->variable = true;
            return text[1] == '\0';
        }
        uint64_t n = 0;
        const char *from = text;
        for (; isdigit((unsigned char)*text) && n < UINT64_C(1) << 40; text++) {
            n = 10 * n + (uint64_t)(*text - '0');
        }
        if (text == from || isdigit((unsigned char)*text)) {
            return false;
        }
        if (text[0] == '*') { /* a limit: the row has the number itself */
            f->variable = true;
            return text[1] == '\0';
        }
        if (n == 0 || f->fixed > (UINT64_C(1) << 40) / n) {
            return false;
        }
        f->fixed *= n;
        if (*text == '\0') {
            return true;
        }
        if (*text++ != 'x') {
            return false;
        }
    }
}

bool bst_votable_read_integer(const char *text, int64_t *value) {
    const char *digits = text + strspn(text, " \t\r\n");
    digits += *digits == '-' || *digits == '+';
    /* not base 0, in which a leading 0 makes a number octal */
    const int base = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X') ? 16 : 10;
    char *end;
    errno = 0;
    *value = strtoll(text, &end, base);
    return end != text && errno == 0 && end[strspn(end, " \t\r\n")] == '\0';
}

uint64_t bst_votable_bytes(const bst_votable_field *f, uint64_t elements) {
    return f->type == BST_VOTABLE_BIT ? (elements + 7) / 8 : elements * (uint64_t)f->size;
}

double bst_votable_number(const bst_votable_field *f, const unsigned char *bytes, int64_t *whole) {
    uint64_t bits = 0;
    for (int i = 0; i < f->size; i++) {
        bits = bits << 8 | bytes[i];
    }
    *whole = 0;
    if (f->type == BST_VOTABLE_FLOAT) {
        float value;
        uint32_t low = (uint32_t)bits;
        memcpy(&value, &low, sizeof value);
        return (double)value;
    }
    if (f->type == BST_VOTABLE_DOUBLE) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    const int unused = 64 - 8 * f->size;
    *whole = f->type == BST_VOTABLE_BYTE ? (int64_t)bits : (int64_t)(bits << unused) >> unused;
    return (double)*whole;
}
