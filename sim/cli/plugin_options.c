#include "sim/cli/plugin_options.h"

#include <string.h>

#include "sim/cli/plugins.h"
#include "sim/core/text.h"

static bst_status unknown_option(bst_ctx *ctx, const char *word) {
    const char *nearest = bst_text_distance(word, "--plugin") <= 2       ? "--plugin"
                          : bst_text_distance(word, "--no-plugins") <= 2 ? "--no-plugins"
                                                                         : NULL;
    return bst_fail(ctx, BST_ERR_ARGUMENT, "unknown option %.80s%s%s%s; see boresight --help", word,
                    nearest ? "; did you mean " : "", nearest ? nearest : "", nearest ? "?" : "");
}

bst_status bst_plugin_options_take(bst_ctx *ctx, int argc, char **argv, int *first) {
    for (; *first < argc && strncmp(argv[*first], "--", 2) == 0; ++*first) {
        const char *word = argv[*first];
        if (strcmp(word, "--no-plugins") == 0) {
            BST_TRY(bst_plugins_refuse(ctx));
        } else if (strcmp(word, "--plugin") != 0) {
            return unknown_option(ctx, word);
        } else if (*first + 2 >= argc) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--plugin takes the path of a shared library, and a command after it; "
                            "see boresight --help");
        } else {
            BST_TRY(bst_plugins_add(ctx, argv[++*first]));
        }
    }
    return BST_OK;
}
