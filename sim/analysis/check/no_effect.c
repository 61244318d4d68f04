#include "sim/analysis/check/no_effect.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

enum {
    KEY_BYTES = BST_CONFIG_KEY_BYTES,
    PATH_BYTES = 300,
    MOST_PLACES = 3, /* of one key that are reported one by one */
};

/* Search for one key of the table. */
typedef struct search {
    const bst_scenario *scenario;
    const bst_no_effect *entry;
    char key[PATH_BYTES];
    bst_ctx *ctx;
    int count; /* places where it has no effect */
} search;

/* Takes the next part of a text up to `separator`. False at its end. */
static bool next_part(const char **text, char separator, char *out, size_t bytes) {
    while (**text == separator) {
        (*text)++;
    }
    size_t length = 0;
    for (; **text && **text != separator; (*text)++) {
        if (length + 1 < bytes) {
            out[length++] = **text;
        }
    }
    out[length] = '\0';
    return length > 0;
}

/* The value at a relative pointer ("state/source"); NULL: there is none. */
static const cJSON *value_at(const cJSON *node, const char *pointer) {
    char key[KEY_BYTES];
    while (node && next_part(&pointer, '/', key, sizeof key)) {
        node = cJSON_GetObjectItemCaseSensitive(node, key);
    }
    return node;
}

/* ---- conditions ---- */

/* Numbers of the resolved scenario are raw items. */
static bool is_zero(const cJSON *value) {
    return cJSON_IsRaw(value) ? strtod(value->valuestring, NULL) == 0.0
                              : cJSON_IsNumber(value) && value->valuedouble == 0.0;
}

static bool is_off(const cJSON *value) {
    if (cJSON_IsArray(value)) {
        for (const cJSON *item = value->child; item; item = item->next) {
            if (!is_zero(item)) {
                return false;
            }
        }
        return true;
    }
    return cJSON_IsFalse(value) || cJSON_IsNull(value) || is_zero(value) ||
           (cJSON_IsString(value) && !*value->valuestring);
}

static bool is_one_of(const cJSON *value, const char *words) {
    char word[KEY_BYTES];
    const char *text = cJSON_IsString(value) || cJSON_IsRaw(value) ? value->valuestring : "";
    while (next_part(&words, ' ', word, sizeof word)) {
        if (strcmp(word, text) == 0) {
            return true;
        }
    }
    return false;
}

static bool holds(const cJSON *value, bst_no_effect_test test, const char *words) {
    switch (test) {
        case BST_WHEN_OFF:
            return is_off(value);
        case BST_WHEN_ON:
            return !is_off(value);
        case BST_WHEN_IS:
            return is_one_of(value, words);
        case BST_WHEN_IS_NOT:
            return !is_one_of(value, words);
        default:
            break;
    }
    for (const cJSON *item = value->child; item; item = item->next) {
        if (is_one_of(item, words)) {
            return false;
        }
    }
    return true;
}

/* True if a change of the scenario sets the value at a pointer, or what it lies in. */
static bool changes(const bst_scenario *scenario, const char *where, const char *key) {
    char pointer[2 * PATH_BYTES];
    snprintf(pointer, sizeof pointer, "%s/%s", where, key);
    const bst_scenario_change *change = scenario->changes.items;
    for (int i = 0; i < scenario->changes.count; i++) {
        size_t length = strcspn(change[i].set, "=");
        if (strncmp(change[i].set, pointer, length) == 0 &&
            (pointer[length] == '\0' || pointer[length] == '/')) {
            return true;
        }
    }
    return false;
}

/* True if all conditions of the entry hold for an object; then `because` says so. */
static bool all_hold(search *s, const cJSON *used, const char *where, char *because) {
    size_t length = 0;
    for (int i = 0; i < BST_NO_EFFECT_CONDITIONS && s->entry->when[i].test; i++) {
        const char *key = s->entry->when[i].key;
        const cJSON *value = value_at(used, key);
        if (!value || !holds(value, s->entry->when[i].test, s->entry->when[i].words) ||
            changes(s->scenario, where, key)) {
            return false;
        }
        char *text = cJSON_PrintUnformatted(value);
        int n = snprintf(because + length, PATH_BYTES - length, "%s%s is %.60s",
                         length > 0 ? " and " : "", key, text ? text : "");
        length += n > 0 && (size_t)n < PATH_BYTES - length ? (size_t)n : 0;
        cJSON_free(text);
    }
    return true;
}

/* ---- defaults ---- */

static const bst_config_desc *find_key(const bst_config_desc *table, const char *key) {
    for (; table && table->key; table++) {
        if (strcmp(table->key, key) == 0) {
            return table;
        }
    }
    return NULL;
}

/* The table of a module's keys; NULL: not known. */
static const bst_config_desc *module_table(const bst_scenario *s, const int index[2],
                                           const char *name) {
    for (int m = 0; m < s->module_count; m++) {
        const bst_scenario_module_config *module = &s->modules[m];
        if (module->observer == index[0] && module->sensor == index[1] &&
            strcmp(module->name, name) == 0) {
            return module->desc->config;
        }
    }
    return NULL;
}

/* The descriptor of the key at a pointer; NULL: not known. */
static const bst_config_desc *desc_of(const bst_scenario *scenario, const char *pointer) {
    const bst_config_desc *table = bst_scenario_table, *found = NULL;
    int index[2] = {-1, -1}, lists = 0;
    char key[KEY_BYTES];
    while (next_part(&pointer, '/', key, sizeof key)) {
        found = find_key(table, key);
        if (!found) {
            return NULL;
        }
        table = found->children;
        if (found->type == BST_CONFIG_LIST && next_part(&pointer, '/', key, sizeof key)) {
            index[lists < 2 ? lists : 1] = (int)strtol(key, NULL, 10);
            lists++;
        } else if (found->type == BST_CONFIG_RAW && next_part(&pointer, '/', key, sizeof key)) {
            table = module_table(scenario, index, key);
        }
    }
    return found;
}

