/* Every former name in the tables of the program, found by walking them: it sets the same value as
 * the present name, with a warning, and pointers and schema know it. */
#include <cjson/cJSON.h>
#include <stdlib.h>

#include "obsgen/calibration.h"
#include "sim/registry/registry.h"
#include "sim/studies/slurm.h"
#include "sim/studies/study_config.h"
#include "tests/test_support.h"

enum { MAX_ROWS = 4000, MAX_POINTER = 400 };
/* Room for any of the structs (a sensor's is the largest). */
enum { STRUCT_BYTES = 1 << 16 };

/* A table, and where it is in a scenario; "": it is no part of one. */
typedef struct visit {
    const bst_config_desc *table;
    char pointer[MAX_POINTER];
} visit;

typedef struct walk {
    visit visits[MAX_ROWS];
    int count;
} walk;

static void add(walk *w, const bst_config_desc *table, const char *pointer) {
    for (int i = 0; i < w->count; i++) {
        if (w->visits[i].table == table) {
            return;
        }
    }
    assert_in_range(w->count, 0, MAX_ROWS - 1);
    visit *v = &w->visits[w->count++];
    v->table = table;
    snprintf(v->pointer, sizeof v->pointer, "%s", pointer ? pointer : "-");
    for (const bst_config_desc *d = table; d->key; d++) {
        char below[MAX_POINTER] = "-";
        bool list = d->type == BST_CONFIG_LIST;
        if (pointer && *pointer != '-') {
            snprintf(below, sizeof below, "%.200s/%.60s%s", pointer, d->key, list ? "/0" : "");
        }
        if (list || d->type == BST_CONFIG_OBJECT) {
            add(w, d->children, below);
        }
    }
}

static walk *all_tables(void) {
    walk *w = calloc(1, sizeof *w);
    const bst_scenario_registry *registry = bst_registry_shipped();
    assert_non_null(w);
    add(w, bst_scenario_table, "");
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *m = registry->modules[i];
        char pointer[MAX_POINTER];
        snprintf(pointer, sizeof pointer, "%s%s",
                 m->flags & BST_MODULE_MULTI_SENSOR ? "/" : "/observers/0/sensors/0/modules/",
                 m->role);
        if (m->config) {
            add(w, m->config, pointer);
        }
    }
    add(w, bst_study_table, "-");
    add(w, bst_slurm_site_table, "-");
    add(w, bst_obsgen_calibration_table, "-");
    return w;
}

static const bst_config_desc *find(const bst_config_desc *table, const char *key) {
    const bst_config_desc *d = table;
    while (d->key && strcmp(d->key, key) != 0) {
        d++;
    }
    return d->key ? d : NULL;
}

static cJSON *required_of(const bst_config_desc *table, const bst_config_desc *but);

/* A value that is allowed and, where there is a choice, not the default. */
static cJSON *value_of(const bst_config_desc *d) {
    cJSON *value = NULL;
    cJSON *fallback = d->fallback ? cJSON_Parse(d->fallback) : NULL;
    double number =
        cJSON_IsNumber(fallback) && fallback->valuedouble == d->minimum ? d->maximum : d->minimum;
    switch (d->type) {
        case BST_CONFIG_BOOL:
            value = cJSON_CreateBool(!cJSON_IsTrue(fallback));
            break;
        case BST_CONFIG_INT:
        case BST_CONFIG_REAL:
            value = cJSON_CreateNumber(number);
            break;
        case BST_CONFIG_STRING:
        case BST_CONFIG_PATH:
            value = cJSON_CreateString("x");
            break;
        case BST_CONFIG_ENUM: {
            int last = 0;
            while (d->choices[last + 1]) {
                last++;
            }
            value = cJSON_CreateString(d->choices[last]);
            break;
        }
        case BST_CONFIG_CHOICES:
            value = cJSON_CreateArray();
            cJSON_AddItemToArray(value, cJSON_CreateString(d->choices[0]));
            break;
        case BST_CONFIG_SEED:
            value = cJSON_CreateNumber(77);
            break;
        case BST_CONFIG_REALS:
            value = cJSON_CreateArray();
            for (size_t i = 0; i < d->size / sizeof(double); i++) {
                cJSON_AddItemToArray(value, cJSON_CreateNumber(d->minimum));
            }
            break;
        case BST_CONFIG_OBJECT:
            value = required_of(d->children, NULL);
            for (const bst_config_desc *c = d->children; c->key; c++) {
                if (c->type == BST_CONFIG_REAL && !cJSON_GetObjectItem(value, c->key)) {
                    cJSON_AddItemToObject(value, c->key, value_of(c));
                }
            }
            break;
        case BST_CONFIG_LIST:
            value = cJSON_CreateArray();
            cJSON_AddItemToArray(value, required_of(d->children, NULL));
            break;
        case BST_CONFIG_RAW:
            value = cJSON_CreateArray();
            break;
        case BST_CONFIG_STAGE:
        case BST_CONFIG_FORMER:
            break;
    }
    cJSON_Delete(fallback);
    assert_non_null(value);
    return value;
}

/* An object with the keys that a table requires, without `but`. */
static cJSON *required_of(const bst_config_desc *table, const bst_config_desc *but) {
    cJSON *node = cJSON_CreateObject();
    for (const bst_config_desc *d = table; d->key; d++) {
        if (d != but && !d->fallback && d->type != BST_CONFIG_RAW && d->type != BST_CONFIG_STAGE) {
            cJSON_AddItemToObject(node, d->key, value_of(d));
        }
    }
    return node;
}

