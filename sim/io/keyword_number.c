/* Finds keywords of a frame and reads numbers. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/keyword_values_internal.h"

const char *bst_keyword_name(bst_frame_source *source, const char *keywords,
                             char text[BST_KEYWORD_TEXT]) {
    char value[BST_FITS_SOURCE_TEXT];
    for (const char *at = keywords; *at;) {
        size_t length = strcspn(at, "|");
        snprintf(text, BST_KEYWORD_TEXT, "%.*s", (int)length, at);
        if (length > 0 && bst_frame_source_text(source, text, value)) {
            return text;
        }
        at += length + (at[length] == '|');
    }
    snprintf(text, BST_KEYWORD_TEXT, "%s", keywords);
    return text;
}

bst_status bst_keyword_wrong(const bst_keyword_reading *r, const char *keyword, const char *key,
                             const char *what) {
    char where[BST_FRAME_WHERE_TEXT], name[BST_KEYWORD_TEXT];
    return bst_fail(r->ctx, BST_ERR_FORMAT, "%s: %s%s (%s of the map%s%s): %s",
                    bst_frame_where(bst_frame_source_path(r->source), r->frame, where),
                    bst_frame_source_noun(r->source), bst_keyword_name(r->source, keyword, name),
                    key, r->map ? " " : "", r->map ? r->map->name : "", what);
}

/* As bst_keyword_find; empty: an empty field counts. */
static bool find(const bst_keyword_reading *r, const char *keywords, bool empty,
                 char value[BST_FITS_SOURCE_TEXT]) {
    char words[BST_KEYWORD_TEXT], *rest = words;
    snprintf(words, sizeof words, "%s", keywords);
    while (rest) {
        char *bar = strchr(rest, '|');
        if (bar) {
            *bar = '\0';
        }
        if (*rest && bst_frame_source_text(r->source, rest, value) && (*value || empty)) {
            return true;
        }
        rest = bar ? bar + 1 : NULL;
    }
    return false;
}

bool bst_keyword_find(const bst_keyword_reading *r, const char *keywords,
                      char value[BST_FITS_SOURCE_TEXT]) {
    bool is_table = *bst_frame_source_noun(r->source) != '\0';
    return find(r, keywords, !is_table, value);
}

bool bst_keyword_is_empty(const bst_keyword_reading *r, const char *keywords) {
    char value[BST_FITS_SOURCE_TEXT];
    return find(r, keywords, true, value) && !*value;
}

bool bst_keyword_number_of(char *text, double *out) {
    char *end;
    for (char *d = text; *d; d++) {
        *d = *d == 'D' || *d == 'd' ? 'E' : *d;
    }
    *out = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*out);
}

bst_status bst_keyword_read_number(const bst_keyword_reading *r, const bst_keyword_number *n,
                                   const bst_keyword_range *allowed, double *out) {
    char text[BST_FITS_SOURCE_TEXT], what[240];
    bool found = *n->keyword && bst_keyword_find(r, n->keyword, text);
    *out = n->value;
    if (!found && isnan(n->value)) {
        return bst_keyword_wrong(
            r, *n->keyword ? n->keyword : "no keyword", allowed->key,
            "is missing (allowed: a header or side table with it, or a map with another "
            "keyword or a value)");
    }
    if (found && !bst_keyword_number_of(text, out)) {
        snprintf(what, sizeof what, "is no number (found \"%.60s\")", text);
        return bst_keyword_wrong(r, n->keyword, allowed->key, what);
    }
    *out *= found ? n->factor : 1.0;
    if (!(*out >= allowed->least && *out <= allowed->most)) {
        snprintf(what, sizeof what, "gives %.9g (allowed: %.9g to %.9g)", *out, allowed->least,
                 allowed->most);
        return bst_keyword_wrong(r, n->keyword, allowed->key, what);
    }
    return BST_OK;
}
