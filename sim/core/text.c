#include "sim/core/text.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { LONGEST_WORD = 64, FARTHEST_SUGGESTION = 3 };

size_t bst_text_distance(const char *a, const char *b) {
    size_t n = strlen(a), m = strlen(b);
    size_t row[LONGEST_WORD + 1];
    if (n > LONGEST_WORD || m > LONGEST_WORD) {
        return LONGEST_WORD;
    }
    for (size_t j = 0; j <= m; j++) {
        row[j] = j;
    }
    for (size_t i = 1; i <= n; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= m; j++) {
            size_t substitute = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            size_t best = row[j] + 1 < row[j - 1] + 1 ? row[j] + 1 : row[j - 1] + 1;
            row[j] = substitute < best ? substitute : best;
        }
    }
    return row[m];
}

bool bst_text_is_nearer(const char *word, const char *candidate, size_t *best) {
    size_t length = strlen(word);
    /* a key without its unit: "rate" for "rate_hz" */
    bool lacks_unit =
        length > 1 && strncmp(word, candidate, length) == 0 && candidate[length] == '_';
    size_t distance = lacks_unit ? 1 : bst_text_distance(word, candidate);
    /* a word without a common letter is no misspelling */
    if (distance > FARTHEST_SUGGESTION || distance >= strlen(candidate) || distance >= *best) {
        return false;
    }
    *best = distance;
    return true;
}

const char *bst_text_of_count(char text[BST_COUNT_TEXT], int64_t count, const char *one,
                              const char *many) {
    snprintf(text, BST_COUNT_TEXT, "%lld %s", (long long)count, count == 1 ? one : many);
    return text;
}

bool bst_text_is_file_name(const char *word) {
    size_t length = strlen(word);
    if (length == 0 || length > 255 || word[0] == '.') {
        return false;
    }
    for (const char *c = word; *c; c++) {
        if (*c == '/' || (unsigned char)*c < 0x20 || *c == 0x7f) {
            return false;
        }
    }
    return true;
}

bool bst_text_ends_in(const char *text, const char *ending) {
    size_t length = strlen(text), n = strlen(ending);
    return length > n && strcasecmp(text + length - n, ending) == 0;
}

void bst_text_of_number(double value, char *buffer, size_t bytes) {
    assert(buffer && bytes > 0);
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(buffer, bytes, "%.*g", digits, value);
        if (strtod(buffer, NULL) == value) {
            return;
        }
    }
}
