#include <stdio.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/stage.h"

/* largest magnitude shown as a limit; wider ranges mean "any finite number" */
static const double OPEN_BOUND = 1e300;

/* Adds the schema of a seed: a text with a pattern, or a number with limits. */
static void add_seed(cJSON *node) {
    cJSON *types = cJSON_AddArrayToObject(node, "type");
    cJSON_AddItemToArray(types, cJSON_CreateString("string"));
    cJSON_AddItemToArray(types, cJSON_CreateString("integer"));
    cJSON_AddStringToObject(node, "pattern", "^(0x[0-9a-fA-F]{1,16}|[0-9]{1,20})$");
    cJSON_AddNumberToObject(node, "minimum", 0);
    cJSON_AddRawToObject(node, "maximum", "9007199254740991"); /* 2^53 - 1: exact */
}

static void add_range(cJSON *node, const bst_config_desc *d) {
    if (d->minimum > -OPEN_BOUND) {
        cJSON_AddNumberToObject(node, "minimum", d->minimum);
    }
    if (d->maximum < OPEN_BOUND) {
        cJSON_AddNumberToObject(node, "maximum", d->maximum);
    }
}

/* Adds the choices as an "enum". */
static void add_choices(cJSON *node, const bst_config_desc *d) {
    cJSON *choices = cJSON_AddArrayToObject(node, "enum");
    for (int i = 0; d->choices[i]; i++) {
        cJSON_AddItemToArray(choices, cJSON_CreateString(d->choices[i]));
    }
}

/* Adds the documentation with the unit in brackets. */
static void add_description(cJSON *node, const bst_config_desc *d) {
    char text[600];
    const char *unit = d->unit && *d->unit ? d->unit : NULL;
    size_t length = strlen(d->doc);
    if (unit && length + strlen(unit) + 4 < sizeof text) {
        memcpy(text, d->doc, length);
        text[length] = '\0';
        strcat(text, " [");
        strcat(text, unit);
        strcat(text, "]");
        cJSON_AddStringToObject(node, "description", text);
    } else {
        cJSON_AddStringToObject(node, "description", d->doc);
    }
}

/* A former name: any value is valid, since the program checks it under the present name. */
static cJSON *former_schema(const bst_config_desc *d) {
    char text[BST_CONFIG_KEY_BYTES + 20];
    cJSON *node = cJSON_CreateObject();
    snprintf(text, sizeof text, "Former name of %s.", d->fallback);
    cJSON_AddBoolToObject(node, "deprecated", 1);
    cJSON_AddStringToObject(node, "description", text);
    return node;
}

static cJSON *value_schema(const bst_config_desc *d) {
    if (d->type == BST_CONFIG_FORMER) {
        return former_schema(d);
    }
    cJSON *node =
        d->type == BST_CONFIG_OBJECT ? bst_config_schema(d->children) : cJSON_CreateObject();
    switch (d->type) {
        case BST_CONFIG_BOOL:
            cJSON_AddStringToObject(node, "type", "boolean");
            break;
        case BST_CONFIG_INT:
        case BST_CONFIG_REAL:
            if (bst_config_is_open(d)) {
                cJSON *types = cJSON_AddArrayToObject(node, "type");
                cJSON_AddItemToArray(types, cJSON_CreateString("number"));
                cJSON_AddItemToArray(types, cJSON_CreateString("null"));
                add_range(node, d);
                break;
            }
            cJSON_AddStringToObject(node, "type", d->type == BST_CONFIG_INT ? "integer" : "number");
            add_range(node, d);
            break;
        case BST_CONFIG_STRING:
        case BST_CONFIG_PATH:
            cJSON_AddStringToObject(node, "type", "string");
            cJSON_AddNumberToObject(node, "maxLength", (double)d->size - 1.0);
            break;
        case BST_CONFIG_ENUM:
            add_choices(node, d);
            break;
        case BST_CONFIG_CHOICES:
            cJSON_AddStringToObject(node, "type", "array");
            cJSON_AddBoolToObject(node, "uniqueItems", 1);
            add_choices(cJSON_AddObjectToObject(node, "items"), d);
            break;
        case BST_CONFIG_SEED:
            add_seed(node);
            break;
        case BST_CONFIG_REALS: {
            cJSON_AddStringToObject(node, "type", "array");
            double count = (double)(d->size / sizeof(double));
            cJSON_AddNumberToObject(node, "minItems", count);
            cJSON_AddNumberToObject(node, "maxItems", count);
            cJSON *item = cJSON_AddObjectToObject(node, "items");
            cJSON_AddStringToObject(item, "type", "number");
            add_range(item, d);
            break;
        }
        case BST_CONFIG_LIST:
            cJSON_AddStringToObject(node, "type", "array");
            cJSON_AddNumberToObject(node, "minItems", d->minimum);
            cJSON_AddNumberToObject(node, "maxItems", d->maximum);
            cJSON_AddItemToObject(node, "items", bst_config_schema(d->children));
            break;
        case BST_CONFIG_STAGE:
            cJSON_AddStringToObject(node, "type", "string");
            break;
        case BST_CONFIG_OBJECT:
        case BST_CONFIG_RAW:
        case BST_CONFIG_FORMER:
            break;
    }
    if (d->doc) {
        add_description(node, d);
    }
    if (d->fallback && d->type != BST_CONFIG_OBJECT) {
        cJSON_AddItemToObject(node, "default", cJSON_Parse(d->fallback));
    }
    return node;
}

/* Schema of an object with its own keys, or with those of a plug-in if it names one. */
static cJSON *either(cJSON *own, const bst_config_desc *stage) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "type", "object");
    cJSON *names = cJSON_AddArrayToObject(cJSON_AddObjectToObject(node, "if"), "required");
    cJSON_AddItemToArray(names, cJSON_CreateString(stage->key));
    cJSON *plugin = cJSON_AddObjectToObject(node, "then");
    cJSON_AddStringToObject(plugin, "title", stage->choices[0]);
    cJSON *properties = cJSON_AddObjectToObject(plugin, "properties");
    cJSON_AddItemToObject(properties, stage->key, value_schema(stage));
    cJSON *type = cJSON_AddObjectToObject(properties, "type");
    cJSON_AddStringToObject(type, "type", "string");
    cJSON_AddStringToObject(type, "description",
                            "Which of the library's, where it has several of the kind.");
    cJSON_DeleteItemFromObjectCaseSensitive(own, "type");
    cJSON_AddItemToObject(node, "else", own);
    return node;
}

cJSON *bst_config_schema(const bst_config_desc *table) {
    const bst_config_desc *stage = NULL;
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "type", "object");
    cJSON_AddBoolToObject(node, "additionalProperties", 0);
    cJSON *properties = cJSON_AddObjectToObject(node, "properties");
    cJSON *required = cJSON_CreateArray();
    for (const bst_config_desc *d = table; d->key; d++) {
        stage = d->type == BST_CONFIG_STAGE ? d : stage;
        if (d == stage) {
            continue;
        }
        cJSON_AddItemToObject(properties, d->key, value_schema(d));
        if (!d->fallback && d->type != BST_CONFIG_RAW && d->type != BST_CONFIG_STAGE) {
            cJSON_AddItemToArray(required, cJSON_CreateString(d->key));
        }
    }
    cJSON *text = cJSON_AddObjectToObject(properties, "description");
    cJSON_AddStringToObject(text, "type", "string");
    if (cJSON_GetArraySize(required) > 0) {
        cJSON_AddItemToObject(node, "required", required);
    } else {
        cJSON_Delete(required);
    }
    return stage ? either(node, stage) : node;
}
