/* JSON files that extend another file and change some of its values. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/former_names.h"
#include "sim/core/json_internal.h"

enum { MAX_FILES = 16 };

/* Files in the chain of "extends", each extended by the previous one. */
typedef struct file_chain {
    char *files[MAX_FILES]; /* absolute paths */
    int count;
} file_chain;

bst_status bst_json_copy(bst_ctx *ctx, const bst_json *json, bst_json **out) {
    bst_json *copy = calloc(1, sizeof *copy);
    *out = NULL;
    if (copy) {
        copy->name = strdup(json->name);
        copy->root = cJSON_Duplicate(json->root, 1);
        copy->tables = json->tables;
        copy->is_copy = json->tables != NULL;
    }
    bst_status status = copy && copy->name && copy->root
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", json->name);
    for (int i = 0; i < json->origin_count && status == BST_OK; i++) {
        status = bst_json_note_origin(ctx, copy, json->origins[i].pointer, json->origins[i].file);
    }
    if (status != BST_OK) {
        bst_json_free(copy);
        return status;
    }
    *out = copy;
    return BST_OK;
}

/* Moves the values of `node`, by top-level key or by pointer, into `json`; `json` gets the name of
 * their file. */
static bst_status move_values(bst_ctx *ctx, cJSON *node, bool by_pointer, bst_json *json) {
    const char *file = json->name;
    while (node->child) {
        cJSON *value = cJSON_DetachItemViaPointer(node, node->child);
        char pointer[512];
        size_t length =
            (size_t)snprintf(pointer, sizeof pointer, "%s%s", by_pointer ? "" : "/", value->string);
        if (length >= sizeof pointer || (by_pointer && !bst_json_is_pointer(pointer, length)) ||
            (!by_pointer && (length < 2 || strchr(pointer + 1, '/')))) {
            cJSON_Delete(value);
            return by_pointer
                       ? bst_fail(ctx, BST_ERR_CONFIG,
                                  "%s: /set: \"%.60s\" is no JSON pointer (allowed: \"/\" and keys "
                                  "or numbers of elements with \"/\" between them)",
                                  file, pointer)
                       : bst_fail(ctx, BST_ERR_CONFIG, "%s: %.60s: unknown key", file, pointer);
        }
        char where[BST_MESSAGE_BYTES];
        snprintf(where, sizeof where, "%.400s: /set", file);
        if (bst_json_assign_from(ctx, json, pointer, value, by_pointer ? where : NULL) != BST_OK) {
            return bst_fail_prefix(ctx, BST_ERR_CONFIG, "%s: /set: %.200s", file, pointer);
        }
    }
    return BST_OK;
}

/* Rejects a value that a file sets both by its key and in "set". */
static bst_status check_once(bst_ctx *ctx, const bst_json *own, const cJSON *set) {
    for (const cJSON *item = set->child; item; item = item->next) {
        if (item->string[0] == '/' &&
            cJSON_GetObjectItemCaseSensitive(own->root, item->string + 1)) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: %.200s: is given beside \"set\" and in it",
                            own->name, item->string);
        }
    }
    return BST_OK;
}

/* Applies the changes of `own` to `base`. */
static bst_status apply(bst_ctx *ctx, bst_json *own, bst_json *base) {
    const cJSON *given = cJSON_GetObjectItemCaseSensitive(own->root, "set");
    if (cJSON_IsObject(given)) {
        BST_TRY(check_once(ctx, own, given));
    }
    if (!base->origins) {
        BST_TRY(bst_json_note_origin(ctx, base, "", base->name));
    }
    char *name = base->name;
    base->name = own->name;
    own->name = name; /* each name is freed with its document */
    cJSON_DeleteItemFromObjectCaseSensitive(own->root, "extends");
    cJSON *set = cJSON_DetachItemFromObjectCaseSensitive(own->root, "set");
    bst_status status = BST_OK;
    if (set && !cJSON_IsObject(set)) {
        status = bst_config_fail(ctx, base->name, "/set", set, "wrong type",
                                 "an object of values by JSON pointer");
    }
    if (status == BST_OK) {
        status = bst_json_check_set(ctx, base->tables, base->root, set, base->name);
    }
    if (status == BST_OK) {
        status = move_values(ctx, own->root, false, base);
    }
    if (status == BST_OK && set) {
        status = move_values(ctx, set, true, base);
    }
    cJSON_Delete(set);
    return status;
}

