/* Files that extend another one: what results, which file a value is from, what is refused. */
#include <cjson/cJSON.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "boresight/config.h"
#include "tests/io/scratch.h"
#include "tests/test_support.h"

static scratch place;

/* Writes a file below the folder; returns its path, valid until the next call. */
static const char *put(const char *name, const char *text) {
    const char *path = scratch_path(&place, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    return path;
}

static int begin(void **state) {
    (void)state;
    scratch_make(&place);
    assert_int_equal(mkdir(scratch_path(&place, "sub"), 0700), 0);
    return 0;
}

static int end(void **state) {
    (void)state;
    scratch_remove(&place);
    return 0;
}

static void expect_text(const bst_json *json, const char *expected) {
    char *text = cJSON_PrintUnformatted(bst_json_root(json));
    assert_string_equal(text, expected);
    free(text);
}

/* The end of the path of the file that gave what is at `pointer`. */
static void expect_from(const bst_json *json, const char *pointer, const char *tail) {
    const char *file = bst_json_file(json, pointer);
    assert_true(strlen(file) > strlen(tail));
    assert_string_equal(file + strlen(file) - strlen(tail), tail);
}

static void a_chain_is_resolved(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    put("a.json", "{\"n\": 1, \"list\": [{\"k\": 1, \"m\": 2}, {\"k\": 3}], \"o\": {\"p\": 1}}");
    put("sub/b.json",
        "{\"extends\": \"../a.json\", \"o\": {\"q\": 2}, \"set\": {\"/list/1/k\": 4, \"/o/r\": "
        "5}}");
    const char *c = put("c.json",
                        "{\"set\": {\"/list/0/m\": [7], \"/new/deep\": null, \"/list/1\": {}}, "
                        "\"extends\": \"sub/b.json\"}");
    bst_assert_ok(&ctx, bst_json_load_extended(&ctx, c, &json));
    assert_string_equal(bst_json_name(json), c);
    expect_text(json,
                "{\"n\":1,\"list\":[{\"k\":1,\"m\":[7]},{}],\"o\":{\"q\":2,\"r\":5},"
                "\"new\":{\"deep\":null}}");
    expect_from(json, "/n", "/a.json");
    expect_from(json, "/nn", "/a.json");
    expect_from(json, "/list/0/k", "/a.json");
    expect_from(json, "/list/0/m", "/c.json");
    expect_from(json, "/list/0/m/0", "/c.json");
    expect_from(json, "/list/0", "/c.json"); /* something in it */
    expect_from(json, "/o/q", "/sub/b.json");
    expect_from(json, "/o/r", "/sub/b.json");
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/o/q=9"));
    expect_from(json, "/o/q", "/c.json"); /* as --set of the file that was asked for */
    bst_fail(&ctx, BST_ERR_CONFIG, "%s: /n: is wrong: really", c);
    bst_json_name_file(&ctx, json);
    assert_non_null(strstr(ctx.message, "/sub/../a.json: /n: is wrong: really"));
    bst_fail(&ctx, BST_ERR_CONFIG, "something else: /n: is wrong");
    bst_json_name_file(&ctx, json);
    assert_string_equal(ctx.message, "something else: /n: is wrong");
    bst_json_free(json);
}

/* A copy knows the file of each value too, and what is assigned to it is the document's own. */
static void a_copy_keeps_the_files(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json = NULL, *copy = NULL;
    put("sub/far.json", "{\"path\": \"data.txt\", \"o\": {\"p\": 1, \"q\": 2}}");
    const char *near = put("near.json", "{\"extends\": \"sub/far.json\", \"own\": 1}");
    bst_assert_ok(&ctx, bst_json_load_extended(&ctx, near, &json));
    bst_assert_ok(&ctx, bst_json_copy(&ctx, json, &copy));
    bst_json_free(json);
    expect_text(copy, "{\"path\":\"data.txt\",\"o\":{\"p\":1,\"q\":2},\"own\":1}");
    expect_from(copy, "/path", "/sub/far.json");
    expect_from(copy, "/own", "/near.json");
    bst_assert_ok(&ctx, bst_json_assign(&ctx, copy, "/o/p", cJSON_CreateNumber(3)));
    expect_from(copy, "/o/p", "/near.json");
    expect_from(copy, "/o/q", "/sub/far.json");
    bst_json_free(copy);
}

static void a_file_on_its_own_is_as_it_is(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    const char *path = put("own.json", "{\"a\": 3, \"set\": 4}");
    bst_assert_ok(&ctx, bst_json_load_extended(&ctx, path, &json));
    expect_text(json, "{\"a\":3,\"set\":4}");
    assert_string_equal(bst_json_file(json, "/a"), path);
    bst_json_free(json);
}

/* tail: the message after the scratch folder's name and "/". */
static void refuse(const char *name, const char *text, bst_status status, const char *tail) {
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    const char *path = put(name, text);
    size_t folder = (size_t)(strstr(path, name) - path);
    assert_int_equal(bst_json_load_extended(&ctx, path, &json), status);
    assert_null(json);
    assert_true(strlen(ctx.message) > folder);
    assert_string_equal(ctx.message + folder, tail);
}

/* The message holds both texts. */
static void refuse_with(const char *name, const char *text, bst_status status, const char *one,
                        const char *two) {
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    assert_int_equal(bst_json_load_extended(&ctx, put(name, text), &json), status);
    assert_null(json);
    assert_non_null(strstr(ctx.message, one));
    assert_non_null(strstr(ctx.message, two));
}

static void wrong_ones_are_refused(void **state) {
    (void)state;
    put("base.json", "{\"a\": 1, \"l\": [1]}");
    put("list.json", "[1]");
    put("broken.json", "{\"a\": }");
    refuse("x.json", "{\"extends\": 3}", BST_ERR_CONFIG,
           "x.json: /extends: wrong type (found 3; allowed: a string, the file that this one "
           "changes)");
    refuse("x.json", "{\"extends\": \"\"}", BST_ERR_CONFIG,
           "x.json: /extends: wrong type (found \"\"; allowed: a string, the file that this one "
           "changes)");
    refuse("x.json", "{\"extends\": \"list.json\"}", BST_ERR_CONFIG,
           "x.json: /extends: its value is no object (found \"list.json\"; allowed: a file whose "
           "value is one)");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": [1]}", BST_ERR_CONFIG,
           "x.json: /set: wrong type (found [1]; allowed: an object of values by JSON pointer)");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": {\"a\": 1}}", BST_ERR_CONFIG,
           "x.json: /set: \"a\" is no JSON pointer (allowed: \"/\" and keys or numbers of elements "
           "with \"/\" between them)");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": {\"/\": 1}}", BST_ERR_CONFIG,
           "x.json: /set: \"/\" is no JSON pointer (allowed: \"/\" and keys or numbers of elements "
           "with \"/\" between them)");
    refuse("x.json", "{\"extends\": \"base.json\", \"a/b\": 1}", BST_ERR_CONFIG,
           "x.json: /a/b: unknown key");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": {\"/l/1\": 1}}", BST_ERR_CONFIG,
           "x.json: /set: /l/1: there is no element \"1\" (allowed: 0 to 0)");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": {\"/a/b/c\": 1}}", BST_ERR_CONFIG,
           "x.json: /set: /a/b/c: there is no element \"b\" in what is no object and no array");
    refuse("x.json", "{\"extends\": \"base.json\", \"set\": {\"/l//0\": 1}}", BST_ERR_CONFIG,
           "x.json: /set: \"/l//0\" is no JSON pointer (allowed: \"/\" and keys or numbers of "
           "elements with \"/\" between them)");
    refuse("x.json", "{\"extends\": \"base.json\", \"a\": 2, \"set\": {\"/a\": 3}}", BST_ERR_CONFIG,
           "x.json: /a: is given beside \"set\" and in it");
    refuse_with("x.json", "{\"extends\": \"none.json\"}", BST_ERR_NOT_FOUND,
                "x.json: /extends: ", "none.json: ");
    refuse_with("x.json", "{\"extends\": \"broken.json\"}", BST_ERR_FORMAT,
                "x.json: /extends: ", "broken.json:1:7: this is not valid JSON");
    refuse_with("x.json", "{\"extends\": \"sub\"}", BST_ERR_IO, "x.json: /extends: ", "sub");
}

