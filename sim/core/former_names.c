#include "sim/core/former_names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/json_internal.h"

/* Tables of one place: those of all types of a module where the type is not known. */
enum { MAX_TABLES = 32 };

/* The tables that describe an object, or the elements of a list. */
typedef struct place {
    const bst_config_desc *tables[MAX_TABLES];
    int count;
    const char *raw; /* a RAW value whose members have tables; else NULL */
    bool list;
} place;

typedef struct renamer {
    bst_ctx *ctx;
    const bst_document_tables *tables;
    const bst_json *json; /* names the file of each warning; NULL: `where` does */
    const char *where;    /* NULL and no json: no warnings */
} renamer;

static void add_table(place *at, const bst_config_desc *table) {
    for (int i = 0; i < at->count; i++) {
        if (at->tables[i] == table) {
            return;
        }
    }
    if (at->count < MAX_TABLES) {
        at->tables[at->count++] = table;
    }
}

static void add_inside(const bst_document_tables *t, const char *raw, const char *key,
                       const cJSON *node, place *out) {
    const bst_config_desc *table;
    for (int i = 0; t->inside && (table = t->inside(t->user, raw, key, node, i)) != NULL; i++) {
        add_table(out, table);
    }
}

/* The place of the value `node` (NULL: not known) of a key, or of a list's element. */
static void enter(const bst_document_tables *t, const place *at, const char *key, const cJSON *node,
                  place *out) {
    *out = (place){.count = 0};
    if (at->list) {
        *out = *at;
        out->list = false;
    } else if (at->raw) {
        add_inside(t, at->raw, key, node, out);
    }
    for (int i = 0; i < at->count && !at->list; i++) {
        for (const bst_config_desc *d = at->tables[i]; d->key; d++) {
            if (strcmp(d->key, key) != 0) {
                continue;
            }
            if (d->type == BST_CONFIG_OBJECT || d->type == BST_CONFIG_LIST) {
                add_table(out, d->children);
                out->list = d->type == BST_CONFIG_LIST;
            } else if (d->type == BST_CONFIG_RAW) {
                add_inside(t, d->key, NULL, node, out);
                out->raw = out->count ? NULL : d->key;
            }
        }
    }
    if (cJSON_IsString(cJSON_GetObjectItemCaseSensitive(node, "plugin"))) {
        *out = (place){.count = 0};
    }
}

/* The present name of a key; the key itself where it is no former name. */
static const char *present_name(const place *at, const char *key) {
    const char *name = key;
    for (int i = 0; i < at->count && !at->list; i++) {
        for (const bst_config_desc *d = at->tables[i]; d->key; d++) {
            if (strcmp(d->key, key) != 0) {
                continue;
            }
            if (d->type != BST_CONFIG_FORMER) {
                return key;
            }
            name = d->fallback;
        }
    }
    return name;
}

static void warn(const renamer *r, const char *path, const char *name) {
    const char *where = r->json ? bst_json_file(r->json, path) : r->where;
    if (where) {
        bst_log(r->ctx, BST_LOG_WARNING, "%s: %s: former name, now %s", where, path, name);
    }
}

static bst_status given_twice(const renamer *r, const char *path, const char *name) {
    return bst_fail(r->ctx, BST_ERR_CONFIG,
                    "%s: %s: former name of %s, which is given too (allowed: %s alone)",
                    r->json    ? r->json->name
                    : r->where ? r->where
                               : "document",
                    path, name, name);
}

static bst_status rename_key(const renamer *r, const cJSON *node, cJSON *item, const char *path,
                             const char *name) {
    if (cJSON_GetObjectItemCaseSensitive(node, name)) {
        return given_twice(r, path, name);
    }
    char *copy = strdup(name);
    if (!copy) {
        return bst_fail(r->ctx, BST_ERR_MEMORY, "out of memory");
    }
    warn(r, path, name);
    cJSON_free(item->string);
    item->string = copy;
    return BST_OK;
}

