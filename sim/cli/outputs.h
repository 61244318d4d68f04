/* The guard of every path that a command writes to. */
#ifndef BST_CLI_OUTPUTS_H
#define BST_CLI_OUTPUTS_H

#include "sim/cli/options.h"

/* Checks the output options of a command before it begins.
 * Given: table; given[i], whether option i was on the command line; what else was on it, `words`
 * (files and folders that the command reads, or any other words).
 * Errors, BST_ERR_ARGUMENT with option, path and what to do: the path holds a control character, is
 * too long, is a folder (for a file) or a file (for a folder), a pipe or a socket; the folder above
 * is missing or cannot be written to; the same file, by whatever name or link, is read by the
 * command, belongs to the run or study that is read, or is another option's output; a file of the
 * name belongs to the run or study that the folder is of. */
bst_status bst_outputs_check(bst_ctx *ctx, const bst_option *table, const bool *given, int words,
                             char *const *word) BST_MUST_CHECK;

/* Checks that no output option of the table is the file `input`, which the command reads. `why`
 * says for what, for the message: "scenario.json names it". BST_ERR_ARGUMENT. */
bst_status bst_outputs_spare(bst_ctx *ctx, const bst_option *table, const char *input,
                             const char *why) BST_MUST_CHECK;

#endif
