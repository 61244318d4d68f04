/* The JSON reader, overrides and configuration tables on any bytes. Input: a line with the override
 * "/path=value", then the document; without a line that starts with '/', the document alone. What
 * is accepted must be echoed as something that is accepted again, with the same echo. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/config.h"
#include "sim/world/world_config.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static char *echo_of(bst_ctx *ctx, const bst_json *json, bst_status *status) {
    bst_world_config world;
    char *text = NULL;
    *status = bst_config_read(ctx, json, bst_json_root(json), "", bst_world_config_table, &world);
    if (*status == BST_OK) {
        cJSON *echo = bst_config_echo(bst_world_config_table, &world);
        text = cJSON_PrintUnformatted(echo);
        cJSON_Delete(echo);
        bst_config_free(bst_world_config_table, &world);
    }
    return text;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    const char *text = (const char *)data;
    char *assignment = NULL;
    const char *line_end = bytes && text[0] == '/' ? memchr(text, '\n', bytes) : NULL;
    if (line_end) {
        size_t length = (size_t)(line_end - text);
        assignment = strndup(text, length);
        text += length + 1;
        bytes -= length + 1;
    }
    bst_json *json = NULL;
    bst_status status = bst_json_parse(&ctx, "input", text, bytes, &json);
    if (status == BST_OK && assignment) {
        status = bst_json_set(&ctx, json, assignment);
    }
    char *first = status == BST_OK ? echo_of(&ctx, json, &status) : NULL;
    bst_json_free(json);
    if ((status == BST_OK) != (ctx.message[0] == '\0')) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    if (first) {
        if (bst_json_parse(&ctx, "echo", first, strlen(first), &json) != BST_OK) {
            abort();
        }
        char *second = echo_of(&ctx, json, &status);
        if (!second || strcmp(first, second) != 0) {
            abort();
        }
        free(second);
        bst_json_free(json);
    }
    free(first);
    free(assignment);
    return 0;
}
