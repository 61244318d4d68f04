/* Members of JSON objects, by key. */
#ifndef BST_CORE_JSON_MEMBER_H
#define BST_CORE_JSON_MEMBER_H

#include <cjson/cJSON.h>
#include <math.h>

/* NULL: there is none, or `node` is NULL or no object. */
static inline const cJSON *bst_json_member(const cJSON *node, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(node, key);
}

/* The text of a member; `fallback` where it is no string. */
static inline const char *bst_json_member_text(const cJSON *node, const char *key,
                                               const char *fallback) {
    const cJSON *item = bst_json_member(node, key);
    return cJSON_IsString(item) ? item->valuestring : fallback;
}

/* The number of a member; NAN where it is none. */
static inline double bst_json_member_number(const cJSON *node, const char *key) {
    const cJSON *item = bst_json_member(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

#endif
