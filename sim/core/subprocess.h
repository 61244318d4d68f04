/* Child processes with an argument vector, without shell and quoting. */
#ifndef BST_CORE_SUBPROCESS_H
#define BST_CORE_SUBPROCESS_H

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>

#include "boresight/status.h"

typedef struct bst_subprocess {
    pid_t pid;
    FILE *output; /* standard output of the child if requested, else NULL */
    FILE *input;  /* standard input of the child if requested, else NULL */
} bst_subprocess;

/* Starts argv[0] (found by PATH) in `directory` (NULL: current) with the C locale. want_output:
 * child->output reads its standard output; else it goes to /dev/null. Standard error goes to the
 * file `error_path`; NULL: discarded. Close with bst_subprocess_wait. BST_ERR_NOT_FOUND: no such
 * program. */
bst_status bst_subprocess_start(bst_ctx *ctx, const char *const argv[], const char *directory,
                                bool want_output, const char *error_path,
                                bst_subprocess *out) BST_MUST_CHECK;

/* Starts as bst_subprocess_start with want_output, as the leader of a group of processes:
 * bst_subprocess_kill reaches what the child has started, and Ctrl-C in a terminal does not reach
 * it. */
bst_status bst_subprocess_start_group(bst_ctx *ctx, const char *const argv[], const char *directory,
                                      const char *error_path, bst_subprocess *out) BST_MUST_CHECK;

/* Kills the group of a child of bst_subprocess_start_group; bst_subprocess_wait is still needed. */
void bst_subprocess_kill(const bst_subprocess *child);

/* Starts a child in the current directory with child->input connected to its standard input; its
 * standard output is discarded. Ignore SIGPIPE: the child may end early. */
bst_status bst_subprocess_start_fed(bst_ctx *ctx, const char *const argv[], const char *error_path,
                                    bst_subprocess *out) BST_MUST_CHECK;

/* True if the child has ended; *exit_code: its exit status, or 128 + signal. */
bool bst_subprocess_poll(bst_subprocess *child, int *exit_code);

/* Closes input and output and waits for the child; returns its exit status, or 128 + signal. */
int bst_subprocess_wait(bst_subprocess *child);

#endif
