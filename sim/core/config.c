#include "boresight/config.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/stage.h"
#include "sim/core/text.h"

/* 2^53; the text 2^53 + 1 is read as the same number */
static const double END_OF_EXACT_INTEGERS = 9007199254740992.0;

typedef struct reader {
    bst_ctx *ctx;
    const char *file;
    const bst_json *json;
    const bst_stage_loader *loader; /* NULL: no plug-ins */
} reader;

static bst_status read_object(const reader *r, const cJSON *node, const char *path,
                              const bst_config_desc *table, void *object);

static bst_status wrong(const reader *r, const char *path, const cJSON *value, const char *what,
                        const char *allowed) {
    return bst_config_fail(r->ctx, r->file, path, value, what, allowed);
}

bool bst_config_is_open(const bst_config_desc *desc) {
    return desc->type == BST_CONFIG_REAL && desc->fallback &&
           strcmp(desc->fallback, BST_CONFIG_OPEN) == 0;
}

static void range_text(const bst_config_desc *d, char *buffer, size_t bytes) {
    const char *unit = d->unit && *d->unit ? d->unit : "";
    if (d->type == BST_CONFIG_INT && d->minimum == d->maximum) {
        snprintf(buffer, bytes, "%.0f", d->minimum);
    } else if (d->type == BST_CONFIG_INT) {
        snprintf(buffer, bytes, "an integer from %.0f to %.0f%s%s", d->minimum, d->maximum,
                 *unit ? " " : "", unit);
    } else {
        snprintf(buffer, bytes, "a number from %.15g to %.15g%s%s%s", d->minimum, d->maximum,
                 *unit ? " " : "", unit, bst_config_is_open(d) ? ", or null" : "");
    }
}

static bst_status unknown_key(const reader *r, const char *path, const char *key,
                              const bst_config_desc *table) {
    const char *nearest = NULL;
    size_t best = SIZE_MAX;
    char known[400] = "";
    for (const bst_config_desc *d = table; d->key; d++) {
        if (bst_text_is_nearer(key, d->key, &best)) {
            nearest = d->type == BST_CONFIG_FORMER ? d->fallback : d->key;
        }
        if (d->type == BST_CONFIG_FORMER) {
            continue;
        }
        size_t used = strlen(known);
        snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "", d->key);
    }
    if (nearest) {
        return bst_fail(r->ctx, BST_ERR_CONFIG, "%s: %s/%s: unknown key; did you mean \"%s\"?",
                        r->file, path, key, nearest);
    }
    return bst_fail(r->ctx, BST_ERR_CONFIG, "%s: %s/%s: unknown key (allowed: %s)", r->file, path,
                    key, known);
}

static bst_status read_number(const reader *r, const cJSON *value, const char *path,
                              const bst_config_desc *d, double *out) {
    char allowed[160];
    range_text(d, allowed, sizeof allowed);
    if (!cJSON_IsNumber(value)) {
        return wrong(r, path, value, "wrong type", allowed);
    }
    double number = value->valuedouble;
    bool is_int = d->type == BST_CONFIG_INT;
    if (is_int && number != floor(number)) {
        return wrong(r, path, value, "not an integer", allowed);
    }
    if (!(number >= d->minimum && number <= d->maximum) ||
        (is_int && fabs(number) >= END_OF_EXACT_INTEGERS)) {
        return wrong(r, path, value, "out of range", allowed);
    }
    *out = number;
    return BST_OK;
}

static bst_status read_list(const reader *r, const cJSON *value, const char *path,
                            const bst_config_desc *d, bst_config_list *out) {
    char allowed[120];
    snprintf(allowed, sizeof allowed, "an array of %.0f to %.0f objects", d->minimum, d->maximum);
    if (!cJSON_IsArray(value)) {
        return wrong(r, path, value, "wrong type", allowed);
    }
    int count = cJSON_GetArraySize(value);
    if (count < d->minimum || count > d->maximum) {
        char found[48];
        snprintf(found, sizeof found, "an array of %d", count);
        return bst_fail(r->ctx, BST_ERR_CONFIG,
                        "%s: %s: wrong number of elements (found %s; allowed: %s)", r->file, path,
                        found, allowed);
    }
    if (count == 0) {
        *out = (bst_config_list){NULL, 0};
        return BST_OK;
    }
    char *items = calloc((size_t)count, d->item_bytes);
    if (!items) {
        return bst_fail(r->ctx, BST_ERR_MEMORY, "%s: %s: out of memory", r->file, path);
    }
    /* stored at once, so that bst_config_free frees it after an error */
    *out = (bst_config_list){items, 0};
    for (const cJSON *item = value->child; item; item = item->next) {
        char item_path[512];
        snprintf(item_path, sizeof item_path, "%s/%d", path, out->count);
        out->count++;
        BST_TRY(read_object(r, item, item_path, d->children,
                            items + (size_t)(out->count - 1) * d->item_bytes));
    }
    return BST_OK;
}

