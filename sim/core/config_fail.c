/* Error messages about configuration values. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/json_internal.h"
#include "sim/core/text.h"

/* Formats the wrong value for a message, shortened. */
static void value_text(const cJSON *value, char *buffer, size_t bytes) {
    if (cJSON_IsNumber(value)) {
        bst_text_of_number(value->valuedouble, buffer, bytes);
        return;
    }
    char *text = cJSON_PrintUnformatted(value);
    snprintf(buffer, bytes, "%s", text ? text : "?");
    if (text && strlen(text) >= bytes && bytes > 4) {
        size_t end = bytes - 4;
        while (end > 0 && ((unsigned char)buffer[end] & 0xC0) == 0x80) {
            end--; /* do not cut a UTF-8 character */
        }
        memcpy(buffer + end, "...", 4);
    }
    free(text);
}

bst_status bst_config_fail(bst_ctx *ctx, const char *file, const char *path, const cJSON *value,
                           const char *what, const char *allowed) {
    char found[80];
    value_text(value, found, sizeof found);
    return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s: %s (found %s; allowed: %s)", file,
                    *path ? path : "/", what, found, allowed);
}
