/* Scenario files: what is wrong with them is said by file, place, value and what is allowed. */
#include <cjson/cJSON.h>

#include "sim/app/app.h"
#include "tests/bad_input/faults.h"

#define SHIPPED "scenarios/neossat_geo_stare.json"

static bst_status read_json(bst_ctx *ctx, const bst_json *json) {
    bst_scenario scenario;
    bst_status status = bst_scenario_read(ctx, json, bst_registry_shipped(), &scenario);
    bst_scenario_free(&scenario);
    return status;
}

static bst_status read_scenario(bst_ctx *ctx, const char *path) {
    bst_json *json = NULL;
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status = read_json(ctx, json);
    bst_json_free(json);
    return status;
}

static const bad_reader reader = {read_scenario, "a JSON file", "", 64 << 20};

static void paths(void **state) {
    (void)state;
    bad_paths(&reader);
}

static char *shipped_text(void) {
    FILE *file = fopen(SHIPPED, "rb");
    assert_non_null(file);
    char *text = calloc(1, 65536);
    assert_non_null(text);
    size_t bytes = fread(text, 1, 65535, file);
    assert_true(bytes > 0 && bytes < 65535);
    fclose(file);
    return text;
}

static void every_truncation(void **state) {
    (void)state;
    char *text = shipped_text();
    size_t bytes = strlen(text);
    while (text[bytes - 1] != '}') {
        bytes--; /* the white space at the end may go */
    }
    for (size_t n = 0; n < bytes; n++) {
        char *copy = malloc(n + 1); /* exact size, for the sanitizer */
        assert_non_null(copy);
        memcpy(copy, text, n);
        bst_ctx ctx = {0};
        bst_json *json = NULL;
        assert_int_equal(bst_json_parse(&ctx, "x", copy, n, &json), BST_ERR_FORMAT);
        assert_memory_equal(ctx.message, "x:", 2);
        free(copy);
    }
    free(text);
}

static void encodings(void **state) {
    (void)state;
    char *text = shipped_text(), *wide = malloc(2 * strlen(text) + 2);
    assert_non_null(wide);
    for (int big = 0; big < 2; big++) {
        size_t bytes = bad_utf16(text, true, big, wide);
        bad_bytes(&reader, wide, bytes, BST_ERR_FORMAT,
                  ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)");
        bytes = bad_utf16(text, false, big, wide);
        bad_bytes(&reader, wide, bytes, BST_ERR_FORMAT,
                  big ? ":1:1: byte 0x00 is not UTF-8 text (allowed: UTF-8)"
                      : ":1:2: byte 0x00 is not UTF-8 text (allowed: UTF-8)");
    }
    bad_text(&reader, "{\"name\": \"gr\xFC\xDF\"}", BST_ERR_FORMAT,
             ":1:13: byte 0xFC is not UTF-8 text (allowed: UTF-8)");
    free(wide);
    free(text);
}

static void nested_ten_thousand_deep(void **state) {
    (void)state;
    enum { DEPTH = 10000, STEP = 5 };
    char *text = malloc(DEPTH * STEP + 1);
    assert_non_null(text);
    memset(text, '[', DEPTH);
    bad_bytes(&reader, text, DEPTH, BST_ERR_FORMAT, ":1:65: nested too deep (allowed: 64 levels)");
    for (int i = 0; i < DEPTH; i++) {
        memcpy(text + i * STEP, "{\"a\":", STEP);
    }
    bad_bytes(&reader, text, DEPTH * STEP, BST_ERR_FORMAT,
              ":1:321: nested too deep (allowed: 64 levels)");
    free(text);
}

/* The shipped scenario with one override: the message that it is then refused with. */
static void refuse(const char *assignment, const char *message) {
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    bst_assert_ok(&ctx, bst_json_load(&ctx, SHIPPED, &json));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, assignment));
    bst_status status = read_json(&ctx, json);
    char expected[BST_MESSAGE_BYTES];
    snprintf(expected, sizeof expected, SHIPPED ": %s", message);
    assert_string_equal(ctx.message, expected);
    assert_int_equal(status, BST_ERR_CONFIG);
    bst_json_free(json);
}