static bst_status read_seed(const reader *r, const cJSON *value, const char *path, uint64_t *out) {
    const char *allowed =
        "a hexadecimal string such as \"0x1F\" or a decimal one such as \"31\", up to 64 bits, or "
        "an integer from 0 to 9007199254740991";
    /* 2^53 as a number may have been 2^53 + 1 in the text */
    if (cJSON_IsNumber(value) && value->valuedouble >= 0.0 &&
        value->valuedouble < END_OF_EXACT_INTEGERS &&
        value->valuedouble == floor(value->valuedouble)) {
        *out = (uint64_t)value->valuedouble;
        return BST_OK;
    }
    if (!cJSON_IsString(value)) {
        bool whole = cJSON_IsNumber(value) && value->valuedouble == floor(value->valuedouble);
        return wrong(r, path, value,
                     whole                   ? "out of range"
                     : cJSON_IsNumber(value) ? "not an integer"
                                             : "wrong type",
                     allowed);
    }
    const char *text = value->valuestring;
    bool hexadecimal = strncmp(text, "0x", 2) == 0;
    const char *digits = hexadecimal ? text + 2 : text;
    size_t count = strspn(digits, hexadecimal ? "0123456789abcdefABCDEF" : "0123456789");
    errno = 0;
    uint64_t seed = strtoull(digits, NULL, hexadecimal ? 16 : 10);
    if (count == 0 || count > (hexadecimal ? 16 : 20) || digits[count] || errno == ERANGE) {
        return wrong(r, path, value, "not a seed", allowed);
    }
    *out = seed;
    return BST_OK;
}

static bst_status read_enum(const reader *r, const cJSON *value, const char *path,
                            const bst_config_desc *d, int32_t *out) {
    char allowed[320] = "";
    for (int i = 0; d->choices[i]; i++) {
        if (cJSON_IsString(value) && strcmp(value->valuestring, d->choices[i]) == 0) {
            *out = i;
            return BST_OK;
        }
        size_t used = strlen(allowed);
        snprintf(allowed + used, sizeof allowed - used, "%s\"%s\"", used ? ", " : "",
                 d->choices[i]);
    }
    return wrong(r, path, value, cJSON_IsString(value) ? "unknown choice" : "wrong type", allowed);
}

static bst_status read_choices(const reader *r, const cJSON *value, const char *path,
                               const bst_config_desc *d, uint32_t *out) {
    *out = 0;
    if (!cJSON_IsArray(value)) {
        return wrong(r, path, value, "wrong type", "an array of names");
    }
    int i = 0;
    for (const cJSON *item = value->child; item; item = item->next, i++) {
        char item_path[512];
        int32_t bit;
        snprintf(item_path, sizeof item_path, "%s/%d", path, i);
        BST_TRY(read_enum(r, item, item_path, d, &bit));
        if (*out & UINT32_C(1) << bit) {
            return wrong(r, item_path, item, "given twice", "each name once");
        }
        *out |= UINT32_C(1) << bit;
    }
    return BST_OK;
}