/* `path`: with the names that the document gives, for messages. */
static bst_status rename_inside(const renamer *r, const place *at, cJSON *node, const char *path) {
    bool object = cJSON_IsObject(node);
    if ((!at->count && !at->raw) || !(object ? !at->list : cJSON_IsArray(node) && at->list)) {
        return BST_OK;
    }
    int index = 0;
    for (cJSON *item = node->child; item; item = item->next, index++) {
        char child_path[512];
        if (object) {
            snprintf(child_path, sizeof child_path, "%s/%s", path, item->string);
            const char *name = present_name(at, item->string);
            if (name != item->string) {
                BST_TRY(rename_key(r, node, item, child_path, name));
            }
        } else {
            snprintf(child_path, sizeof child_path, "%s/%d", path, index);
        }
        place child;
        enter(r->tables, at, item->string, item, &child);
        BST_TRY(rename_inside(r, &child, item, child_path));
    }
    return BST_OK;
}

bst_status bst_json_describe(bst_ctx *ctx, bst_json *json, const bst_document_tables *tables,
                             bool warn_each) {
    const renamer r = {ctx, tables, warn_each ? json : NULL, NULL};
    const place root = {.tables = {tables->root}, .count = 1};
    BST_TRY(rename_inside(&r, &root, json->root, ""));
    json->tables = tables;
    return BST_OK;
}

bool bst_json_is_described(const bst_json *json) {
    return json->tables != NULL;
}

static const cJSON *child_of(const cJSON *node, const char *segment) {
    return cJSON_IsArray(node) ? cJSON_GetArrayItem(node, (int)strtol(segment, NULL, 10))
                               : cJSON_GetObjectItemCaseSensitive(node, segment);
}

/* Writes the pointer `path`, which is cut into its parts, in present names to `out`; `path_bytes`:
 * room of both. True if a name differs. */
static bool present_parts(const renamer *r, const cJSON *node, char *parts, size_t bytes,
                          char *given, char *out, place *at) {
    char *save = NULL;
    size_t used = 0, read = 0;
    bool renamed = false;
    *given = *out = '\0';
    for (char *part = strtok_r(parts, "/", &save); part; part = strtok_r(NULL, "/", &save)) {
        const char *name = present_name(at, part);
        read += (size_t)snprintf(given + read, bytes - read, "/%s", part);
        used += (size_t)snprintf(out + used, bytes - used, "/%s", name);
        if (name != part) {
            warn(r, given, name);
            renamed = true;
        }
        place child;
        node = child_of(node, name);
        enter(r->tables, at, name, node, &child);
        *at = child;
    }
    return renamed;
}

bst_status bst_json_present_pointer(bst_ctx *ctx, const bst_document_tables *tables,
                                    const cJSON *root, const char *pointer, cJSON *value,
                                    const char *where, char **out) {
    size_t bytes = strlen(pointer) + 2 + BST_CONFIG_KEY_BYTES;
    for (const char *p = pointer; *p; p++) {
        bytes += *p == '/' ? BST_CONFIG_KEY_BYTES : 0;
    }
    char *parts = strdup(pointer), *given = malloc(bytes);
    *out = malloc(bytes);
    bst_status status = BST_OK;
    if (!parts || !given || !*out) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    } else if (!tables) {
        snprintf(*out, bytes, "%s", pointer);
    } else {
        const renamer r = {ctx, tables, NULL, where};
        place at = {.tables = {tables->root}, .count = 1};
        if (!present_parts(&r, root, parts, bytes, given, *out, &at)) {
            snprintf(*out, bytes, "%s", pointer); /* as it is, also where it is no pointer */
        }
        if (cJSON_IsString(cJSON_GetObjectItemCaseSensitive(value, "plugin"))) {
            at = (place){.count = 0};
        }
        status = value ? rename_inside(&r, &at, value, given) : BST_OK;
    }
    free(parts);
    free(given);
    if (status != BST_OK) {
        free(*out);
        *out = NULL;
    }
    return status;
}

bst_status bst_json_check_set(bst_ctx *ctx, const bst_document_tables *tables, const cJSON *root,
                              const cJSON *set, const char *file) {
    for (const cJSON *item = set ? set->child : NULL; item; item = item->next) {
        char *present;
        BST_TRY(bst_json_present_pointer(ctx, tables, root, item->string, NULL, NULL, &present));
        bool twice = strcmp(present, item->string) != 0 &&
                     cJSON_GetObjectItemCaseSensitive(set, present) != NULL;
        free(present);
        if (twice) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "%s: /set: %.200s is given under its present name too (allowed: one "
                            "of the two)",
                            file, item->string);
        }
    }
    return BST_OK;
}
