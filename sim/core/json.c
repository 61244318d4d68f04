#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <cjson/cJSON.h>

#include "sim/core/config.h"

enum { MAX_DEPTH = 64 };
static const long long MAX_BYTES = 64LL << 20;

struct bst_json {
    char *name;
    cJSON *root;
};

/* Line and column (from 1) of a byte offset. */
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

/* Offset of the first byte that is not UTF-8 (RFC 3629), or `bytes` when all is well. */
static size_t utf8_error(const char *text, size_t bytes) {
    const unsigned char *p = (const unsigned char *)text;
    size_t i = 0;
    while (i < bytes) {
        unsigned c = p[i];
        size_t length = c < 0x80                ? 1
                        : c >= 0xC2 && c < 0xE0 ? 2
                        : c >= 0xE0 && c < 0xF0 ? 3
                        : c >= 0xF0 && c < 0xF5 ? 4
                                                : 0;
        if (length == 0 || i + length > bytes) {
            return i;
        }
        for (size_t k = 1; k < length; k++) {
            if ((p[i + k] & 0xC0) != 0x80) {
                return i;
            }
        }
        /* overlong forms and surrogates */
        if ((c == 0xE0 && p[i + 1] < 0xA0) || (c == 0xED && p[i + 1] > 0x9F) ||
            (c == 0xF0 && p[i + 1] < 0x90) || (c == 0xF4 && p[i + 1] > 0x8F)) {
            return i;
        }
        i += length;
    }
    return bytes;
}

/* Bytes of the JSON number at text (RFC 8259, section 6), or 0 when it is none. */
static size_t number_length(const char *text, size_t bytes) {
    size_t i = bytes && text[0] == '-' ? 1 : 0;
    size_t start = i;
    while (i < bytes && isdigit((unsigned char)text[i])) {
        i++;
    }
    if (i == start || (text[start] == '0' && i > start + 1)) {
        return 0;
    }
    if (i < bytes && text[i] == '.') {
        start = ++i;
        while (i < bytes && isdigit((unsigned char)text[i])) {
            i++;
        }
        if (i == start) {
            return 0;
        }
    }
    if (i < bytes && (text[i] == 'e' || text[i] == 'E')) {
        i++;
        i += i < bytes && (text[i] == '+' || text[i] == '-');
        start = i;
        while (i < bytes && isdigit((unsigned char)text[i])) {
            i++;
        }
        if (i == start) {
            return 0;
        }
    }
    return i;
}

/* Offset of the first thing that cJSON would let pass and JSON or we do not, or `bytes`; *what says
 * which. */
static size_t lenience_error(const char *text, size_t bytes, const char **what) {
    int depth = 0;
    bool in_string = false;
    for (size_t i = 0; i < bytes; i++) {
        unsigned char c = (unsigned char)text[i];
        if (c < 0x20 && (in_string || !strchr("\t\n\r", c))) {
            *what = in_string ? "a control character within a string (write \\n, \\t or \\u00XX)"
                              : "a control character";
            return i;
        }
        if (in_string) {
            if (c == '\\' && bytes - i >= 6 && memcmp(text + i, "\\u0000", 6) == 0) {
                *what = "\\u0000 within a string is not allowed";
                return i;
            }
            if (c == '\\') {
                i++;
            } else if (c == '"') {
                in_string = false;
            }
        } else if (c == '"') {
            in_string = true;
        } else if (c == '{' || c == '[') {
            if (++depth > MAX_DEPTH) {
                *what = "nested too deep (allowed: 64 levels)";
                return i;
            }
        } else if (c == '}' || c == ']') {
            depth--;
        } else if (c == '-' || isdigit(c)) {
            size_t length = number_length(text + i, bytes - i);
            if (length == 0) {
                *what = "this is not a JSON number";
                return i;
            }
            i += length - 1;
        }
    }
    return bytes;
}

