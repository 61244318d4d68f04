/* Former names of keys: in tables, in documents, in pointers, in files that extend others. */
#include <cjson/cJSON.h>
#include <stdlib.h>
#include <unistd.h>

#include "sim/core/former_names.h"
#include "tests/test_support.h"

typedef struct rays {
    double rate, readout_s;
} rays;

typedef struct sensor {
    rays cosmic_rays;
    int64_t max_nodes;
} sensor;

typedef struct thing {
    bst_config_list sensors;
    rays rays;
} thing;

static const bst_config_desc rays_table[] = {
    BST_REAL(rays, rate, "", 0, 100, "1", "Rate."), BST_FORMER("flux", "rate"),
    BST_FORMER("speed", "rate"), BST_REAL(rays, readout_s, "s", 0, 10, "0", "Read-out."),
    BST_CONFIG_END};
static const bst_config_desc sensor_table[] = {
    BST_OBJECT(sensor, cosmic_rays, rays_table, "{}", "Cosmic rays."),
    BST_FORMER("hits", "cosmic_rays"), BST_INT(sensor, max_nodes, "", 1, 100, NULL, "Nodes."),
    BST_FORMER("most_nodes", "max_nodes"), BST_CONFIG_END};
static const bst_config_desc thing_table[] = {
    BST_LIST(thing, sensors, sensor, sensor_table, 0, 4, "[]", "Sensors."),
    BST_FORMER("cameras", "sensors"),
    BST_OBJECT(thing, rays, rays_table, "{}", "Rays."),
    {.key = "modules", .type = BST_CONFIG_RAW, .unit = "", .doc = "Modules."},
    BST_CONFIG_END};

/* The module "sky" has rays_table. */
static const bst_config_desc *inside(const void *user, const char *raw, const char *key,
                                     const cJSON *node, int index) {
    (void)user;
    (void)node;
    return index == 0 && strcmp(raw, "modules") == 0 && key && strcmp(key, "sky") == 0 ? rays_table
                                                                                       : NULL;
}

static const bst_document_tables tables = {thing_table, inside, NULL};

typedef struct heard {
    char text[8][400];
    int count;
} heard;

static void hear(void *user, bst_log_level level, const char *message) {
    heard *h = user;
    assert_int_equal(level, BST_LOG_WARNING);
    assert_in_range(h->count, 0, 7);
    snprintf(h->text[h->count++], sizeof h->text[0], "%s", message);
}

static bst_json *parse(bst_ctx *ctx, const char *text) {
    bst_json *json;
    bst_assert_ok(ctx, bst_json_parse(ctx, "doc.json", text, strlen(text), &json));
    return json;
}

static void assert_root(const bst_json *json, const char *expected) {
    char *text = cJSON_PrintUnformatted(bst_json_root(json));
    assert_string_equal(text, expected);
    free(text);
}

/* Reads under a table what no document has been described for, as plug-ins' tables are. */
static void read_tables(void **state) {
    (void)state;
    heard h = {.count = 0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, hear, &h, BST_LOG_WARNING);
    bst_json *json = parse(&ctx, "{\"cameras\": [{\"hits\": {\"speed\": 7}, \"most_nodes\": 3}]}");
    thing t;
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "", thing_table, &t));
    const sensor *s = t.sensors.items;
    assert_int_equal(t.sensors.count, 1);
    assert_int_equal(s->max_nodes, 3);
    bst_assert_close(s->cosmic_rays.rate, 7, 0);
    assert_int_equal(h.count, 4);
    assert_int_equal(ctx.warnings, 4);
    assert_string_equal(h.text[0], "doc.json: /cameras: former name, now sensors");
    assert_string_equal(h.text[1], "doc.json: /cameras/0/hits: former name, now cosmic_rays");
    assert_string_equal(h.text[2], "doc.json: /cameras/0/most_nodes: former name, now max_nodes");
    assert_string_equal(h.text[3], "doc.json: /cameras/0/hits/speed: former name, now rate");
    cJSON *echo = bst_config_echo(thing_table, &t);
    char *text = cJSON_PrintUnformatted(echo);
    assert_string_equal(text,
                        "{\"sensors\":[{\"cosmic_rays\":{\"rate\":7,\"readout_s\":0},"
                        "\"max_nodes\":3}],\"rays\":{\"rate\":1,\"readout_s\":0}}");
    free(text);
    cJSON_Delete(echo);
    bst_config_free(thing_table, &t);
    bst_json_free(json);
}