/* A seed as text or number: 42, "42", "0x2A". */
static uint64_t seed_of(const cJSON *value) {
    const char *text = cJSON_GetStringValue(value);
    return text ? strtoull(text, NULL, strncmp(text, "0x", 2) == 0 ? 16 : 10)
                : (uint64_t)cJSON_GetNumberValue(value);
}

/* True if a value equals the default of its key. */
static bool is_default(const bst_config_desc *desc, const cJSON *value) {
    if (!desc || !desc->fallback) {
        return false;
    }
    if (desc->type == BST_CONFIG_OBJECT && cJSON_IsObject(value)) {
        for (const cJSON *item = value->child; item; item = item->next) {
            const bst_config_desc *own = find_key(desc->children, item->string);
            if (own && !is_default(own, item)) {
                return false;
            }
        }
        return true;
    }
    cJSON *fallback = cJSON_Parse(desc->fallback);
    bool same = desc->type == BST_CONFIG_SEED ? seed_of(value) == seed_of(fallback)
                                              : cJSON_Compare(value, fallback, true);
    cJSON_Delete(fallback);
    return same;
}

/* ---- the search ---- */

/* Looks at the key in one object: as it was given, and as it is used. */
static void look(search *s, const cJSON *given, const cJSON *used, const char *where) {
    char because[PATH_BYTES] = "", path[PATH_BYTES];
    const cJSON *value = value_at(given, s->key);
    if (!value || cJSON_GetObjectItemCaseSensitive(given, "plugin") ||
        !all_hold(s, used, where, because)) {
        return;
    }
    int n = snprintf(path, sizeof path, "%s/%s", where, s->key);
    if (n < 0 || (size_t)n >= sizeof path || is_default(desc_of(s->scenario, path), value)) {
        return;
    }
    if (s->count++ < MOST_PLACES) {
        bst_log(s->ctx, BST_LOG_WARNING, "%s: %s has no effect: %s", s->scenario->file, path,
                because);
    }
}

/* Looks at all objects whose pointers match `pattern` from here on. */
static void walk(search *s, const char *pattern, const cJSON *given, const cJSON *used,
                 const char *where) {
    char part[KEY_BYTES], path[PATH_BYTES];
    if (!given || !used) {
        return;
    }
    if (!next_part(&pattern, '/', part, sizeof part)) {
        look(s, given, used, where);
        return;
    }
    if (strcmp(part, "*") != 0) {
        int n = snprintf(path, sizeof path, "%s/%s", where, part);
        if (n > 0 && (size_t)n < sizeof path) {
            walk(s, pattern, cJSON_GetObjectItemCaseSensitive(given, part),
                 cJSON_GetObjectItemCaseSensitive(used, part), path);
        }
        return;
    }
    used = used->child;
    given = given->child;
    for (int i = 0; given && used; i++, given = given->next, used = used->next) {
        int n = snprintf(path, sizeof path, "%s/%d", where, i);
        if (n > 0 && (size_t)n < sizeof path) {
            walk(s, pattern, given, used, path);
        }
    }
}

/* True if nothing but messages makes a module step; without triggers it steps once, at offset_s. */
static bool has_no_clock(const bst_scenario_module_config *module) {
    bool triggered = false;
    for (int p = 0; p < module->desc->port_count; p++) {
        triggered |= (module->desc->ports[p].flags & BST_PORT_TRIGGER) != 0;
    }
    return triggered && module->rate_hz == 0.0;
}

/* Warns of keys of steps by the clock that a module does not have. */
static void warn_of_steps(bst_ctx *ctx, const bst_scenario *scenario) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        const struct {
            const char *key;
            double value;
        } keys[] = {{"rate_hz", module->given_rate_hz}, {"offset_s", module->offset_s}};
        for (int k = 0; k < 2 && has_no_clock(module) && module->observer >= 0; k++) {
            if (keys[k].value > 0.0) {
                bst_log(ctx, BST_LOG_WARNING,
                        "%s: /observers/%d/sensors/%d/modules/%s/%s has no effect: %s \"%s\" steps "
                        "when its inputs come",
                        scenario->file, module->observer, module->sensor, module->name, keys[k].key,
                        module->desc->role, module->desc->type);
            }
        }
    }
}

void bst_no_effect_warn(bst_ctx *ctx, const bst_scenario *scenario) {
    warn_of_steps(ctx, scenario);
    cJSON *used = scenario->written ? bst_scenario_echo(scenario) : NULL;
    for (const bst_no_effect *entry = bst_no_effect_table; used && entry->where; entry++) {
        search s = {.scenario = scenario, .entry = entry, .ctx = ctx};
        for (const char *keys = entry->keys; next_part(&keys, ' ', s.key, sizeof s.key);) {
            char pattern[PATH_BYTES];
            s.count = 0;
            for (const char *at = entry->where; next_part(&at, ' ', pattern, sizeof pattern);) {
                walk(&s, pattern, scenario->written, used, "");
            }
            if (s.count > MOST_PLACES) {
                bst_log(ctx, BST_LOG_WARNING, "%s: %s has no effect in %d places more",
                        scenario->file, s.key, s.count - MOST_PLACES);
            }
        }
    }
    cJSON_Delete(used);
}
