/* Functions shared by readers of text files: lines, words, numbers, fields, and messages with line
 * numbers. */
#ifndef BST_CORE_TEXT_READER_H
#define BST_CORE_TEXT_READER_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

/* A line of text: not terminated, without its line end and trailing white space. */
typedef struct bst_text_line {
    const char *text;
    size_t length;
    int number; /* in the file, or 1 and 2 outside a file */
} bst_text_line;

/* Context for messages: file name. */
typedef struct bst_text_source {
    bst_ctx *ctx;
    const char *name; /* of the file; NULL outside a file */
} bst_text_source;

/* A piece of a line; not terminated. */
typedef struct bst_text_span {
    const char *text;
    size_t length;
} bst_text_span;

/* Position in a text; `end - next` bytes remain. */
typedef struct bst_text_cursor {
    const char *next, *end;
    int line_number; /* of the last line read */
} bst_text_cursor;

enum { BST_TEXT_QUOTE_BYTES = 160 };

/* BST_ERR_FORMAT with "file:12: problem (found "...", expected ...)" or "line 1: problem (...)". */
bst_status bst_text_fail_at(const bst_text_source *source, const bst_text_line *line,
                            const char *problem, const char *found, size_t found_length,
                            const char *expected);

/* As bst_text_fail_at; what was found is the whole line. */
bst_status bst_text_fail_line(const bst_text_source *source, const bst_text_line *line,
                              const char *problem, const char *expected);

/* BST_ERR_MEMORY with "file: no memory for its WHAT". */
bst_status bst_text_fail_memory(const bst_text_source *source, const char *what);

static inline bool bst_text_is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* Quotes text for messages: non-printable or non-ASCII bytes as \xNN, truncated to the buffer. */
void bst_text_quote(const char *text, size_t length, char out[BST_TEXT_QUOTE_BYTES]);

/* Drops blanks, tabs and line ends at the end. */
void bst_text_trim_end(bst_text_line *line);

/* Cursor at the first line, after a UTF-8 byte order mark. */
bst_text_cursor bst_text_start(const char *data, size_t bytes);
/* Reads the next line without trailing white space; false: end of the text. */
bool bst_text_next_line(bst_text_cursor *cursor, bst_text_line *line);
/* Removes the next word, separated by blanks or tabs, from `rest`; false: none. */
bool bst_text_next_word(bst_text_span *rest, bst_text_span *word);

/* True if a span of text equals a word. */
bool bst_text_is(bst_text_span span, const char *word);
/* Span without blanks and tabs at both ends. */
bst_text_span bst_text_trimmed(bst_text_span span);
/* Copies a trimmed span, cut to out_bytes - 1 characters. */
void bst_text_copy(bst_text_span span, char *out, size_t out_bytes);
/* True if all characters are printable ASCII. */
bool bst_text_is_plain(bst_text_span span);

/* Splits a line "KEYWORD = value" of a CCSDS message (KVN), without surrounding blanks. Returns
 * NULL, or the problem with the line and in *expected what is allowed. */
const char *bst_text_split_keyword(const bst_text_line *line, bst_text_span *keyword,
                                   bst_text_span *value, const char **expected);

/* As bst_text_split_keyword; BST_ERR_FORMAT with line and what is allowed. */
bst_status bst_text_split(const bst_text_source *source, const bst_text_line *line,
                          bst_text_span *keyword, bst_text_span *value) BST_MUST_CHECK;

/* [sign]digits[.digits][(e|E)[sign]digits], also with no digits on one side of the point; the
 * nearest double, in any locale. False for other text and for numbers beyond double. */
bool bst_text_number(bst_text_span span, double *out);
/* Parses digits only, at most `maximum` (at least 0). */
bool bst_text_count(bst_text_span span, int maximum, int *out);

/* Splits a line of comma-separated values (RFC 4180, without blanks around fields) into at most
 * `maximum` fields. A field with doubled quotes is unquoted into `scratch`, of line->length bytes;
 * others point into the line. Returns their number, maximum + 1 if there are more, -1 for an
 * unclosed quote or text after one. */
int bst_text_split_csv(const bst_text_line *line, char *scratch, bst_text_span *fields,
                       int maximum);

#endif
