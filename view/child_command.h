/* Runs this program as a child process on a text, with limits: an editor's text may be anything. */
#ifndef BST_VIEW_CHILD_COMMAND_H
#define BST_VIEW_CHILD_COMMAND_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

/* Longest standard output and standard error that are read, bytes. */
enum { BST_VIEW_CHILD_BYTES = 16 << 20 };

/* What a child process wrote. */
typedef struct bst_view_child_result {
    char *output, *messages; /* standard output and standard error, with a zero byte */
    int exit_code;           /* 128 + signal if one ended it */
    bool timed_out;
} bst_view_child_result;

/* Runs `boresight WORDS` of this executable with a text as its standard input, and waits for it.
 * Plug-ins are refused (--no-plugins): text that is only being looked at loads no code.
 *
 * Given:     words      words behind the program's name; NULL ends them; up to 12
 *            directory  working folder of the child
 *            text       [bytes] its standard input
 *            limit_s    processor time after which it is killed; so it is after six times as long,
 *                       as a child that waits, or one on a busy machine
 * Returned:  *out       also when the child failed; free it with bst_view_child_free
 * Errors:    BST_ERR_IO: cannot be started; BST_ERR_MEMORY; BST_ERR_FORMAT: more output than
 *            BST_VIEW_CHILD_BYTES */
bst_status bst_view_child_run(bst_ctx *ctx, const char *const *words, const char *directory,
                              const void *text, size_t bytes, int limit_s,
                              bst_view_child_result *out) BST_MUST_CHECK;

/* Frees what bst_view_child_run returned and clears it. */
void bst_view_child_free(bst_view_child_result *result);

#endif