#define SENSOR "/observers/0/sensors/0"

static void exact_messages(void **state) {
    (void)state;
    refuse("/boresight=2", "/boresight: out of range (found 2; allowed: 1)");
    refuse("/boresight=\"1\"", "/boresight: wrong type (found \"1\"; allowed: 1)");
    refuse("/boresight=null", "/boresight: wrong type (found null; allowed: 1)");
    refuse("/duration=60", "/duration: unknown key; did you mean \"duration_s\"?");
    refuse("/zzz=60",
           "/zzz: unknown key (allowed: boresight, extends, set, name, epoch_utc, duration_s, "
           "tick_rate_hz, seed, "
           "run, world, observers, tasking, record, link, pacing, changes)");
    refuse("/duration_s=NaN",
           "/duration_s: wrong type (found \"NaN\"; allowed: a number from 0 to 1000000000 s)");
    refuse("/duration_s=-1",
           "/duration_s: out of range (found -1; allowed: a number from 0 to 1000000000 s)");
    refuse("/duration_s=1e308",
           "/duration_s: out of range (found 1e+308; allowed: a number from 0 to 1000000000 s)");
    refuse("/tick_rate_hz=0.5",
           "/tick_rate_hz: not an integer (found 0.5; allowed: an integer from 1 to 1000000 Hz)");
    refuse("/seed=\"0xG\"",
           "/seed: not a seed (found \"0xG\"; allowed: a hexadecimal string such as \"0x1F\" or a "
           "decimal one such as \"31\", up to 64 bits, or an integer from 0 to 9007199254740991)");
    refuse("/seed=-1",
           "/seed: out of range (found -1; allowed: a hexadecimal string such as \"0x1F\" or a "
           "decimal one such as \"31\", up to 64 bits, or an integer from 0 to 9007199254740991)");
    refuse("/world=[]", "/world: wrong type (found []; allowed: an object)");
    refuse("/world/objects={}",
           "/world/objects: wrong type (found {}; allowed: an array of 0 to 100000 objects)");
    refuse("/world/objects/0/orbit=7",
           "/world/objects/0/orbit: wrong type (found 7; allowed: an object)");
    refuse("/world/objects/0/orbits/source=sgp4",
           "/world/objects/0/orbits: unknown key; did you mean \"orbit\"?");
    refuse("/observers=[]",
           "/observers: wrong number of elements (found an array of 0; allowed: an array of 1 to "
           "1000 objects)");
    refuse("/observers/0/name=\"a/b\"",
           "/observers/0/name: \"a/b\" is no name (allowed: letters, digits, _ - .)");
    refuse(SENSOR "/camera/bits=16.5",
           SENSOR "/camera/bits: not an integer (found 16.5; allowed: an integer from 8 to 16)");
    refuse(SENSOR "/modules=3", SENSOR "/modules: wrong type (found 3; allowed: an object)");
    refuse(SENSOR "/modules/gimbal=[]",
           SENSOR "/modules/gimbal: wrong type (found []; allowed: an object with a \"type\")");
    refuse(SENSOR "/modules/gimbal/type=[]", SENSOR
           "/modules/gimbal/type: wrong type (found []; allowed: a string of at most 63 "
           "bytes)");
    refuse(SENSOR "/modules/gimbal/delay_s=5", SENSOR
           "/modules/gimbal/delay_s: wrong type (found 5; allowed: an object of seconds by "
           "channel)");
    refuse(SENSOR "/modules/gimbal/delay_s=[5]", SENSOR
           "/modules/gimbal/delay_s: wrong type (found [5]; allowed: an object of seconds "
           "by channel)");
    refuse(SENSOR "/modules/gimbal/delay_s/los_command=[1]", SENSOR
           "/modules/gimbal/delay_s/los_command: wrong type (found [1]; allowed: a number "
           "from 0 to 1e6 s)");
}

