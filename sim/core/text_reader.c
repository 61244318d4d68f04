#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/text_reader.h"

bst_status bst_text_fail_memory(const bst_text_source *source, const char *what) {
    return bst_fail(source->ctx, BST_ERR_MEMORY, "%.400s: no memory for its %s", source->name,
                    what);
}

void bst_text_quote(const char *text, size_t length, char out[BST_TEXT_QUOTE_BYTES]) {
    size_t used = 0;
    out[used++] = '"';
    for (size_t i = 0; i < length; i++) {
        if (used + 10 > BST_TEXT_QUOTE_BYTES) {
            used += (size_t)snprintf(out + used, BST_TEXT_QUOTE_BYTES - used, "...");
            break;
        }
        unsigned char c = (unsigned char)text[i];
        if (c >= 0x20 && c < 0x7f) {
            out[used++] = (char)c;
        } else {
            used += (size_t)snprintf(out + used, BST_TEXT_QUOTE_BYTES - used, "\\x%02X", c);
        }
    }
    out[used++] = '"';
    out[used] = '\0';
}

bst_status bst_text_fail_at(const bst_text_source *source, const bst_text_line *line,
                            const char *problem, const char *found, size_t found_length,
                            const char *expected) {
    char quoted[BST_TEXT_QUOTE_BYTES];
    bst_text_quote(found, found_length, quoted);
    if (source->name) {
        return bst_fail(source->ctx, BST_ERR_FORMAT, "%.400s:%d: %s (found %s, expected %s)",
                        source->name, line->number, problem, quoted, expected);
    }
    return bst_fail(source->ctx, BST_ERR_FORMAT, "line %d: %s (found %s, expected %s)",
                    line->number, problem, quoted, expected);
}

void bst_text_trim_end(bst_text_line *line) {
    while (line->length > 0) {
        char c = line->text[line->length - 1];
        if (c != ' ' && c != '\t' && c != '\r' && c != '\n') {
            break;
        }
        line->length--;
    }
}

bst_text_cursor bst_text_start(const char *data, size_t bytes) {
    bool mark = bytes >= 3 && memcmp(data, "\xEF\xBB\xBF", 3) == 0;
    return (bst_text_cursor){data + (mark ? 3 : 0), data + bytes, 0};
}

