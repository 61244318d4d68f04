/* What the reader of one element set and the reader of files share. */
#ifndef BST_ASTRO_TLE_INTERNAL_H
#define BST_ASTRO_TLE_INTERNAL_H

#include "sim/astro/tle.h"

/* A line of text: not terminated, without its line end and trailing white space. */
typedef struct bst_tle_line {
    const char *text;
    size_t length;
    int number; /* in the file, or 1 and 2 outside a file */
} bst_tle_line;

/* Where messages go and what they name. */
typedef struct bst_tle_source {
    bst_ctx *ctx;
    const char *name; /* of the file; NULL outside a file */
} bst_tle_source;

/* BST_ERR_FORMAT with "file:12: problem (found "...", expected ...)" or "line 1: problem (...)". */
bst_status bst_tle_fail_at(const bst_tle_source *source, const bst_tle_line *line,
                           const char *problem, const char *found, size_t found_length,
                           const char *expected);

/* Five digits, or Alpha-5: a letter for the two leading digits 10 to 33, without I and O. Reads
 * five characters at text; false when they are no number. */
bool bst_tle_decode_number(const char *text, int *out);

/* Drops blanks, tabs and line ends at the end. */
void bst_tle_trim_end(bst_tle_line *line);

/* Copies without leading and trailing blanks, cut to out_bytes - 1 characters. */
void bst_tle_copy_trimmed(const char *text, size_t length, char *out, size_t out_bytes);

/* As bst_tle_parse; the name is left empty. */
bst_status bst_tle_parse_set(const bst_tle_source *source, const bst_tle_line *line1,
                             const bst_tle_line *line2, bst_elements *out);

#endif
