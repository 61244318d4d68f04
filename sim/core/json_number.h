/* Writes JSON numbers; non-finite ones become null. */
#ifndef BST_CORE_JSON_NUMBER_H
#define BST_CORE_JSON_NUMBER_H

#include <cjson/cJSON.h>
#include <math.h>

static inline void bst_json_add_number(cJSON *node, const char *key, double value) {
    if (isfinite(value)) {
        cJSON_AddNumberToObject(node, key, value);
    } else {
        cJSON_AddNullToObject(node, key);
    }
}

#endif
