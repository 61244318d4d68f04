#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/link/icd.h"

int bst_cmd_icd(int argc, char **argv) {
    bool help = false;
    const bst_option table[] = {
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_INFO);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK || arguments != 0) {
        if (arguments != 0) {
            bst_fail(&ctx, BST_ERR_ARGUMENT, "no argument is expected");
        }
        return bst_options_misuse(&ctx, "icd");
    }
    if (help) {
        printf(
            "usage: boresight icd\n\n"
            "Prints the interface control document of the link, in Markdown, from the tables "
            "that the program uses.\n\n"
            "  boresight icd > docs/reference/icd.md\n\noptions:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (bst_link_icd(&ctx, stdout) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}
