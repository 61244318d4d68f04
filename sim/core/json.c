#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/config.h"
#include "sim/core/file.h"
#include "sim/core/former_names.h"
#include "sim/core/json_internal.h"

static const uint64_t MAX_BYTES = 64 << 20;

/* Line and column (from 1) of a byte offset in the text. */
static void locate(const char *text, size_t offset, int *line, int *column) {
    *line = 1;
    *column = 1;
    for (size_t i = 0; i < offset; i++) {
        if (text[i] == '\n') {
            (*line)++;
            *column = 1;
        } else {
            (*column)++;
        }
    }
}

static int compare_keys(const void *a, const void *b) {
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Finds duplicate keys of an object; sorting keeps malicious objects with a million keys fast. */
static bst_status find_duplicate(bst_ctx *ctx, const cJSON *object, const char **key) {
    *key = NULL;
    int count = cJSON_GetArraySize(object);
    if (count < 2) {
        return BST_OK;
    }
    const char **keys = malloc((size_t)count * sizeof *keys);
    if (!keys) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    int n = 0;
    for (const cJSON *child = object->child; child; child = child->next) {
        assert(n < count);
        keys[n++] = child->string;
    }
    qsort(keys, (size_t)n, sizeof *keys, compare_keys);
    for (int i = 1; i < n && !*key; i++) {
        if (strcmp(keys[i - 1], keys[i]) == 0) {
            *key = keys[i];
        }
    }
    free(keys);
    return BST_OK;
}

static bool has_control_character(const char *text) {
    for (; *text; text++) {
        if ((unsigned char)*text < 0x20) {
            return true;
        }
    }
    return false;
}

/* Checks the whole tree for duplicate keys and keys with control characters. */
static bst_status check_tree(bst_ctx *ctx, const char *name, const cJSON *node, const char *path) {
    if (cJSON_IsObject(node)) {
        const char *twice;
        BST_TRY(find_duplicate(ctx, node, &twice));
        if (twice) {
            return bst_fail(ctx, BST_ERR_CONFIG, "%s: %s/%s: the key is given twice", name, path,
                            twice);
        }
    }
    int index = 0;
    for (const cJSON *child = node->child; child; child = child->next, index++) {
        char child_path[512];
        if (cJSON_IsObject(node)) {
            if (has_control_character(child->string)) {
                return bst_fail(ctx, BST_ERR_CONFIG,
                                "%s: %s: element %d has a control character in its key", name,
                                *path ? path : "/", index);
            }
            snprintf(child_path, sizeof child_path, "%s/%s", path, child->string);
        } else {
            snprintf(child_path, sizeof child_path, "%s/%d", path, index);
        }
        BST_TRY(check_tree(ctx, name, child, child_path));
    }
    return BST_OK;
}

bst_status bst_json_parse(bst_ctx *ctx, const char *name, const char *text, size_t bytes,
                          bst_json **out) {
    *out = NULL;
    if (bytes >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        text += 3;
        bytes -= 3;
    }
    bst_json_fault fault;
    if (bytes >= 2 && (memcmp(text, "\xFF\xFE", 2) == 0 || memcmp(text, "\xFE\xFF", 2) == 0)) {
        return bst_file_check_text(ctx, name, text, bytes);
    }
    if (!bst_json_check(text, bytes, &fault)) {
        int line, column;
        locate(text, fault.offset, &line, &column);
        return bst_fail(ctx, BST_ERR_FORMAT, "%.400s:%d:%d: %s", name, line, column, fault.what);
    }
    cJSON *root = cJSON_ParseWithLength(text, bytes);
    if (!root) {
        return bst_fail(ctx, BST_ERR_MEMORY, "%.400s: out of memory", name);
    }
    bst_status status = check_tree(ctx, name, root, "");
    if (status != BST_OK) {
        cJSON_Delete(root);
        return status;
    }
    bst_json *json = calloc(1, sizeof *json);
    char *copy = json ? strdup(name) : NULL;
    if (!copy) {
        free(json);
        cJSON_Delete(root);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", name);
    }
    json->name = copy;
    json->root = root;
    *out = json;
    return BST_OK;
}

bst_status bst_json_load(bst_ctx *ctx, const char *path, bst_json **out) {
    *out = NULL;
    char *text;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MAX_BYTES, "a JSON file", &text, &bytes));
    bst_status status = bst_json_parse(ctx, path, text, bytes, out);
    free(text);
    return status;
}

void bst_json_free(bst_json *json) {
    if (json) {
        for (int i = 0; i < json->origin_count; i++) {
            free(json->origins[i].pointer);
            free(json->origins[i].file);
        }
        free(json->origins);
        cJSON_Delete(json->root);
        free(json->name);
        free(json);
    }
}

cJSON *bst_json_root(const bst_json *json) {
    return json->root;
}
const char *bst_json_name(const bst_json *json) {
    return json->name;
}

