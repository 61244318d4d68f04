/* Checks the JSON grammar, RFC 8259, with a message for each kind of error. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_internal.h"

enum { LONGEST_NUMBER = 63 }; /* of cJSON */

typedef struct scanner {
    const char *text;
    size_t bytes, at;
    char open[BST_JSON_MAX_DEPTH]; /* '{' or '[' of each open level */
    int depth;
    long values;
    bst_json_fault *fault;
} scanner;

/* Offset of the first byte that is zero or not UTF-8 (RFC 3629); `bytes` if there is none. */
static size_t utf8_error(const char *text, size_t bytes) {
    const unsigned char *p = (const unsigned char *)text;
    size_t i = 0;
    while (i < bytes) {
        unsigned c = p[i];
        size_t length = c > 0 && c < 0x80       ? 1
                        : c >= 0xC2 && c < 0xE0 ? 2
                        : c >= 0xE0 && c < 0xF0 ? 3
                        : c >= 0xF0 && c < 0xF5 ? 4
                                                : 0;
        if (length == 0 || i + length > bytes) {
            return i;
        }
        for (size_t k = 1; k < length; k++) {
            if ((p[i + k] & 0xC0) != 0x80) {
                return i;
            }
        }
        /* overlong forms and surrogates */
        if ((c == 0xE0 && p[i + 1] < 0xA0) || (c == 0xED && p[i + 1] > 0x9F) ||
            (c == 0xF0 && p[i + 1] < 0x90) || (c == 0xF4 && p[i + 1] > 0x8F)) {
            return i;
        }
        i += length;
    }
    return bytes;
}

/* Length of the JSON number at text (RFC 8259, section 6); 0: none. */
static size_t number_length(const char *text, size_t bytes) {
    size_t i = bytes && text[0] == '-' ? 1 : 0;
    size_t start = i;
    while (i < bytes && isdigit((unsigned char)text[i])) {
        i++;
    }
    if (i == start || (text[start] == '0' && i > start + 1)) {
        return 0;
    }
    if (i < bytes && text[i] == '.') {
        start = ++i;
        while (i < bytes && isdigit((unsigned char)text[i])) {
            i++;
        }
        if (i == start) {
            return 0;
        }
    }
    if (i < bytes && (text[i] == 'e' || text[i] == 'E')) {
        i++;
        i += i < bytes && (text[i] == '+' || text[i] == '-');
        start = i;
        while (i < bytes && isdigit((unsigned char)text[i])) {
            i++;
        }
        if (i == start) {
            return 0;
        }
    }
    return i;
}

/* Length of the token at an offset for messages: a word, or one character. */
static size_t token_length(const char *text, size_t bytes) {
    size_t n = 0;
    while (n < bytes && n < 24 &&
           (isalnum((unsigned char)text[n]) || (text[n] && strchr("+-._", text[n])))) {
        n++;
    }
    if (n == 0) {
        for (n = 1; n < bytes && ((unsigned char)text[n] & 0xC0) == 0x80; n++) {
        }
    }
    return n;
}

static bool fail(scanner *s, size_t offset, const char *what) {
    s->fault->offset = offset;
    snprintf(s->fault->what, sizeof s->fault->what, "%s", what);
    return false;
}

/* Reports "WHAT (found TOKEN; allowed: ALLOWED)" with the token at the offset. */
static bool fail_found(scanner *s, size_t offset, const char *what, const char *allowed) {
    const char *at = s->text + offset;
    char found[40] = "the end of the text";
    if (offset < s->bytes && (unsigned char)*at < 0x20) {
        snprintf(found, sizeof found, "the control character 0x%02X", (unsigned char)*at);
    } else if (offset < s->bytes && *at == '"') {
        snprintf(found, sizeof found, "a string");
    } else if (offset < s->bytes) {
        snprintf(found, sizeof found, "\"%.*s\"", (int)token_length(at, s->bytes - offset), at);
    }
    s->fault->offset = offset;
    snprintf(s->fault->what, sizeof s->fault->what, "%s (found %s; allowed: %s)", what, found,
             allowed);
    return false;
}

/* Value of four hexadecimal digits at an offset; -1: invalid. */
static long hex4(const scanner *s, size_t at) {
    long value = 0;
    for (size_t i = at; i < at + 4; i++) {
        if (i >= s->bytes || !isxdigit((unsigned char)s->text[i])) {
            return -1;
        }
        int c = tolower((unsigned char)s->text[i]);
        value = value * 16 + (isdigit(c) ? c - '0' : c - 'a' + 10);
    }
    return value;
}

/* Scans an escape, from its backslash to its last byte. */
static bool scan_escape(scanner *s) {
    size_t start = s->at;
    char c = start + 1 < s->bytes ? s->text[start + 1] : '\0';
    if (c == 'u') {
        long code = hex4(s, start + 2);
        if (code == 0) {
            return fail(s, start, "\\u0000 within a string is not allowed");
        }
        bool high = code >= 0xD800 && code < 0xDC00;
        bool has_low = high && start + 7 < s->bytes && memcmp(s->text + start + 6, "\\u", 2) == 0;
        long low = has_low ? hex4(s, start + 8) : -1;
        if (code < 0 || (code >= 0xDC00 && code < 0xE000) ||
            (high && (low < 0xDC00 || low > 0xDFFF))) {
            return fail(s, start,
                        "\\u is not followed by the four hexadecimal digits of a character (a "
                        "character beyond U+FFFF takes two such, a high and a low surrogate)");
        }
        s->at = start + (high ? 11 : 5);
        return true;
    }
    if (c == '\0' || !strchr("\"\\/bfnrt", c)) {
        return fail(s, start,
                    "unknown escape in a string (allowed: \\\" \\\\ \\/ \\b \\f \\n \\r \\t "
                    "\\u and four hexadecimal digits; a backslash itself is \\\\)");
    }
    s->at = start + 1;
    return true;
}