static void wrong_texts(void **state) {
    (void)state;
    bad_text(&reader, "", BST_ERR_FORMAT, ":1:1: the file is empty (a JSON object is expected)");
    bad_text(&reader, "[]", BST_ERR_CONFIG, ": /: wrong type (found []; allowed: an object)");
    bad_text(&reader, "{}", BST_ERR_CONFIG,
             ": /boresight: missing; it is required: Version of the scenario format.");
    bad_text(&reader, "{\"boresight\": 1, \"boresight\": 1}", BST_ERR_CONFIG,
             ": /boresight: the key is given twice");
    bad_text(&reader, "{\"boresight\": 1, \"world\": {\"objects\": [], \"objects\": []}}",
             BST_ERR_CONFIG, ": /world/objects: the key is given twice");
    bad_text(&reader, "{\"boresight\": 1, \"duration_s\": NaN}", BST_ERR_FORMAT,
             ":1:32: this is not valid JSON (found \"NaN\"; allowed: a value: {...}, [...], "
             "\"...\", a finite number, true, false, null)");
    bad_text(&reader, "{\"boresight\": 1,\n \"duration_s\": 1e400}", BST_ERR_FORMAT,
             ":2:16: the number is too large (found \"1e400\"; allowed: |number| < 1.8e308)");
    bad_text(&reader, "{\"boresight\": 1}\n}", BST_ERR_FORMAT,
             ":2:1: text after the end of the JSON value (found \"}\"; allowed: nothing more)");
}

/* ------------------------------------------------ every key of the schema */

/* The resolved scenario, so that every key is there, and its schema. */
typedef struct walk {
    char *text;
    int tried;
} walk;

/* With sanitizers, a scenario takes ten times as long to read: every fourth value is tried; the
 * optimised build tries them all. */
#ifdef __SANITIZE_ADDRESS__
enum { TRIED_EVERY = 4 };
#else
enum { TRIED_EVERY = 1 };
#endif

/* Sets `path` to a value and expects to be refused with "NAME: PATH: PROBLEM (found ...; allowed:
 * ...)". */
static void refuse_value(walk *w, const char *path, const char *value, const char *problem) {
    if (w->tried++ % TRIED_EVERY != 0) {
        return;
    }
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    char assignment[1200], begin[700];
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "x.json", w->text, strlen(w->text), &json));
    snprintf(assignment, sizeof assignment, "%s=%s", path, value);
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, assignment));
    if (read_json(&ctx, json) != BST_ERR_CONFIG) {
        fail_msg("%s was taken", assignment);
    }
    snprintf(begin, sizeof begin, "x.json: %s: %s (found ", path, problem);
    if (strncmp(ctx.message, begin, strlen(begin)) != 0 || !strstr(ctx.message, "; allowed: ")) {
        fail_msg("%s: %s", assignment, ctx.message);
    }
    bst_json_free(json);
}

static void refuse_beyond(walk *w, const char *path, const cJSON *limit, double step) {
    char value[40];
    if (cJSON_IsNumber(limit)) {
        double beyond = limit->valuedouble + step * (1.0 + fabs(limit->valuedouble) * 1e-3);
        snprintf(value, sizeof value, "%.17g", step > 0 ? ceil(beyond) : floor(beyond));
        refuse_value(w, path, value, "out of range");
    }
}

static const cJSON *get(const cJSON *node, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(node, key);
}

/* The schema of a module, which depends on its type. */
static const cJSON *of_type(const cJSON *schema, const cJSON *instance) {
    const cJSON *one;
    cJSON_ArrayForEach(one, get(schema, "oneOf")) {
        const cJSON *type = get(get(one, "properties"), "type"), *name;
        if (cJSON_Compare(get(type, "const"), get(instance, "type"), true)) {
            return one;
        }
        cJSON_ArrayForEach(name, get(type, "enum")) {
            if (cJSON_Compare(name, get(instance, "type"), true)) {
                return one;
            }
        }
    }
    return schema;
}

