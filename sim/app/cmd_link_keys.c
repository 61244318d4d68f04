#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/link/curve_keys.h"

int bst_cmd_link_keys(int argc, char **argv) {
    bool help = false;
    const char *out = NULL;
    const bst_option table[] = {
        {.name = "out",
         .kind = BST_OPTION_TEXT,
         .target = &out,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "where the keys go; nothing may be there",
         .required = true},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_INFO);
    if (bst_options_parse(&ctx, table, argc, argv, NULL) != BST_OK) {
        return bst_options_misuse(&ctx, "link-keys");
    }
    if (help) {
        printf(
            "usage: boresight link-keys --out FILE\n\n"
            "Makes keys with which a run takes only peers that have them, and encrypts what is "
            "sent (ZeroMQ's\n"
            "CURVE). Run and peers are given the same file, which only its owner may read:\n\n"
            "  boresight link-keys --out ~/link.keys\n"
            "  boresight run SCENARIO.json --link tcp://127.0.0.1:5555 --link-keys ~/link.keys "
            "--external control\n"
            "  boresight serve SCENARIO.json --link tcp://127.0.0.1:5555 --link-keys ~/link.keys "
            "--part control\n\n"
            "options:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (bst_curve_keys_make(&ctx, out) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    printf("%s\n", out);
    return BST_EXIT_OK;
}
