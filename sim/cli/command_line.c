#include "sim/cli/command_line.h"

bool bst_command_line_read(bst_ctx *ctx, const bst_command_line *line, int argc, char **argv,
                           int *arguments, int *code) {
    if (bst_options_parse(ctx, line->options, argc, argv, arguments) != BST_OK) {
        *code = bst_options_misuse(ctx, line->name);
        return false;
    }
    if (*line->help) {
        fputs(line->usage, stdout);
        bst_options_print(stdout, line->options);
        *code = BST_EXIT_OK;
        return false;
    }
    return true;
}

int bst_command_line_exit_code(bst_status status) {
    return status == BST_OK                ? BST_EXIT_OK
           : status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED
                                           : BST_EXIT_FAILED;
}

int bst_command_line_end(const bst_ctx *ctx, bst_status status) {
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
    }
    return bst_command_line_exit_code(status);
}

int bst_command_line_end_as(const char *name, const bst_ctx *ctx, bst_status status) {
    if (status != BST_OK) {
        fprintf(stderr, "boresight %s: %s\n", name, ctx->message);
    }
    return bst_command_line_exit_code(status);
}

int bst_command_line_misuse(const char *name, const char *what, const char *word) {
    fprintf(stderr, "boresight %s: %s%s%s; see boresight %s --help\n", name, what, word ? " " : "",
            word ? word : "", name);
    return BST_EXIT_USAGE;
}