typedef struct heard {
    char text[300];
    int count;
} heard;

static void hear(void *user, bst_log_level level, const char *message) {
    heard *h = user;
    assert_int_equal(level, BST_LOG_WARNING);
    h->count++;
    snprintf(h->text, sizeof h->text, "%s", message);
}

/* The configuration, as text, of an object with a value under the given names. */
static bst_status read_as(const bst_config_desc *table, const bst_config_desc *now,
                          const char *name, const char *second, heard *h, bst_ctx *ctx,
                          char **out) {
    void *object = calloc(1, STRUCT_BYTES);
    bst_json *json;
    cJSON *node = required_of(table, now);
    assert_non_null(object);
    cJSON_AddItemToObject(node, name, value_of(now));
    if (second) {
        cJSON_AddItemToObject(node, second, value_of(now));
    }
    bst_ctx_init(ctx, hear, h, BST_LOG_WARNING);
    bst_assert_ok(ctx, bst_json_parse(ctx, "doc.json", "{}", 2, &json));
    bst_status status = bst_config_read(ctx, json, node, "/at", table, object);
    *out = NULL;
    if (status == BST_OK) {
        cJSON *echo = bst_config_echo(table, object);
        *out = cJSON_Print(echo);
        cJSON_Delete(echo);
        bst_config_free(table, object);
    }
    cJSON_Delete(node);
    bst_json_free(json);
    free(object);
    return status;
}

static void check_row(const bst_config_desc *table, const bst_config_desc *former) {
    const bst_config_desc *now = find(table, former->fallback);
    char *given, *expected, warning[200];
    bst_ctx ctx;
    heard h = {.count = 0};
    assert_non_null(now);
    assert_int_not_equal(now->type, BST_CONFIG_FORMER);
    assert_true(strlen(now->key) < BST_CONFIG_KEY_BYTES);
    assert_true(strlen(former->key) < BST_CONFIG_KEY_BYTES);
    bst_assert_ok(&ctx, read_as(table, now, now->key, NULL, &h, &ctx, &expected));
    assert_int_equal(h.count, 0);
    bst_assert_ok(&ctx, read_as(table, now, former->key, NULL, &h, &ctx, &given));
    assert_int_equal(h.count, 1);
    snprintf(warning, sizeof warning, "doc.json: /at/%s: former name, now %s", former->key,
             now->key);
    assert_string_equal(h.text, warning);
    assert_string_equal(given, expected);
    free(given);
    free(expected);
    assert_int_equal(read_as(table, now, former->key, now->key, &h, &ctx, &given), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "which is given too"));
}

static void each_is_read(void **state) {
    (void)state;
    walk *w = all_tables();
    int rows = 0;
    for (int i = 0; i < w->count; i++) {
        for (const bst_config_desc *d = w->visits[i].table; d->key; d++) {
            if (d->type == BST_CONFIG_FORMER) {
                check_row(w->visits[i].table, d);
                rows++;
            }
        }
    }
    assert_in_range(rows, 60, 1000); /* those of the first renaming at least */
    free(w);
}

/* "--set" and axes of studies. */
static void each_is_found_by_pointers(void **state) {
    (void)state;
    walk *w = all_tables();
    for (int i = 0; i < w->count; i++) {
        const visit *v = &w->visits[i];
        for (const bst_config_desc *d = v->table; d->key && *v->pointer != '-'; d++) {
            if (d->type != BST_CONFIG_FORMER) {
                continue;
            }
            char former[2 * MAX_POINTER], now[2 * MAX_POINTER], *present;
            bst_ctx ctx = {0};
            snprintf(former, sizeof former, "%s/%s", v->pointer, d->key);
            snprintf(now, sizeof now, "%s/%s", v->pointer, d->fallback);
            bst_assert_ok(&ctx, bst_json_present_pointer(&ctx, bst_registry_tables(), NULL, former,
                                                         NULL, "--set", &present));
            assert_string_equal(present, now);
            assert_int_equal(ctx.warnings, 1);
            free(present);
            bst_assert_ok(&ctx, bst_json_present_pointer(&ctx, bst_registry_tables(), NULL, now,
                                                         NULL, "--set", &present));
            assert_string_equal(present, now);
            assert_int_equal(ctx.warnings, 1);
            free(present);
        }
    }
    free(w);
}

/* A pointer is translated without the type of a module: a former name means the same in all types
 * of a role. */
static void each_means_one_thing(void **state) {
    (void)state;
    const bst_scenario_registry *registry = bst_registry_shipped();
    for (int i = 0; i < registry->count; i++) {
        const bst_module_desc *a = registry->modules[i];
        for (const bst_config_desc *d = a->config; d && d->key; d++) {
            for (int k = 0; k < registry->count && d->type == BST_CONFIG_FORMER; k++) {
                const bst_module_desc *b = registry->modules[k];
                const bst_config_desc *other =
                    strcmp(a->role, b->role) == 0 && b->config ? find(b->config, d->key) : NULL;
                if (other) {
                    assert_int_equal(other->type, BST_CONFIG_FORMER);
                    assert_string_equal(other->fallback, d->fallback);
                }
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_is_read),
        cmocka_unit_test(each_is_found_by_pointers),
        cmocka_unit_test(each_means_one_thing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