/* The schemas of an object's keys; a stage that may be a plug-in has those of its own otherwise. */
static const cJSON *properties_of(const cJSON *schema, const cJSON *instance) {
    const cJSON *own = get(instance, "plugin") ? NULL : get(schema, "else");
    return get(own ? own : schema, "properties");
}

static void walk_value(walk *w, const cJSON *schema, const cJSON *instance, const char *path) {
    char below[512];
    schema = of_type(schema, instance);
    const cJSON *type_node = get(schema, "type");
    /* ["number", "null"]: may be left open; ["string", ...]: a seed */
    const char *first = cJSON_GetStringValue(cJSON_GetArrayItem(type_node, 0)),
               *second = cJSON_GetStringValue(cJSON_GetArrayItem(type_node, 1));
    const char *type = cJSON_IsString(type_node) ? type_node->valuestring
                       : first                   ? first
                                                 : "string";
    bool open = second && strcmp(second, "null") == 0;
    /* the type of a module, which may have two names: refused by those of its role */
    const char *last = strrchr(path, '/');
    if (get(schema, "const") || (strstr(path, "/modules/") && last && !strcmp(last, "/type"))) {
        return;
    }
    if (strcmp(type, "object") == 0) {
        refuse_value(w, path, "[true]", "wrong type");
        refuse_value(w, path, "7", "wrong type");
        const cJSON *item;
        cJSON_ArrayForEach(item, instance) {
            const cJSON *known = get(properties_of(schema, instance), item->string);
            assert_non_null(known);
            snprintf(below, sizeof below, "%s/%s", path, item->string);
            walk_value(w, known, item, below);
        }
    } else if (strcmp(type, "array") == 0) {
        refuse_value(w, path, "{}", "wrong type");
        refuse_value(w, path, "7", "wrong type");
        snprintf(below, sizeof below, "%s/0", path);
        if (instance->child) {
            walk_value(w, get(schema, "items"), instance->child, below);
        }
    } else {
        refuse_value(w, path, "[true]", "wrong type");
        if (!open) {
            refuse_value(w, path, "null", "wrong type");
        }
        refuse_value(w, path, strcmp(type, "boolean") == 0 ? "1" : "true", "wrong type");
        refuse_beyond(w, path, get(schema, "minimum"), -1.0);
        refuse_beyond(w, path, get(schema, "maximum"), 1.0);
        if (strcmp(type, "integer") == 0) {
            refuse_value(w, path, "1.5", "not an integer");
        }
        if (get(schema, "enum")) {
            refuse_value(w, path, "\"none of these\"", "unknown choice");
        }
        if (get(schema, "maxLength")) {
            char long_text[600] = "\"";
            memset(long_text + 1, 'a', 590);
            long_text[591] = '"';
            if (get(schema, "maxLength")->valuedouble < 590) {
                refuse_value(w, path, long_text, "too long");
            }
        }
    }
}

static void every_key(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_assert_ok(&ctx, bst_json_load(&ctx, SHIPPED, &json));
    bst_assert_ok(&ctx, bst_scenario_read(&ctx, json, bst_registry_shipped(), &scenario));
    cJSON *instance = bst_scenario_echo(&scenario);
    cJSON *schema = bst_scenario_schema(bst_registry_shipped());
    bst_scenario_free(&scenario);
    bst_json_free(json);
    walk w = {cJSON_PrintUnformatted(instance), 0};
    assert_non_null(w.text);
    const cJSON *item;
    cJSON_ArrayForEach(item, instance) {
        char path[100];
        snprintf(path, sizeof path, "/%s", item->string);
        walk_value(&w, get(get(schema, "properties"), item->string), item, path);
    }
    assert_true(w.tried > 500);
    free(w.text);
    cJSON_Delete(schema);
    cJSON_Delete(instance);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),       cmocka_unit_test(every_truncation),
        cmocka_unit_test(encodings),   cmocka_unit_test(nested_ten_thousand_deep),
        cmocka_unit_test(wrong_texts), cmocka_unit_test(exact_messages),
        cmocka_unit_test(every_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
