/* What the readers of text files share: lines, words, numbers, fields, and messages that name the
 * line. */
#ifndef BST_ASTRO_TEXT_INTERNAL_H
#define BST_ASTRO_TEXT_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

/* A line of text: not terminated, without its line end and trailing white space. */
typedef struct bst_text_line {
    const char *text;
    size_t length;
    int number; /* in the file, or 1 and 2 outside a file */
} bst_text_line;

/* Where messages go and what they name. */
typedef struct bst_text_source {
    bst_ctx *ctx;
    const char *name; /* of the file; NULL outside a file */
} bst_text_source;

/* A piece of a line; not terminated. */
typedef struct bst_text_span {
    const char *text;
    size_t length;
} bst_text_span;

/* Place in a text of `end - next` bytes that are still to be read. */
typedef struct bst_text_cursor {
    const char *next, *end;
    int line_number; /* of the line read last */
} bst_text_cursor;

enum { BST_TEXT_QUOTE_BYTES = 160 };

/* BST_ERR_FORMAT with "file:12: problem (found "...", expected ...)" or "line 1: problem (...)". */
bst_status bst_text_fail_at(const bst_text_source *source, const bst_text_line *line,
                            const char *problem, const char *found, size_t found_length,
                            const char *expected);

/* BST_ERR_MEMORY with "file: no memory for its WHAT". */
bst_status bst_text_fail_memory(const bst_text_source *source, const char *what);

static inline bool bst_text_is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* Puts text in quotes, what is not printable ASCII as \xNN, cut to what fits. */
void bst_text_quote(const char *text, size_t length, char out[BST_TEXT_QUOTE_BYTES]);

/* Drops blanks, tabs and line ends at the end. */
void bst_text_trim_end(bst_text_line *line);

/* Starts at the first line, after a UTF-8 byte order mark. */
bst_text_cursor bst_text_start(const char *data, size_t bytes);
/* The next line, its end trimmed; false at the end of the text. */
bool bst_text_next_line(bst_text_cursor *cursor, bst_text_line *line);
/* Takes the next word, ended by blanks or tabs, off the front of `rest`; false when none is left.
 */
bool bst_text_next_word(bst_text_span *rest, bst_text_span *word);

/* True if a span of text equals a word. */
bool bst_text_is(bst_text_span span, const char *word);
/* Without blanks and tabs at both ends. */
bst_text_span bst_text_trimmed(bst_text_span span);
/* Copies a trimmed span, cut to out_bytes - 1 characters. */
void bst_text_copy(bst_text_span span, char *out, size_t out_bytes);
/* Whether all characters are printable ASCII. */
bool bst_text_is_plain(bst_text_span span);

/* Takes a line "KEYWORD = value" of a CCSDS message (KVN) apart, blanks around both dropped.
 * Returns NULL, or what is wrong with the line, and in *expected what is allowed. */
const char *bst_text_split_keyword(const bst_text_line *line, bst_text_span *keyword,
                                   bst_text_span *value, const char **expected);

/* [sign]digits[.digits][(e|E)[sign]digits], also with no digits on one side of the point; the
 * nearest double, in any locale. False for anything else and for what is beyond double. */
bool bst_text_number(bst_text_span span, double *out);
/* Digits only, at most `maximum` (at least 0). */
bool bst_text_count(bst_text_span span, int maximum, int *out);

/* Splits a line of comma-separated values (RFC 4180; blanks around a field are dropped) into at
 * most `maximum` fields. A field with doubled quotes is unquoted into `scratch`, of line->length
 * bytes; the others are parts of the line. Returns how many there are, maximum + 1 when more, or -1
 * when a quote is not closed or is followed by other text. */
int bst_text_split_csv(const bst_text_line *line, char *scratch, bst_text_span *fields,
                       int maximum);

#endif