static bst_status add_link(bst_ctx *ctx, const char *path, file_chain *chain) {
    char *full = realpath(path, NULL);
    if (!full) {
        return BST_OK; /* the reader of the file reports the error */
    }
    for (int i = 0; i < chain->count; i++) {
        if (strcmp(chain->files[i], full) == 0) {
            free(full);
            return bst_fail(ctx, BST_ERR_CONFIG, "%.400s extends itself by way of %d file%s", path,
                            chain->count - i, chain->count - i == 1 ? "" : "s");
        }
    }
    if (chain->count == MAX_FILES) {
        free(full);
        return bst_fail(ctx, BST_ERR_CONFIG, "more than %d files extend each other", MAX_FILES);
    }
    chain->files[chain->count++] = full;
    return BST_OK;
}

/* Path relative to the folder of another file; NULL: out of memory. */
static char *relative_path(const char *file, const char *given) {
    const char *slash = strrchr(file, '/');
    size_t folder = given[0] == '/' || !slash ? 0 : (size_t)(slash + 1 - file);
    size_t bytes = folder + strlen(given) + 1;
    char *path = malloc(bytes);
    if (path) {
        snprintf(path, bytes, "%.*s%s", (int)folder, file, given);
    }
    return path;
}

/* Reads a file, or the text that stands for it, and the files that it extends. */
static bst_status load(bst_ctx *ctx, const char *path, const char *text,
                       const bst_document_tables *tables, file_chain *chain, bst_json **out) {
    BST_TRY(add_link(ctx, path, chain));
    BST_TRY(text ? bst_json_parse(ctx, path, text, strlen(text), out)
                 : bst_json_load(ctx, path, out));
    bst_json *own = *out;
    bst_status described = tables ? bst_json_describe(ctx, own, tables, true) : BST_OK;
    if (described != BST_OK) {
        bst_json_free(own);
        *out = NULL;
        return described;
    }
    const cJSON *extends = cJSON_GetObjectItemCaseSensitive(own->root, "extends");
    if (!extends) {
        return BST_OK;
    }
    *out = NULL;
    bst_json *base = NULL;
    bst_status status;
    if (!cJSON_IsString(extends) || !extends->valuestring[0]) {
        status = bst_config_fail(ctx, path, "/extends", extends, "wrong type",
                                 "a string, the file that this one changes");
    } else {
        char *file = relative_path(path, extends->valuestring);
        status = file ? load(ctx, file, NULL, tables, chain, &base)
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
        free(file);
        if (status != BST_OK) {
            bst_fail_prefix(ctx, status, "%.400s: /extends", path);
        } else if (!cJSON_IsObject(base->root)) {
            status = bst_config_fail(ctx, path, "/extends", extends, "its value is no object",
                                     "a file whose value is one");
        }
    }
    if (status == BST_OK) {
        status = apply(ctx, own, base);
    }
    bst_json_free(own);
    if (status != BST_OK) {
        bst_json_free(base);
        return status;
    }
    *out = base;
    return BST_OK;
}

bst_status bst_json_load_extended(bst_ctx *ctx, const char *path, bst_json **out) {
    return bst_json_load_described(ctx, path, NULL, out);
}

/* Reads a document from its file or its text. */
static bst_status load_document(bst_ctx *ctx, const char *path, const char *text,
                                const bst_document_tables *tables, bst_json **out) {
    *out = NULL;
    file_chain chain = {.count = 0};
    bst_status status = load(ctx, path, text, tables, &chain, out);
    for (int i = 0; i < chain.count; i++) {
        free(chain.files[i]);
    }
    return status;
}

bst_status bst_json_load_described(bst_ctx *ctx, const char *path,
                                   const bst_document_tables *tables, bst_json **out) {
    return load_document(ctx, path, NULL, tables, out);
}

bst_status bst_json_parse_described(bst_ctx *ctx, const char *name, const char *text,
                                    const bst_document_tables *tables, bst_json **out) {
    return load_document(ctx, name, text, tables, out);
}