static bst_status read_value(const reader *r, const cJSON *value, const char *path,
                             const bst_config_desc *d, void *object) {
    char *member = (char *)object + d->offset;
    double number;
    char text[120];
    switch (d->type) {
        case BST_CONFIG_BOOL:
            if (!cJSON_IsBool(value)) {
                return wrong(r, path, value, "wrong type", "true or false");
            }
            *(bool *)(void *)member = cJSON_IsTrue(value);
            return BST_OK;
        case BST_CONFIG_INT:
            BST_TRY(read_number(r, value, path, d, &number));
            *(int64_t *)(void *)member = (int64_t)number;
            return BST_OK;
        case BST_CONFIG_REAL:
            if (cJSON_IsNull(value) && bst_config_is_open(d)) {
                *(double *)(void *)member = NAN;
                return BST_OK;
            }
            BST_TRY(read_number(r, value, path, d, &number));
            *(double *)(void *)member = number;
            return BST_OK;
        case BST_CONFIG_STRING:
        case BST_CONFIG_PATH:
            snprintf(text, sizeof text, "a string of at most %zu bytes", d->size - 1);
            if (!cJSON_IsString(value)) {
                return wrong(r, path, value, "wrong type", text);
            }
            if (strlen(value->valuestring) >= d->size) {
                return wrong(r, path, value, "too long", text);
            }
            memcpy(member, value->valuestring, strlen(value->valuestring) + 1);
            return BST_OK;
        case BST_CONFIG_ENUM:
            return read_enum(r, value, path, d, (int32_t *)(void *)member);
        case BST_CONFIG_CHOICES:
            return read_choices(r, value, path, d, (uint32_t *)(void *)member);
        case BST_CONFIG_SEED:
            return read_seed(r, value, path, (uint64_t *)(void *)member);
        case BST_CONFIG_REALS: {
            int count = (int)(d->size / sizeof(double));
            snprintf(text, sizeof text, "an array of %d numbers", count);
            if (!cJSON_IsArray(value) || cJSON_GetArraySize(value) != count) {
                return wrong(r, path, value, "wrong type", text);
            }
            int i = 0;
            for (const cJSON *item = value->child; item; item = item->next, i++) {
                char item_path[512];
                snprintf(item_path, sizeof item_path, "%s/%d", path, i);
                BST_TRY(read_number(r, item, item_path, d, (double *)(void *)member + i));
            }
            return BST_OK;
        }
        case BST_CONFIG_OBJECT:
            return read_object(r, value, path, d->children, member);
        case BST_CONFIG_LIST:
            return read_list(r, value, path, d, (bst_config_list *)(void *)member);
        case BST_CONFIG_RAW:
        case BST_CONFIG_STAGE:
        case BST_CONFIG_FORMER:
            return BST_OK;
    }
    return bst_fail(r->ctx, BST_ERR_ARGUMENT, "%s: descriptor of unknown type %d", path,
                    (int)d->type);
}

static const bst_config_desc *find(const bst_config_desc *table, const char *key) {
    for (const bst_config_desc *d = table; d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            return d;
        }
    }
    return NULL;
}

static bool is_optional(const bst_config_desc *d) {
    return d->type == BST_CONFIG_RAW || d->type == BST_CONFIG_STAGE;
}

/* Finds the table entry for a plug-in; NULL: none. */
static const bst_config_desc *stage_of(const bst_config_desc *table) {
    for (const bst_config_desc *d = table; d->key; d++) {
        if (d->type == BST_CONFIG_STAGE) {
            return d;
        }
    }
    return NULL;
}