static void refuse(const char *text, const char *message) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_json *json = parse(&ctx, text);
    thing t;
    assert_int_equal(bst_config_read(&ctx, json, bst_json_root(json), "", thing_table, &t),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, message));
    bst_json_free(json);
}

static void wrong_values(void **state) {
    (void)state;
    refuse("{\"rays\": {\"rate\": 1, \"flux\": 1}}",
           "doc.json: /rays/flux: former name of rate, which is given too (allowed: rate alone)");
    refuse("{\"rays\": {\"speed\": 1, \"flux\": 1}}", "/rays/speed: former name of rate");
    refuse("{\"rays\": {\"speed\": -1}}", "/rays/speed: out of range (found -1; allowed: ");
    /* a slip of a former name: the present one is suggested */
    refuse("{\"sensors\": [{\"most_node\": 1}]}", "did you mean \"max_nodes\"?");
    refuse("{\"sensors\": [{}]}", "/sensors/0/max_nodes: missing");
    refuse("{\"nothing_alike\": 1}", "(allowed: sensors, rays, modules)");
}

static void documents(void **state) {
    (void)state;
    heard h = {.count = 0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, hear, &h, BST_LOG_WARNING);
    bst_json *json =
        parse(&ctx,
              "{\"cameras\":[{\"hits\":{\"rate\":2}},{\"hits\":{\"plugin\":\"a\",\"flux\":1}}],"
              "\"modules\":{\"sky\":{\"flux\":5},\"other\":{\"flux\":5}}}");
    assert_false(bst_json_is_described(json));
    bst_assert_ok(&ctx, bst_json_describe(&ctx, json, &tables, true));
    assert_true(bst_json_is_described(json));
    assert_int_equal(h.count, 4);
    assert_string_equal(h.text[3], "doc.json: /modules/sky/flux: former name, now rate");
    assert_root(json,
                "{\"sensors\":[{\"cosmic_rays\":{\"rate\":2}},{\"cosmic_rays\":{\"plugin\":\"a\","
                "\"flux\":1}}],\"modules\":{\"sky\":{\"rate\":5},\"other\":{\"flux\":5}}}");
    h.count = 0;
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/cameras/0/hits/flux=3"));
    assert_int_equal(h.count, 3);
    assert_string_equal(h.text[2],
                        "--set /cameras/0/hits/flux=3: /cameras/0/hits/flux: former name, now "
                        "rate");
    /* inside the value; a new element of the list's table */
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/sensors/1={\"hits\": {\"speed\": 4}}"));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/modules/sky={\"speed\": 6}"));
    assert_root(json,
                "{\"sensors\":[{\"cosmic_rays\":{\"rate\":3}},{\"cosmic_rays\":{\"rate\":4}}],"
                "\"modules\":{\"sky\":{\"rate\":6},\"other\":{\"flux\":5}}}");
    /* a copy was warned of already */
    bst_json *copy;
    bst_assert_ok(&ctx, bst_json_copy(&ctx, json, &copy));
    h.count = 0;
    bst_assert_ok(&ctx, bst_json_assign(&ctx, copy, "/rays/flux", cJSON_CreateNumber(8)));
    assert_int_equal(h.count, 0);
    assert_int_equal(
        cJSON_GetObjectItem(cJSON_GetObjectItem(bst_json_root(copy), "rays"), "rate")->valueint, 8);
    bst_json_free(copy);
    assert_int_equal(bst_json_set(&ctx, json, "/rays={\"flux\": 1, \"rate\": 2}"), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "/rays/flux: former name of rate, which is given too"));
    bst_json_free(json);
    json = parse(&ctx, "{\"rays\": {\"flux\": 1, \"rate\": 2}}");
    assert_int_equal(bst_json_describe(&ctx, json, &tables, true), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "doc.json: /rays/flux: former name of rate, which is given too (allowed: "
                        "rate alone)");
    bst_json_free(json);
}

