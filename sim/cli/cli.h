/* Common parts of all commands: exit codes and the log on standard error. */
#ifndef BST_CLI_CLI_H
#define BST_CLI_CLI_H

#include "boresight/status.h"

enum {
    BST_EXIT_OK = 0,
    BST_EXIT_FAILED = 1,
    BST_EXIT_USAGE = 2,
    BST_EXIT_RUNS_FAILED = 4, /* a study is complete, but some runs failed */
    BST_EXIT_INTERRUPTED = 130
};

/* Log sink that writes to standard error: "boresight: warning: ...". */
void bst_cli_log(void *user, bst_log_level level, const char *message);

/* Log sink that writes to standard error without the level: "boresight NAME: ...".
 *
 * Given:     user  NAME, a const char * */
void bst_cli_log_as(void *user, bst_log_level level, const char *message);

#endif