/* Child for one segment of a JSON pointer; NULL: none. */
static cJSON *child_of(cJSON *node, const char *segment) {
    if (cJSON_IsArray(node)) {
        size_t digits = strspn(segment, "0123456789");
        bool is_index = digits > 0 && digits < 10 && !segment[digits] &&
                        (segment[0] != '0' || digits == 1); /* as RFC 6901, section 4 */
        return is_index ? cJSON_GetArrayItem(node, (int)strtol(segment, NULL, 10)) : NULL;
    }
    return cJSON_GetObjectItemCaseSensitive(node, segment);
}

/* Error: an array element of a pointer does not exist. */
static bst_status no_child(bst_ctx *ctx, const cJSON *node, const char *segment) {
    int count = cJSON_GetArraySize(node);
    if (cJSON_IsArray(node) && count > 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "there is no element \"%.80s\" (allowed: 0 to %d)",
                        segment, count - 1);
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT, "there is no element \"%.80s\" in %s", segment,
                    cJSON_IsArray(node) ? "an empty array" : "what is no object and no array");
}

bool bst_json_is_pointer(const char *text, size_t length) {
    bool good = length > 0 && text[0] == '/' && text[length - 1] != '/';
    for (size_t i = 1; i < length && good; i++) {
        good = text[i - 1] != '/' || text[i] != '/';
    }
    return good;
}

bst_status bst_json_check_assignment(bst_ctx *ctx, const char *assignment) {
    const char *equals = strchr(assignment, '=');
    if (!equals || !bst_json_is_pointer(assignment, (size_t)(equals - assignment))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--set %s: expected /json/path=value, for example --set /duration_s=60",
                        assignment);
    }
    return BST_OK;
}

/* Takes the value in any case. */
static bst_status assign(bst_ctx *ctx, bst_json *json, const char *pointer, cJSON *value) {
    char *path = strdup(pointer);
    if (!path) {
        cJSON_Delete(value);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    cJSON *node = json->root;
    bst_status status = BST_OK;
    char *save = NULL;
    char *segment = strtok_r(path, "/", &save);
    for (int depth = 1; segment && status == BST_OK; depth++) {
        if (depth > BST_JSON_MAX_DEPTH) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT, "nested too deep");
            break;
        }
        char *next = strtok_r(NULL, "/", &save);
        cJSON *child = child_of(node, segment);
        if (!next) {
            if (cJSON_IsArray(node) && child) {
                cJSON_ReplaceItemInArray(node, (int)strtol(segment, NULL, 10), value);
            } else if (cJSON_IsObject(node) && child) {
                cJSON_ReplaceItemInObjectCaseSensitive(node, segment, value);
            } else if (cJSON_IsObject(node)) {
                cJSON_AddItemToObject(node, segment, value);
            } else {
                status = no_child(ctx, node, segment);
                break;
            }
            value = NULL;
        } else if (!child && cJSON_IsObject(node)) {
            child = cJSON_AddObjectToObject(node, segment);
        }
        if (next && !child) {
            status = no_child(ctx, node, segment);
        }
        node = child;
        segment = next;
    }
    cJSON_Delete(value);
    free(path);
    if (status == BST_OK && json->origins) {
        status = bst_json_note_origin(ctx, json, pointer, json->name);
    }
    return status;
}

bst_status bst_json_assign_from(bst_ctx *ctx, bst_json *json, const char *pointer, cJSON *value,
                                const char *where) {
    char *present = NULL;
    bst_status status = value ? bst_json_present_pointer(ctx, json->tables, json->root, pointer,
                                                         value, where, &present)
                              : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    if (status == BST_OK) {
        status = assign(ctx, json, present, value);
    } else {
        cJSON_Delete(value);
    }
    free(present);
    return status;
}

bst_status bst_json_assign(bst_ctx *ctx, bst_json *json, const char *pointer, cJSON *value) {
    return bst_json_assign_from(ctx, json, pointer, value, json->is_copy ? NULL : json->name);
}

bst_status bst_json_set(bst_ctx *ctx, bst_json *json, const char *assignment) {
    BST_TRY(bst_json_check_assignment(ctx, assignment));
    const char *equals = strchr(assignment, '=');
    /* a value that is no JSON is a bare word: a string */
    cJSON *value = NULL;
    bst_json *parsed = NULL;
    bst_ctx scratch = {0};
    if (bst_json_parse(&scratch, "value", equals + 1, strlen(equals + 1), &parsed) == BST_OK) {
        value = parsed->root;
        parsed->root = NULL;
        bst_json_free(parsed);
    } else if (equals[1] && !strpbrk(equals + 1, "{}[]\"")) {
        value = cJSON_CreateString(equals + 1);
    } else {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--set %.300s: %s%s", assignment,
                        equals[1] ? "the value is neither a plain word nor JSON: " : "",
                        equals[1] ? scratch.message : "the value is missing");
    }
    char *pointer = strndup(assignment, (size_t)(equals - assignment));
    bst_status status = BST_ERR_MEMORY;
    if (pointer) {
        char where[BST_MESSAGE_BYTES];
        snprintf(where, sizeof where, "--set %.300s", assignment);
        status = bst_json_assign_from(ctx, json, pointer, value, where);
    } else {
        cJSON_Delete(value);
        bst_fail(ctx, status, "out of memory");
    }
    free(pointer);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "--set %.300s", assignment);
}