static void put(const char *folder, const char *name, const char *text) {
    char path[BST_TEST_PATH + 20];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static bst_status load(bst_ctx *ctx, const char *folder, bst_json **json) {
    char path[BST_TEST_PATH + 20];
    snprintf(path, sizeof path, "%s/top.json", folder);
    return bst_json_load_described(ctx, path, &tables, json);
}

/* A file with former names is changed by one with present names, and the other way round. */
static void extended(void **state) {
    (void)state;
    char folder[BST_TEST_PATH], path[BST_TEST_PATH + 20], expected[2 * BST_TEST_PATH];
    bst_test_template(folder, "former");
    assert_non_null(mkdtemp(folder));
    heard h = {.count = 0};
    bst_ctx ctx;
    bst_ctx_init(&ctx, hear, &h, BST_LOG_WARNING);
    put(folder, "base.json", "{\"cameras\":[{\"hits\":{\"flux\":1}}],\"rays\":{\"rate\":2}}");
    put(folder, "top.json",
        "{\"extends\":\"base.json\",\"set\":{\"/sensors/0/cosmic_rays/rate\":3,"
        "\"/rays/flux\":4}}");
    bst_json *json;
    bst_assert_ok(&ctx, load(&ctx, folder, &json));
    assert_root(json, "{\"sensors\":[{\"cosmic_rays\":{\"rate\":3}}],\"rays\":{\"rate\":4}}");
    assert_int_equal(h.count, 4);
    snprintf(expected, sizeof expected, "%s/base.json: /cameras: former name, now sensors", folder);
    assert_string_equal(h.text[0], expected);
    snprintf(expected, sizeof expected, "%s/top.json: /set: /rays/flux: former name, now rate",
             folder);
    assert_string_equal(h.text[3], expected);
    bst_json_free(json);
    put(folder, "top.json",
        "{\"extends\":\"base.json\",\"set\":{\"/rays/flux\":4,\"/rays/rate\":5}}");
    assert_int_equal(load(&ctx, folder, &json), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "/set: /rays/flux is given under its present name too"));
    put(folder, "top.json",
        "{\"extends\":\"base.json\",\"set\":{\"/rays\":{\"flux\":4,\"rate\":5}}}");
    h.count = 0;
    assert_int_equal(load(&ctx, folder, &json), BST_ERR_CONFIG);
    put(folder, "base.json", "{\"rays\":{\"flux\":1,\"speed\":2}}");
    assert_int_equal(load(&ctx, folder, &json), BST_ERR_CONFIG);
    assert_null(json);
    const char *const names[] = {"base.json", "top.json"};
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        assert_int_equal(unlink(path), 0);
    }
    assert_int_equal(rmdir(folder), 0);
}

/* What is no pointer, or has no former name, stays as it is, for the reader's message. */
static void other_pointers(void **state) {
    (void)state;
    static const char *const texts[] = {"", "/", "most_nodes", "//rays//rate", "/sensors/0/x/"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bst_ctx ctx = {0};
        char *present;
        bst_assert_ok(
            &ctx, bst_json_present_pointer(&ctx, &tables, NULL, texts[i], NULL, "test", &present));
        assert_string_equal(present, texts[i]);
        assert_int_equal(ctx.warnings, 0);
        free(present);
    }
}

static void schema(void **state) {
    (void)state;
    cJSON *node = bst_config_schema(sensor_table);
    const cJSON *properties = cJSON_GetObjectItem(node, "properties");
    const cJSON *former = cJSON_GetObjectItem(properties, "most_nodes");
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(former, "deprecated")));
    assert_string_equal(cJSON_GetObjectItem(former, "description")->valuestring,
                        "Former name of max_nodes.");
    assert_null(cJSON_GetObjectItem(former, "type"));
    assert_null(cJSON_GetObjectItem(cJSON_GetObjectItem(properties, "max_nodes"), "deprecated"));
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(node, "required")), 1);
    cJSON_Delete(node);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(read_tables), cmocka_unit_test(wrong_values),
        cmocka_unit_test(documents),   cmocka_unit_test(extended),
        cmocka_unit_test(schema),      cmocka_unit_test(other_pointers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
