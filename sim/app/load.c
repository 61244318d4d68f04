#include "sim/app/load.h"

#include <stdio.h>

#include "sim/app/app.h"
#include "sim/app/plugins.h"

static bst_status apply(bst_ctx *ctx, const bst_load_options *options, bst_json *json) {
    char text[128];
    for (int i = 0; i < options->set.count; i++) {
        BST_TRY(bst_json_set(ctx, json, options->set.items[i]));
    }
    if (options->seed) {
        snprintf(text, sizeof text, "/seed=\"%.40s\"", options->seed);
        BST_TRY(bst_json_set(ctx, json, text));
    }
    if (options->duration_s >= 0.0) {
        snprintf(text, sizeof text, "/duration_s=%.17g", options->duration_s);
        BST_TRY(bst_json_set(ctx, json, text));
    }
    if (options->run >= 0) {
        snprintf(text, sizeof text, "/run=%lld", (long long)options->run);
        BST_TRY(bst_json_set(ctx, json, text));
    }
    return BST_OK;
}

bst_status bst_load_check(bst_ctx *ctx, const bst_load_options *options) {
    for (int i = 0; i < options->set.count; i++) {
        BST_TRY(bst_json_check_assignment(ctx, options->set.items[i]));
    }
    return BST_OK;
}

bst_status bst_load_scenario(bst_ctx *ctx, const char *path, const bst_load_options *options,
                             bst_json **json, bst_scenario *out) {
    BST_TRY(bst_json_load_extended(ctx, path, json));
    bst_status status = apply(ctx, options, *json);
    if (status == BST_OK) {
        status = bst_plugins_scenario_read(ctx, *json, out);
        if (status != BST_OK) {
            bst_scenario_free(out);
        }
    }
    if (status != BST_OK) {
        bst_json_free(*json);
        *json = NULL;
    }
    return status;
}