static int compare_keys(const void *a, const void *b) {
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Finds a key that an object has twice; sorting keeps hostile objects of a million keys cheap. */
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

/* Duplicate keys and numbers that are not finite, anywhere in the tree. */
static bst_status check_tree(bst_ctx *ctx, const char *name, const cJSON *node, const char *path) {
    if (cJSON_IsNumber(node) && !isfinite(node->valuedouble)) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "%s: %s: the number is too large to be represented (allowed: |number| < 1.8e308)", name,
            *path ? path : "/");
    }
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
    int line, column;
    if (bytes >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        text += 3;
        bytes -= 3;
    }
    size_t blank = 0;
    while (blank < bytes && isspace((unsigned char)text[blank])) {
        blank++;
    }
    if (blank == bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: the file is empty (a JSON object is expected)",
                        name);
    }
    const char *nul = memchr(text, '\0', bytes);
    size_t bad = utf8_error(text, bytes);
    if (nul && (size_t)(nul - text) < bad) {
        bad = (size_t)(nul - text);
    }
    if (bad < bytes) {
        locate(text, bad, &line, &column);
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d:%d: byte 0x%02X is not UTF-8 text", name, line,
                        column, (unsigned char)text[bad]);
    }
    const char *what = NULL;
    bad = lenience_error(text, bytes, &what);
    if (bad < bytes) {
        locate(text, bad, &line, &column);
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d:%d: %s", name, line, column, what);
    }
    const char *end = NULL;
    cJSON *root = cJSON_ParseWithLengthOpts(text, bytes, &end, 0);
    if (!root) {
        size_t offset = end && end >= text && end <= text + bytes ? (size_t)(end - text) : 0;
        locate(text, offset, &line, &column);
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d:%d: this is not valid JSON", name, line,
                        column);
    }
    size_t offset = (size_t)(end - text);
    while (offset < bytes && isspace((unsigned char)text[offset])) {
        offset++;
    }
    if (offset < bytes) {
        cJSON_Delete(root);
        locate(text, offset, &line, &column);
        return bst_fail(ctx, BST_ERR_FORMAT, "%s:%d:%d: text after the end of the JSON value", name,
                        line, column);
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
    struct stat info;
    if (stat(path, &info) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be opened: %s", path, strerror(errno));
    }
    /* before opening, which would wait on a pipe */
    if (!S_ISREG(info.st_mode)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: not a file%s", path,
                        S_ISDIR(info.st_mode) ? " but a folder" : "");
    }
    if (info.st_size > MAX_BYTES) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s: %lld bytes are too many for a scenario (allowed: %lld)", path,
                        (long long)info.st_size, MAX_BYTES);
    }
    FILE *file = fopen(path, "rb");
    if (!file) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be opened: %s", path, strerror(errno));
    }
    size_t bytes = (size_t)info.st_size;
    char *text = malloc(bytes + 1);
    if (!text) {
        fclose(file);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    size_t got = fread(text, 1, bytes, file);
    bool failed = ferror(file) != 0;
    fclose(file);
    bst_status status =
        failed ? bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", path, strerror(errno))
               : bst_json_parse(ctx, path, text, got, out);
    free(text);
    return status;
}

void bst_json_free(bst_json *json) {
    if (json) {
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

/* The child that one segment of a JSON pointer names; NULL when there is none. */
static cJSON *child_of(cJSON *node, const char *segment) {
    if (cJSON_IsArray(node)) {
        size_t digits = strspn(segment, "0123456789");
        bool is_index = digits > 0 && digits < 10 && !segment[digits];
        return is_index ? cJSON_GetArrayItem(node, (int)strtol(segment, NULL, 10)) : NULL;
    }
    return cJSON_GetObjectItemCaseSensitive(node, segment);
}

bst_status bst_json_check_assignment(bst_ctx *ctx, const char *assignment) {
    const char *equals = strchr(assignment, '=');
    if (assignment[0] != '/' || !equals ||
        (size_t)(equals - assignment) == strspn(assignment, "/")) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--set %s: expected /json/path=value, for example --set /duration_s=60",
                        assignment);
    }
    return BST_OK;
}

bst_status bst_json_set(bst_ctx *ctx, bst_json *json, const char *assignment) {
    BST_TRY(bst_json_check_assignment(ctx, assignment));
    const char *equals = strchr(assignment, '=');
    /* a value that is no JSON is a bare word, taken as a string */
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
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--set %s: the value is neither JSON nor a plain word", assignment);
    }
    size_t length = (size_t)(equals - assignment);
    char *path = strndup(assignment, length);
    if (!path || !value) {
        cJSON_Delete(value);
        free(path);
        return bst_fail(ctx, BST_ERR_MEMORY, "--set %s: out of memory", assignment);
    }
    cJSON *node = json->root;
    bst_status status = BST_OK;
    char *save = NULL;
    char *segment = strtok_r(path, "/", &save);
    for (int depth = 1; segment && status == BST_OK; depth++) {
        if (depth > MAX_DEPTH) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT, "--set %.80s: nested too deep", assignment);
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
                status =
                    bst_fail(ctx, BST_ERR_ARGUMENT, "--set %s: there is no element \"%s\" to set",
                             assignment, segment);
                break;
            }
            value = NULL;
        } else if (!child && cJSON_IsObject(node)) {
            child = cJSON_AddObjectToObject(node, segment);
        }
        if (next && !child) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT, "--set %s: there is no element \"%s\"",
                              assignment, segment);
        }
        node = child;
        segment = next;
    }
    cJSON_Delete(value);
    free(path);
    return status;
}
