/* Access to members of JSON objects by key. */
#ifndef BST_CORE_JSON_MEMBER_H
#define BST_CORE_JSON_MEMBER_H

#include <cjson/cJSON.h>
#include <math.h>
#include <stdint.h>

/* Member of a JSON object; NULL: none, or `node` is NULL or no object. */
static inline const cJSON *bst_json_member(const cJSON *node, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(node, key);
}

/* Text of a JSON member; `fallback` if it is no string. */
static inline const char *bst_json_member_text(const cJSON *node, const char *key,
                                               const char *fallback) {
    const cJSON *item = bst_json_member(node, key);
    return cJSON_IsString(item) ? item->valuestring : fallback;
}

/* Number of a JSON member; NAN if it is none. */
static inline double bst_json_member_number(const cJSON *node, const char *key) {
    const cJSON *item = bst_json_member(node, key);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

/* Whole number of a JSON item, cut off at the largest ones that JSON holds exactly (2^53);
 * `fallback` if it is no number. */
static inline int64_t bst_json_whole(const cJSON *item, int64_t fallback) {
    const double most = 9007199254740992.0;
    if (!cJSON_IsNumber(item) || isnan(item->valuedouble)) {
        return fallback;
    }
    return (int64_t)fmin(fmax(item->valuedouble, -most), most);
}

#endif
