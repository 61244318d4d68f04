/* Lists of objects in the JSON that the viewer sends. */
#ifndef BST_VIEW_JSON_LIST_H
#define BST_VIEW_JSON_LIST_H

#include <cjson/cJSON.h>

/* Adds an empty object to a list; it belongs to the list. */
static inline cJSON *bst_view_add_object(cJSON *list) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddItemToArray(list, node);
    return node;
}

#endif