bool bst_text_next_line(bst_text_cursor *cursor, bst_text_line *line) {
    if (cursor->next >= cursor->end) {
        return false;
    }
    const char *stop = memchr(cursor->next, '\n', (size_t)(cursor->end - cursor->next));
    stop = stop ? stop : cursor->end;
    *line = (bst_text_line){cursor->next, (size_t)(stop - cursor->next), ++cursor->line_number};
    cursor->next = stop < cursor->end ? stop + 1 : cursor->end;
    bst_text_trim_end(line);
    return true;
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

bool bst_text_next_word(bst_text_span *rest, bst_text_span *word) {
    size_t start = 0, stop;
    while (start < rest->length && is_blank(rest->text[start])) {
        start++;
    }
    for (stop = start; stop < rest->length && !is_blank(rest->text[stop]);) {
        stop++;
    }
    *word = (bst_text_span){rest->text + start, stop - start};
    *rest = (bst_text_span){rest->text + stop, rest->length - stop};
    return word->length > 0;
}

bool bst_text_is(bst_text_span span, const char *word) {
    return strlen(word) == span.length && memcmp(span.text, word, span.length) == 0;
}

bst_text_span bst_text_trimmed(bst_text_span s) {
    while (s.length > 0 && is_blank(s.text[0])) {
        s.text++;
        s.length--;
    }
    while (s.length > 0 && is_blank(s.text[s.length - 1])) {
        s.length--;
    }
    return s;
}

void bst_text_copy(bst_text_span span, char *out, size_t out_bytes) {
    span = bst_text_trimmed(span);
    size_t length = span.length < out_bytes ? span.length : out_bytes - 1;
    if (length > 0) {
        memcpy(out, span.text, length);
    }
    out[length] = '\0';
}

bool bst_text_is_plain(bst_text_span span) {
    for (size_t i = 0; i < span.length; i++) {
        unsigned char c = (unsigned char)span.text[i];
        if (c < 0x20 || c >= 0x7f) {
            return false;
        }
    }
    return true;
}

/* Number of digits at the start. */
static size_t digits_at(const char *text, size_t length) {
    size_t i = 0;
    while (i < length && bst_text_is_digit(text[i])) {
        i++;
    }
    return i;
}

const char *bst_text_split_keyword(const bst_text_line *line, bst_text_span *keyword,
                                   bst_text_span *value, const char **expected) {
    *expected = "KEYWORD = value";
    const char *equals = line->length ? memchr(line->text, '=', line->length) : NULL;
    if (!equals) {
        return "is not a line that this message has here";
    }
    size_t left = (size_t)(equals - line->text);
    *keyword = bst_text_trimmed((bst_text_span){line->text, left});
    *value = bst_text_trimmed((bst_text_span){equals + 1, line->length - left - 1});
    bool is_keyword = keyword->length > 0;
    for (size_t i = 0; i < keyword->length; i++) {
        char c = keyword->text[i];
        is_keyword = is_keyword && ((c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_');
    }
    if (!is_keyword) {
        *expected = "capitals, digits and underscores";
        return "the keyword is not one";
    }
    if (value->length == 0) {
        return "the keyword has no value";
    }
    if (!bst_text_is_plain(*value)) {
        *expected = "plain text";
        return "a character that is not printable ASCII";
    }
    return NULL;
}

bool bst_text_number(bst_text_span span, double *out) {
    enum { LONGEST = 120 };
    const char *c = span.text;
    size_t n = span.length, i = 0, point;
    if (n == 0 || n > LONGEST) {
        return false;
    }
    i += c[0] == '-' || c[0] == '+';
    size_t whole = digits_at(c + i, n - i), decimals = 0;
    i += whole;
    point = i;
    bool has_point = i < n && c[i] == '.';
    if (has_point) {
        decimals = digits_at(c + i + 1, n - i - 1);
        i += 1 + decimals;
    }
    if (whole + decimals == 0) {
        return false;
    }
    bool has_exponent = i < n && (c[i] == 'e' || c[i] == 'E');
    if (has_exponent) {
        i++;
        i += i < n && (c[i] == '-' || c[i] == '+');
        size_t exponent = digits_at(c + i, n - i);
        i += exponent;
        if (exponent == 0) {
            return false;
        }
    }
    if (i != n) {
        return false;
    }
    /* up to 15 digits and powers of ten up to 1e15 are exact: one division rounds once */
    static const double tens[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                  1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
    if (whole + decimals <= 15 && !has_exponent) {
        long long digits = 0;
        for (size_t k = 0; k < n; k++) {
            digits = bst_text_is_digit(c[k]) ? 10 * digits + (c[k] - '0') : digits;
        }
        double value = (double)digits / tens[decimals];
        *out = c[0] == '-' ? -value : value;
        return true;
    }
    /* strtod uses the decimal point of the locale */
    char text[LONGEST + 32];
    if (has_point) {
        snprintf(text, sizeof text, "%.*s%.16s%.*s", (int)point, c, localeconv()->decimal_point,
                 (int)(n - point - 1), c + point + 1);
    } else {
        snprintf(text, sizeof text, "%.*s", (int)n, c);
    }
    *out = strtod(text, NULL);
    return isfinite(*out);
}

bool bst_text_count(bst_text_span span, int maximum, int *out) {
    long long value = 0;
    for (size_t i = 0; i < span.length; i++) {
        if (!bst_text_is_digit(span.text[i])) {
            return false;
        }
        value = 10 * value + (span.text[i] - '0');
        if (value > maximum) {
            return false;
        }
    }
    *out = (int)value;
    return span.length > 0;
}

int bst_text_split_csv(const bst_text_line *line, char *scratch, bst_text_span *fields,
                       int maximum) {
    const char *c = line->text, *end = c + line->length;
    int count = 0;
    for (;;) {
        while (c < end && is_blank(*c)) {
            c++;
        }
        bst_text_span field = {c, 0};
        if (c < end && *c == '"') {
            const char *raw = ++c;
            bool doubled = false;
            field.text = scratch;
            for (; c < end; c++) {
                if (*c == '"') {
                    if (c + 1 == end || c[1] != '"') {
                        break;
                    }
                    doubled = true;
                    c++;
                }
                scratch[field.length++] = *c;
            }
            if (c == end) {
                return -1;
            }
            if (doubled) {
                scratch += field.length;
            } else {
                field.text = raw;
            }
            for (c++; c < end && is_blank(*c);) {
                c++;
            }
            if (c < end && *c != ',') {
                return -1;
            }
        } else {
            const char *comma = c < end ? memchr(c, ',', (size_t)(end - c)) : NULL;
            comma = comma ? comma : end;
            field = bst_text_trimmed((bst_text_span){c, (size_t)(comma - c)});
            c = comma;
        }
        if (count == maximum) {
            return maximum + 1;
        }
        fields[count++] = field;
        if (c == end) {
            return count;
        }
        c++;
    }
}

bst_status bst_text_fail_line(const bst_text_source *source, const bst_text_line *line,
                              const char *problem, const char *expected) {
    return bst_text_fail_at(source, line, problem, line->text, line->length, expected);
}

bst_status bst_text_split(const bst_text_source *source, const bst_text_line *line,
                          bst_text_span *keyword, bst_text_span *value) {
    const char *expected, *problem = bst_text_split_keyword(line, keyword, value, &expected);
    return problem ? bst_text_fail_line(source, line, problem, expected) : BST_OK;
}
