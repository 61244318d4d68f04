/* Origins of a JSON document's values: the file of each. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_internal.h"

/* Checks whether one of two JSON pointers is equal to the other or its prefix. */
static bool one_way(const char *a, const char *b) {
    for (; *a && *b; a++, b++) {
        if (*a != *b) {
            return false;
        }
    }
    return (!*a && !*b) || *a == '/' || *b == '/';
}

const char *bst_json_file(const bst_json *json, const char *pointer) {
    for (int i = json->origin_count - 1; i >= 0; i--) {
        const char *own = json->origins[i].pointer;
        if (!*own || one_way(own, pointer)) {
            return json->origins[i].file;
        }
    }
    return json->name;
}

const char *bst_json_origin_file(const bst_json *json, int index) {
    return index < json->origin_count ? json->origins[index].file : NULL;
}

void bst_json_name_file(bst_ctx *ctx, const bst_json *json) {
    size_t length = strlen(json->name);
    if (!json->origins || strncmp(ctx->message, json->name, length) != 0 ||
        strncmp(ctx->message + length, ": /", 3) != 0) {
        return;
    }
    char pointer[BST_MESSAGE_BYTES];
    const char *from = ctx->message + length + 2, *end = strstr(from, ": ");
    snprintf(pointer, sizeof pointer, "%.*s", end ? (int)(end - from) : (int)strlen(from), from);
    bst_fail(ctx, BST_OK, "%s: %s", bst_json_file(json, pointer), from);
}

bst_status bst_json_note_origin(bst_ctx *ctx, bst_json *json, const char *pointer,
                                const char *file) {
    bst_json_origin *origins =
        realloc(json->origins, ((size_t)json->origin_count + 1) * sizeof *origins);
    if (!origins) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    json->origins = origins;
    bst_json_origin *origin = &origins[json->origin_count];
    *origin = (bst_json_origin){strdup(pointer), strdup(file)};
    if (!origin->pointer || !origin->file) {
        free(origin->pointer);
        free(origin->file);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    json->origin_count++;
    return BST_OK;
}
