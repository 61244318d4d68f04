#include "sim/io/html.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>

#define REPLACEMENT "\xEF\xBF\xBD"

/* Length of the UTF-8 character at `s`; 0: invalid (overlong form, surrogate, or beyond
 * U+10FFFF). */
static int character_bytes(const unsigned char *s) {
    static const uint32_t least[5] = {0, 0, 0x80, 0x800, 0x10000};
    int n = s[0] < 0x80 ? 1 : s[0] >> 5 == 6 ? 2 : s[0] >> 4 == 14 ? 3 : s[0] >> 3 == 30 ? 4 : 0;
    uint32_t code = n == 1 ? s[0] : s[0] & (0xFFu >> (n + 1));
    for (int i = 1; i < n; i++) {
        if (s[i] >> 6 != 2) {
            return 0; /* includes the end of the text */
        }
        code = code << 6 | (s[i] & 0x3Fu);
    }
    return code < least[n] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000) ? 0 : n;
}

void bst_html_text(FILE *out, const char *text) {
    for (const unsigned char *s = (const unsigned char *)(text ? text : ""); *s;) {
        int n = character_bytes(s);
        /* C1 controls are two bytes: C2 80 to C2 9F */
        bool control = (*s < ' ' && *s != '\t' && *s != '\n') || *s == 0x7F ||
                       (n == 2 && s[0] == 0xC2 && s[1] < 0xA0);
        const char *reference = *s == '&'    ? "&amp;"
                                : *s == '<'  ? "&lt;"
                                : *s == '>'  ? "&gt;"
                                : *s == '"'  ? "&quot;"
                                : *s == '\'' ? "&#39;"
                                             : NULL;
        if (n == 0 || control) {
            fputs(REPLACEMENT, out);
        } else if (reference) {
            fputs(reference, out);
        } else {
            fwrite(s, 1, (size_t)n, out);
        }
        s += n > 0 ? n : 1;
    }
}

void bst_html_format(FILE *out, const char *format, ...) {
    char text[4096];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    bst_html_text(out, text);
}

void bst_html_base64(FILE *out, const void *data, size_t bytes) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const unsigned char *s = data;
    for (size_t i = 0; i < bytes; i += 3) {
        size_t n = bytes - i < 3 ? bytes - i : 3;
        uint32_t word = (uint32_t)s[i] << 16 | (n > 1 ? (uint32_t)s[i + 1] << 8 : 0) |
                        (n > 2 ? (uint32_t)s[i + 2] : 0);
        char group[4] = {digits[word >> 18], digits[word >> 12 & 63], digits[word >> 6 & 63],
                         digits[word & 63]};
        for (size_t k = n + 1; k < 4; k++) {
            group[k] = '=';
        }
        fwrite(group, 1, 4, out);
    }
}
