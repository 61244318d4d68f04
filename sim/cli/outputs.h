/* Protection against overwriting inputs: checks every output path of a command. */
#ifndef BST_CLI_OUTPUTS_H
#define BST_CLI_OUTPUTS_H

#include "sim/cli/options.h"

/* Checks the output options of a command before it begins.
 * Given: table; given[i]: option i is on the command line; `words`: its other words (files
 *        and folders that the command reads).
 * Errors, BST_ERR_ARGUMENT with option, path and remedy: the path has a control character, is
 * too long, is a folder (for a file) or a file (for a folder), a pipe or a socket; the folder above
 * is missing or cannot be written to; the same file, by whatever name or link, is read by the
 * command, belongs to the run or study that is read, or is another option's output; or is the name
 * of a file of the run or study in that folder. */
bst_status bst_outputs_check(bst_ctx *ctx, const bst_option *table, const bool *given, int words,
                             char *const *word) BST_MUST_CHECK;

/* Checks that no output option of the table is the file `input`, which the command reads. `why`:
 * reason for the message, such as "scenario.json names it". BST_ERR_ARGUMENT. */
bst_status bst_outputs_spare(bst_ctx *ctx, const bst_option *table, const char *input,
                             const char *why) BST_MUST_CHECK;

/* Checks that a result of an earlier command is not replaced without --overwrite.
 * BST_ERR_ARGUMENT: `path` is there, and `overwrite` false. */
bst_status bst_outputs_refuse_earlier(bst_ctx *ctx, const char *path,
                                      bool overwrite) BST_MUST_CHECK;

#endif
