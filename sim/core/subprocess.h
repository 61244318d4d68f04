/* Child processes with an argument vector: no shell, no quoting. */
#ifndef BST_CORE_SUBPROCESS_H
#define BST_CORE_SUBPROCESS_H

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>

#include "boresight/status.h"

typedef struct bst_subprocess {
    pid_t pid;
    FILE *output; /* the child's standard output when asked for, else NULL */
    FILE *input;  /* the child's standard input when asked for, else NULL */
} bst_subprocess;

/* Starts argv[0] (searched in PATH) in `directory` (NULL: the current one) with the C locale. With
 * want_output, child->output reads its standard output; otherwise that goes to /dev/null. Standard
 * error goes to the file `error_path`, or nowhere when NULL. Close with bst_subprocess_wait.
 * BST_ERR_NOT_FOUND when the program does not exist. */
bst_status bst_subprocess_start(bst_ctx *ctx, const char *const argv[], const char *directory,
                                bool want_output, const char *error_path,
                                bst_subprocess *out) BST_MUST_CHECK;

/* The same in the current directory with child->input, which writes to the child's standard input;
 * its standard output goes nowhere. Ignore SIGPIPE: the child may end early. */
bst_status bst_subprocess_start_fed(bst_ctx *ctx, const char *const argv[], const char *error_path,
                                    bst_subprocess *out) BST_MUST_CHECK;

/* True when the child has ended; *exit_code is then its exit status, or 128 + signal. */
bool bst_subprocess_poll(bst_subprocess *child, int *exit_code);

/* Closes input and output and waits for the end; returns the exit status, or 128 + signal. */
int bst_subprocess_wait(bst_subprocess *child);

#endif
