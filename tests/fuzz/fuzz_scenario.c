/* Whole scenarios with every module of the program, from any bytes. */
#include <stdint.h>
#include <stdlib.h>

#include <cjson/cJSON.h>

#include "sim/app/app.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_json *json = NULL;
    if (bst_json_parse(&ctx, "input", (const char *)data, bytes, &json) != BST_OK) {
        return 0;
    }
    bst_scenario scenario;
    bst_scenario_registry registry = *bst_registry_shipped();
    registry.policy = BST_PLUGINS_REFUSE;
    bst_status status = bst_scenario_read(&ctx, json, &registry, &scenario);
    if ((status == BST_OK) != (ctx.message[0] == '\0')) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    if (status == BST_OK) {
        cJSON_Delete(bst_scenario_echo(&scenario));
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return 0;
}