/* Reads an object that names a plug-in: its other keys belong to the plug-in. */
static bst_status read_stage(const reader *r, const cJSON *node, const char *path,
                             const bst_config_desc *d, bst_stage_use *use) {
    char where[512];
    const cJSON *plugin = cJSON_GetObjectItemCaseSensitive(node, d->key);
    const cJSON *type = cJSON_GetObjectItemCaseSensitive(node, "type");
    snprintf(where, sizeof where, "%s/%s", path, d->key);
    if (!cJSON_IsString(plugin) || !*plugin->valuestring) {
        return wrong(r, where, plugin, "wrong type", "the path of a shared library");
    }
    if (!r->loader) {
        return wrong(r, where, plugin, "no plug-in is loaded here", "one in a scenario's modules");
    }
    if (type && !cJSON_IsString(type)) {
        snprintf(where, sizeof where, "%s/type", path);
        return wrong(r, where, type, "wrong type", "a string");
    }
    const bst_stage_desc *desc;
    BST_TRY(r->loader->load(r->loader->user, r->ctx, r->json, where, plugin->valuestring,
                            d->choices[0], type ? type->valuestring : NULL, &desc, use->plugin,
                            sizeof use->plugin));
    if (!desc) {
        return BST_OK;
    }
    static const bst_config_desc none[] = {BST_CONFIG_END};
    cJSON *own = cJSON_Duplicate(node, 1);
    use->config = calloc(1, desc->config_bytes + 1);
    if (!own || !use->config) {
        cJSON_Delete(own);
        return bst_fail(r->ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    use->desc = desc;
    cJSON_DeleteItemFromObjectCaseSensitive(own, d->key);
    cJSON_DeleteItemFromObjectCaseSensitive(own, "type");
    bst_status status = read_object(r, own, path, desc->config ? desc->config : none, use->config);
    cJSON_Delete(own);
    return status;
}

/* The present name of an entry's key. */
static const char *present_name(const bst_config_desc *d) {
    return d->type == BST_CONFIG_FORMER ? d->fallback : d->key;
}

/* Warns about a key that is given under a former name, and refuses it beside another name. */
static bst_status check_former(const reader *r, const cJSON *node, const char *path,
                               const bst_config_desc *table, const bst_config_desc *former) {
    for (const bst_config_desc *d = table; d->key; d++) {
        if (d != former && strcmp(present_name(d), former->fallback) == 0 &&
            cJSON_GetObjectItemCaseSensitive(node, d->key)) {
            return bst_fail(r->ctx, BST_ERR_CONFIG,
                            "%s: %s/%s: former name of %s, which is given too (allowed: %s alone)",
                            r->file, path, former->key, former->fallback, former->fallback);
        }
    }
    char where[512];
    snprintf(where, sizeof where, "%s/%s", path, former->key);
    bst_log(r->ctx, BST_LOG_WARNING, "%s: %s: former name, now %s", bst_json_file(r->json, where),
            where, former->fallback);
    return BST_OK;
}

/* The value of a key under its present or a former name, *name; NULL: not given. */
static const cJSON *find_value(const cJSON *node, const bst_config_desc *table,
                               const bst_config_desc *key, const char **name) {
    *name = key->key;
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(node, key->key);
    for (const bst_config_desc *d = table; d->key && !value; d++) {
        if (d->type == BST_CONFIG_FORMER && strcmp(d->fallback, key->key) == 0 &&
            (value = cJSON_GetObjectItemCaseSensitive(node, d->key)) != NULL) {
            *name = d->key;
        }
    }
    return value;
}

static bst_status read_object(const reader *r, const cJSON *node, const char *path,
                              const bst_config_desc *table, void *object) {
    if (node && !cJSON_IsObject(node)) {
        return wrong(r, path, node, "wrong type", "an object");
    }
    const bst_config_desc *stage = stage_of(table);
    if (stage && node && cJSON_GetObjectItemCaseSensitive(node, stage->key)) {
        BST_TRY(read_stage(r, node, path, stage,
                           (bst_stage_use *)(void *)((char *)object + stage->offset)));
        node = NULL; /* the other members keep their defaults */
    }
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next) {
        const bst_config_desc *d = find(table, item->string);
        if (!d && strcmp(item->string, "$schema") != 0 &&
            strcmp(item->string, "description") != 0) {
            return unknown_key(r, path, item->string, table);
        }
        if (d && d->type == BST_CONFIG_FORMER) {
            BST_TRY(check_former(r, node, path, table, d));
        }
    }
    for (const bst_config_desc *d = table; d->key; d++) {
        if (d->type == BST_CONFIG_FORMER) {
            continue;
        }
        const char *name;
        char child_path[512];
        const cJSON *value = find_value(node, table, d, &name);
        snprintf(child_path, sizeof child_path, "%s/%s", path, name);
        if (value) {
            BST_TRY(read_value(r, value, child_path, d, object));
        } else if (d->fallback) {
            cJSON *fallback = cJSON_Parse(d->fallback);
            if (!fallback) {
                return bst_fail(r->ctx, BST_ERR_ARGUMENT, "descriptor of %s: default %s is no JSON",
                                child_path, d->fallback);
            }
            bst_status status = read_value(r, fallback, child_path, d, object);
            cJSON_Delete(fallback);
            BST_TRY(status);
        } else if (!is_optional(d)) {
            return bst_fail(r->ctx, BST_ERR_CONFIG, "%s: %s: missing; it is required: %s", r->file,
                            child_path, d->doc);
        }
    }
    return BST_OK;
}

static size_t table_bytes(const bst_config_desc *table) {
    size_t bytes = 0;
    for (const bst_config_desc *d = table; d->key; d++) {
        size_t end = d->type == BST_CONFIG_RAW ? 0 : d->offset + d->size;
        bytes = end > bytes ? end : bytes;
    }
    return bytes;
}

bst_status bst_config_read(bst_ctx *ctx, const bst_json *json, const cJSON *node, const char *path,
                           const bst_config_desc *table, void *object) {
    return bst_stage_read_config(ctx, json, node, path, table, NULL, object);
}

bst_status bst_stage_read_config(bst_ctx *ctx, const bst_json *json, const cJSON *node,
                                 const char *path, const bst_config_desc *table,
                                 const bst_stage_loader *loader, void *object) {
    memset(object, 0, table_bytes(table));
    reader r = {ctx, bst_json_name(json), json, loader};
    bst_status status = read_object(&r, node, path, table, object);
    if (status != BST_OK) {
        bst_config_free(table, object);
    }
    return status;
}

bst_status bst_config_defaults(bst_ctx *ctx, const bst_config_desc *table, void *object) {
    memset(object, 0, table_bytes(table));
    reader r = {.ctx = ctx, .file = "defaults"};
    bst_status status = read_object(&r, NULL, "", table, object);
    if (status != BST_OK) {
        bst_config_free(table, object);
    }
    return status;
}

void bst_config_free(const bst_config_desc *table, void *object) {
    for (const bst_config_desc *d = table; d->key; d++) {
        char *member = (char *)object + d->offset;
        if (d->type == BST_CONFIG_OBJECT) {
            bst_config_free(d->children, member);
        } else if (d->type == BST_CONFIG_LIST) {
            bst_config_list *list = (bst_config_list *)(void *)member;
            for (int i = 0; i < list->count; i++) {
                bst_config_free(d->children, (char *)list->items + (size_t)i * d->item_bytes);
            }
            free(list->items);
            *list = (bst_config_list){NULL, 0};
        } else if (d->type == BST_CONFIG_STAGE) {
            bst_stage_use *use = (bst_stage_use *)(void *)member;
            if (use->desc && use->desc->config) {
                bst_config_free(use->desc->config, use->config);
            }
            free(use->config);
            *use = (bst_stage_use){.desc = NULL};
        }
    }
}

static cJSON *exact_number(double value) {
    char text[40];
    bst_text_of_number(value, text, sizeof text);
    return isfinite(value) ? cJSON_CreateRaw(text) : cJSON_CreateNull();
}

static cJSON *exact_numbers(const double *values, size_t count) {
    cJSON *array = cJSON_CreateArray();
    for (size_t i = 0; i < count && array; i++) {
        cJSON_AddItemToArray(array, exact_number(values[i]));
    }
    return array;
}

static cJSON *echo_value(const bst_config_desc *d, const void *object) {
    const char *member = (const char *)object + d->offset;
    double number;
    switch (d->type) {
        case BST_CONFIG_BOOL:
            return cJSON_CreateBool(*(const bool *)(const void *)member);
        case BST_CONFIG_INT:
            return exact_number((double)*(const int64_t *)(const void *)member);
        case BST_CONFIG_REAL:
            number = *(const double *)(const void *)member;
            return isnan(number) && bst_config_is_open(d) ? cJSON_CreateNull()
                                                          : exact_number(number);
        case BST_CONFIG_STRING:
        case BST_CONFIG_PATH:
            return cJSON_CreateString(member);
        case BST_CONFIG_ENUM:
            return cJSON_CreateString(d->choices[*(const int32_t *)(const void *)member]);
        case BST_CONFIG_CHOICES: {
            cJSON *array = cJSON_CreateArray();
            for (int i = 0; d->choices[i] && array; i++) {
                if (*(const uint32_t *)(const void *)member & UINT32_C(1) << i) {
                    cJSON_AddItemToArray(array, cJSON_CreateString(d->choices[i]));
                }
            }
            return array;
        }
        case BST_CONFIG_SEED: {
            char text[24];
            snprintf(text, sizeof text, "0x%" PRIX64, *(const uint64_t *)(const void *)member);
            return cJSON_CreateString(text);
        }
        case BST_CONFIG_REALS:
            return exact_numbers((const double *)(const void *)member, d->size / sizeof(double));
        case BST_CONFIG_OBJECT:
            return bst_config_echo(d->children, member);
        case BST_CONFIG_LIST: {
            const bst_config_list *list = (const bst_config_list *)(const void *)member;
            cJSON *array = cJSON_CreateArray();
            for (int i = 0; i < list->count; i++) {
                cJSON_AddItemToArray(
                    array, bst_config_echo(d->children,
                                           (const char *)list->items + (size_t)i * d->item_bytes));
            }
            return array;
        }
        case BST_CONFIG_RAW:
        case BST_CONFIG_STAGE:
        case BST_CONFIG_FORMER:
            return NULL;
    }
    return NULL;
}

static cJSON *echo_stage(const bst_stage_use *use) {
    static const bst_config_desc none[] = {BST_CONFIG_END};
    cJSON *node = bst_config_echo(use->desc->config ? use->desc->config : none, use->config);
    cJSON_AddStringToObject(node, "plugin", use->plugin);
    cJSON_AddStringToObject(node, "type", use->desc->type);
    return node;
}

cJSON *bst_config_echo(const bst_config_desc *table, const void *object) {
    const bst_config_desc *stage = stage_of(table);
    const bst_stage_use *use =
        stage ? (const bst_stage_use *)(const void *)((const char *)object + stage->offset) : NULL;
    if (use && use->desc) {
        return echo_stage(use);
    }
    cJSON *node = cJSON_CreateObject();
    for (const bst_config_desc *d = table; d->key && node; d++) {
        cJSON *value = echo_value(d, object);
        if (value) {
            cJSON_AddItemToObject(node, d->key, value);
        }
    }
    return node;
}