static void cycles_and_long_chains_are_refused(void **state) {
    (void)state;
    refuse_with("x.json", "{\"extends\": \"x.json\"}", BST_ERR_CONFIG,
                "x.json: /extends: ", "x.json extends itself by way of 1 file");
    put("y.json", "{\"extends\": \"sub/../z.json\"}");
    refuse_with("z.json", "{\"extends\": \"y.json\"}", BST_ERR_CONFIG,
                "y.json: /extends: ", "z.json extends itself by way of 2 files");
    char name[32], text[64];
    put("s0.json", "{}");
    for (int i = 1; i <= 16; i++) {
        snprintf(name, sizeof name, "s%d.json", i);
        snprintf(text, sizeof text, "{\"extends\": \"s%d.json\", \"v%d\": 1}", i - 1, i);
        put(name, text);
    }
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    bst_assert_ok(&ctx, bst_json_load_extended(&ctx, scratch_path(&place, "s15.json"), &json));
    assert_int_equal(cJSON_GetArraySize(bst_json_root(json)), 15);
    bst_json_free(json);
    assert_int_equal(bst_json_load_extended(&ctx, scratch_path(&place, "s16.json"), &json),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, ": more than 16 files extend each other"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_chain_is_resolved),
        cmocka_unit_test(a_copy_keeps_the_files),
        cmocka_unit_test(a_file_on_its_own_is_as_it_is),
        cmocka_unit_test(wrong_ones_are_refused),
        cmocka_unit_test(cycles_and_long_chains_are_refused),
    };
    return cmocka_run_group_tests(tests, begin, end);
}
