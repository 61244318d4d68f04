/* Functions shared by the writers of OEM, OMM and TDM. */
#ifndef BST_IO_TEXT_WRITER_INTERNAL_H
#define BST_IO_TEXT_WRITER_INTERNAL_H

#include <stdio.h>

#include "sim/io/state_series.h"

enum { BST_TIME_TEXT_BYTES = 40 };

/* Formats UTC without Z, to 1 ns; trailing zeros beyond the third decimal are omitted. */
void bst_text_utc(bst_time t, char text[BST_TIME_TEXT_BYTES]);

/* Writes "KEY = value\n"; non-printable or non-ASCII characters become '_'. */
void bst_io_kvn_write(FILE *stream, const char *key, const char *value);

/* Writes each line of a text as "COMMENT line\n"; NULL and "": nothing. */
void bst_io_kvn_comment(FILE *stream, const char *text);

/* BST_ERR_IO if the output stream has an error. */
bst_status bst_text_stream_ok(bst_ctx *ctx, FILE *stream) BST_MUST_CHECK;

/* Checks that the time `after` is later than `before`; BST_ERR_ARGUMENT names `what` and `row`. */
bst_status bst_text_rising(bst_ctx *ctx, const char *what, int64_t row, bst_time before,
                           bst_time after) BST_MUST_CHECK;

#endif
