/* Start and end of a command: reading its line, --help, exit code. */
#ifndef BST_CLI_COMMAND_LINE_H
#define BST_CLI_COMMAND_LINE_H

#include "sim/cli/cli.h"
#include "sim/cli/options.h"

/* What a command accepts. */
typedef struct bst_command_line {
    const char *name;          /* of the command, such as "run" */
    const char *usage;         /* text of --help above the list of options */
    const bst_option *options; /* with targets set; its last entry has no name */
    const bool *help;          /* target of --help */
} bst_command_line;

/* Reads the options of a command and answers --help.
 *
 * Given:     argc, argv  as bst_options_parse
 *            arguments   NULL if the command takes no words besides options
 * Returned:  true if the command shall go on; otherwise *code is its exit status, and help or
 *            message are printed */
bool bst_command_line_read(bst_ctx *ctx, const bst_command_line *line, int argc, char **argv,
                           int *arguments, int *code);

/* Exit status of a command: BST_EXIT_OK, BST_EXIT_INTERRUPTED or BST_EXIT_FAILED. */
int bst_command_line_exit_code(bst_status status);

/* Ends a command: prints "boresight: message" of an error to the standard error.
 *
 * Returned:  bst_command_line_exit_code */
int bst_command_line_end(const bst_ctx *ctx, bst_status status);

/* The same with the command's name: "boresight NAME: message". */
int bst_command_line_end_as(const char *name, const bst_ctx *ctx, bst_status status);

/* Ends a command with parts of its own (boresight NAME PART) that was called wrongly: prints
 * `what`, the word it is about (NULL: none), and where help is.
 *
 * Returned:  BST_EXIT_USAGE */
int bst_command_line_misuse(const char *name, const char *what, const char *word);

#endif
