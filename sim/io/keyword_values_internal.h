/* Reading of a frame's keywords, shared by keyword_number.c, keyword_values.c, keyword_attitude.c.
 */
#ifndef BST_IO_KEYWORD_VALUES_INTERNAL_H
#define BST_IO_KEYWORD_VALUES_INTERNAL_H

#include "sim/io/keyword_map.h"

/* A frame whose keywords are read, for messages. */
typedef struct bst_keyword_reading {
    bst_ctx *ctx;
    const bst_keyword_map *map; /* NULL: none */
    bst_frame_source *source;
    const bst_frame_place *frame;
} bst_keyword_reading;

/* A value that is required, within [least, most]. */
typedef struct bst_keyword_range {
    const char *key;
    double least, most;
} bst_keyword_range;

/* Fails at a keyword: "FILE: HDU 2, plane 7: EXPTIME (exposure_s of the map MAP): WHAT", or
 * "FILE: line 7: column EXPTIME (...): WHAT". */
bst_status bst_keyword_wrong(const bst_keyword_reading *reading, const char *keyword,
                             const char *key, const char *what);
/* Value of the first of several keywords "A|B" that the frame has; an empty field of a side table
 * counts as none. */
bool bst_keyword_find(const bst_keyword_reading *reading, const char *keywords,
                      char value[BST_FITS_SOURCE_TEXT]);
/* True if the first of several keywords that a frame has is empty. */
bool bst_keyword_is_empty(const bst_keyword_reading *reading, const char *keywords);
/* Reads a finite number from text; FITS also writes 1.0D0. The text is changed. */
bool bst_keyword_number_of(char *text, double *out);
/* Reads a number by the map. BST_ERR_FORMAT: missing, no number, out of range. */
bst_status bst_keyword_read_number(const bst_keyword_reading *reading,
                                   const bst_keyword_number *number,
                                   const bst_keyword_range *allowed, double *out) BST_MUST_CHECK;

#endif