/* Scans a string, from its first quote to after its last. */
static bool scan_string(scanner *s) {
    size_t start = s->at++;
    for (; s->at < s->bytes; s->at++) {
        char c = s->text[s->at];
        if (c == '"') {
            s->at++;
            return true;
        }
        if (c == '\n') {
            break;
        }
        if ((unsigned char)c < 0x20) {
            return fail(s, s->at,
                        "a control character within a string (write \\n, \\t or \\u00XX)");
        }
        if (c == '\\' && !scan_escape(s)) {
            return false;
        }
    }
    return fail(s, start, "the string that begins here has no closing \" in its line");
}

/* Scans a number of that length; cJSON and a double must be able to hold it. */
static bool scan_number(scanner *s, size_t length) {
    char number[LONGEST_NUMBER + 1];
    if (length > LONGEST_NUMBER) {
        return fail(s, s->at, "a number of more than 63 characters");
    }
    memcpy(number, s->text + s->at, length);
    number[length] = '\0';
    if (!isfinite(strtod(number, NULL))) {
        return fail_found(s, s->at, "the number is too large", "|number| < 1.8e308");
    }
    s->at += length;
    return true;
}

/* Scans a string, number or word, or an opening bracket. */
static bool scan_value(scanner *s, const char *allowed) {
    char c = s->at < s->bytes ? s->text[s->at] : '\0';
    if (++s->values > BST_JSON_MAX_VALUES) {
        return fail(s, s->at, "too many values (allowed: at most 8000000)");
    }
    if (c == '{' || c == '[') {
        if (s->depth == BST_JSON_MAX_DEPTH) {
            return fail(s, s->at, "nested too deep (allowed: 64 levels)");
        }
        s->open[s->depth++] = c;
        s->at++;
        return true;
    }
    if (c == '"') {
        return scan_string(s);
    }
    if (c == '-' || isdigit((unsigned char)c)) {
        size_t length = number_length(s->text + s->at, s->bytes - s->at);
        if (length == 0) {
            return fail_found(s, s->at, "this is not a JSON number",
                              "such as 12, -0.5, 6.7e-11, without leading zeros");
        }
        return scan_number(s, length);
    }
    static const char *const words[] = {"true", "false", "null"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i]);
        if (s->bytes - s->at >= length && memcmp(s->text + s->at, words[i], length) == 0) {
            s->at += length;
            return true;
        }
    }
    return fail_found(s, s->at, "this is not valid JSON", allowed);
}

static void skip_blanks(scanner *s) {
    while (s->at < s->bytes && strchr(" \t\n\r", s->text[s->at])) {
        s->at++;
    }
}

#define A_VALUE "a value: {...}, [...], \"...\", a finite number, true, false, null"

/* Scans the document up to the end of the outermost value. */
static bool scan_document(scanner *s) {
    enum { VALUE, FIRST_VALUE, KEY, FIRST_KEY, AFTER_VALUE } state = VALUE;
    do {
        skip_blanks(s);
        char c = s->at < s->bytes ? s->text[s->at] : '\0';
        char opened = s->depth ? s->open[s->depth - 1] : '\0';
        bool may_close = state == FIRST_VALUE || state == FIRST_KEY || state == AFTER_VALUE;
        if (may_close && opened && c == (opened == '{' ? '}' : ']')) {
            s->depth--;
            s->at++;
            state = AFTER_VALUE;
        } else if (state == AFTER_VALUE) {
            if (c != ',') {
                return fail_found(s, s->at, "this is not valid JSON",
                                  opened == '{' ? "a comma or }" : "a comma or ]");
            }
            s->at++;
            state = opened == '{' ? KEY : VALUE;
        } else if (state == KEY || state == FIRST_KEY) {
            if (c != '"') {
                return fail_found(
                    s, s->at, "this is not valid JSON",
                    state == KEY ? "a key in double quotes" : "a key in double quotes or }");
            }
            if (!scan_string(s)) {
                return false;
            }
            skip_blanks(s);
            if (s->at >= s->bytes || s->text[s->at] != ':') {
                return fail_found(s, s->at, "this is not valid JSON",
                                  "a colon between key and value");
            }
            s->at++;
            state = VALUE;
        } else {
            if (!scan_value(s, state == VALUE ? A_VALUE : A_VALUE ", or ]")) {
                return false;
            }
            state = c == '{' ? FIRST_KEY : c == '[' ? FIRST_VALUE : AFTER_VALUE;
        }
    } while (s->depth > 0);
    return true;
}

bool bst_json_check(const char *text, size_t bytes, bst_json_fault *fault) {
    scanner s = {.text = text, .bytes = bytes, .fault = fault};
    size_t bad = utf8_error(text, bytes);
    if (bad < bytes) {
        fault->offset = bad;
        snprintf(fault->what, sizeof fault->what, "byte 0x%02X is not UTF-8 text (allowed: UTF-8)",
                 (unsigned char)text[bad]);
        return false;
    }
    skip_blanks(&s);
    if (s.at == bytes) {
        return fail(&s, 0, "the file is empty (a JSON object is expected)");
    }
    if (!scan_document(&s)) {
        return false;
    }
    skip_blanks(&s);
    if (s.at < bytes) {
        return fail_found(&s, s.at, "text after the end of the JSON value", "nothing more");
    }
    return true;
}
