#include <stdio.h>

#include "sim/cli/cli.h"

void bst_cli_log(void *user, bst_log_level level, const char *message) {
    (void)user;
    static const char *const names[] = {"error", "warning", "info", "debug"};
    if (level == BST_LOG_INFO) {
        fprintf(stderr, "boresight: %s\n", message);
    } else {
        fprintf(stderr, "boresight: %s: %s\n", names[level], message);
    }
}

void bst_cli_log_as(void *user, bst_log_level level, const char *message) {
    (void)level;
    fprintf(stderr, "boresight %s: %s\n", (const char *)user, message);
}
