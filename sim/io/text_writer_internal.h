/* What the writers of text formats share. */
#ifndef BST_IO_TEXT_WRITER_INTERNAL_H
#define BST_IO_TEXT_WRITER_INTERNAL_H

#include <stdio.h>

#include "sim/io/state_series.h"

enum { BST_TIME_TEXT_BYTES = 40 };

/* UTC without the Z, to 1 ns; zeros beyond the third decimal are left out. */
void bst_text_utc(bst_time t, char text[BST_TIME_TEXT_BYTES]);

/* "KEY = value\n", what is not printable ASCII as '_'. */
void bst_io_kvn_write(FILE *stream, const char *key, const char *value);

/* Each line of a text as "COMMENT line\n"; NULL and "": nothing. */
void bst_io_kvn_comment(FILE *stream, const char *text);

/* BST_ERR_IO when the stream has an error. */
bst_status bst_text_stream_ok(bst_ctx *ctx, FILE *stream) BST_MUST_CHECK;

/* BST_ERR_ARGUMENT unless `after` is later than `before`; `what` and `row` (of `after`) name them.
 */
bst_status bst_text_rising(bst_ctx *ctx, const char *what, int64_t row, bst_time before,
                           bst_time after) BST_MUST_CHECK;

#endif
