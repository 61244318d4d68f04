/* The JSON reader: what it refuses, in which words, and overrides. */
#include <cjson/cJSON.h>
#include <stdlib.h>
#include <unistd.h>

#include "boresight/config.h"
#include "tests/test_support.h"

static void expect_refused(const char *text, size_t bytes, bst_status status, const char *message) {
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    assert_int_equal(bst_json_parse(&ctx, "f.json", text, bytes, &json), status);
    assert_null(json);
    assert_string_equal(ctx.message, message);
}

static void test_refused_texts(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", "f.json:1:1: the file is empty (a JSON object is expected)"},
        {" \n\t ", "f.json:1:1: the file is empty (a JSON object is expected)"},
        {"\xEF\xBB\xBF", "f.json:1:1: the file is empty (a JSON object is expected)"},
        {"{",
         "f.json:1:2: this is not valid JSON (found the end of the text; allowed: a key in double "
         "quotes or })"},
        {"{\"a\": 1",
         "f.json:1:8: this is not valid JSON (found the end of the text; allowed: a comma or })"},
        {"{\"a\"",
         "f.json:1:5: this is not valid JSON (found the end of the text; allowed: a colon between "
         "key and value)"},
        {"{\"a\":",
         "f.json:1:6: this is not valid JSON (found the end of the text; allowed: a value: {...}, "
         "[...], \"...\", a finite number, true, false, null)"},
        {"[1, 2",
         "f.json:1:6: this is not valid JSON (found the end of the text; allowed: a comma or ])"},
        {"{\"a\": \"b", "f.json:1:7: the string that begins here has no closing \" in its line"},
        {"{\"a\": \"x\ny\"}",
         "f.json:1:7: the string that begins here has no closing \" in its line"},
        {"{\"a\": 1,}",
         "f.json:1:9: this is not valid JSON (found \"}\"; allowed: a key in double quotes)"},
        {"[1,]",
         "f.json:1:4: this is not valid JSON (found \"]\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"[1 2]", "f.json:1:4: this is not valid JSON (found \"2\"; allowed: a comma or ])"},
        {"[}",
         "f.json:1:2: this is not valid JSON (found \"}\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null, or ])"},
        {"{]",
         "f.json:1:2: this is not valid JSON (found \"]\"; allowed: a key in double quotes or })"},
        {"{1: 2}",
         "f.json:1:2: this is not valid JSON (found \"1\"; allowed: a key in double quotes or })"},
        {"{\"a\" 1}",
         "f.json:1:6: this is not valid JSON (found \"1\"; allowed: a colon between key and "
         "value)"},
        {"{\n  \"a\": 1\n  \"b\": 2\n}",
         "f.json:3:3: this is not valid JSON (found a string; allowed: a comma or })"},
        {"{\"a\": NaN}",
         "f.json:1:7: this is not valid JSON (found \"NaN\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"{\"a\": Infinity}",
         "f.json:1:7: this is not valid JSON (found \"Infinity\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"{\"a\": -Infinity}",
         "f.json:1:7: this is not a JSON number (found \"-Infinity\"; allowed: such as 12, -0.5, "
         "6.7e-11, without leading zeros)"},
        {"{'a': 1}",
         "f.json:1:2: this is not valid JSON (found \"'\"; allowed: a key in double quotes or })"},
        {"tru",
         "f.json:1:1: this is not valid JSON (found \"tru\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"{\"a\": 1} // note",
         "f.json:1:10: text after the end of the JSON value (found \"/\"; allowed: nothing more)"},
        {"{\"a\": 1}\n{}",
         "f.json:2:1: text after the end of the JSON value (found \"{\"; allowed: nothing more)"},
        {"[1] \xC3\xA9\xC3\xA8",
         "f.json:1:5: text after the end of the JSON value (found \"\xC3\xA9\"; allowed: nothing "
         "more)"},
        {"{\"a\": 01}",
         "f.json:1:7: this is not a JSON number (found \"01\"; allowed: such as 12, -0.5, 6.7e-11, "
         "without leading zeros)"},
        {"{\"a\": 1.}",
         "f.json:1:7: this is not a JSON number (found \"1.\"; allowed: such as 12, -0.5, 6.7e-11, "
         "without leading zeros)"},
        {"{\"a\": -}",
         "f.json:1:7: this is not a JSON number (found \"-\"; allowed: such as 12, -0.5, 6.7e-11, "
         "without leading zeros)"},
        {"{\"a\": 1e}",
         "f.json:1:7: this is not a JSON number (found \"1e\"; allowed: such as 12, -0.5, 6.7e-11, "
         "without leading zeros)"},
        {"{\"a\": 0x10}",
         "f.json:1:8: this is not valid JSON (found \"x10\"; allowed: a comma or })"},
        {"{\"a\": .5}",
         "f.json:1:7: this is not valid JSON (found \".5\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"{\"a\": +5}",
         "f.json:1:7: this is not valid JSON (found \"+5\"; allowed: a value: {...}, [...], "
         "\"...\", a finite number, true, false, null)"},
        {"{\"a\": [1, 1e400]}",
         "f.json:1:11: the number is too large (found \"1e400\"; allowed: |number| < 1.8e308)"},
        {"-1e999",
         "f.json:1:1: the number is too large (found \"-1e999\"; allowed: |number| < 1.8e308)"},
        {"1111111111222222222233333333334444444444555555555566666666667777",
         "f.json:1:1: a number of more than 63 characters"},
        {"{\"a\": \"x\ty\"}",
         "f.json:1:9: a control character within a string (write \\n, \\t or \\u00XX)"},
        {"{\"a\":\f1}",
         "f.json:1:6: this is not valid JSON (found the control character 0x0C; allowed: a value: "
         "{...}, [...], \"...\", a finite number, true, false, null)"},
        {"{\"a\": \"x\\u0000y\"}", "f.json:1:9: \\u0000 within a string is not allowed"},
        {"{\"a\": \"\\ud800\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\udc00\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\ud800\\u0041\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\udbff\\udbff\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\ud800\\ue000\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\udfff\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"\\u12\"}",
         "f.json:1:8: \\u is not followed by the four hexadecimal digits of a character (a "
         "character beyond U+FFFF takes two such, a high and a low surrogate)"},
        {"{\"a\": \"C:\\dir\"}",
         "f.json:1:10: unknown escape in a string (allowed: \\\" \\\\ \\/ \\b \\f \\n \\r \\t \\u "
         "and four hexadecimal digits; a backslash itself is \\\\)"},
        {"{\"a\": \"x\\",
         "f.json:1:9: unknown escape in a string (allowed: \\\" \\\\ \\/ \\b \\f \\n \\r \\t \\u "
         "and four hexadecimal digits; a backslash itself is \\\\)"},
        {"\xFF\xFE{", "f.json:1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
        {"\xFE\xFF", "f.json:1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
        {"{\"a\": \"gr\xFC\xDF\"}", "f.json:1:10: byte 0xFC is not UTF-8 text (allowed: UTF-8)"},
        {"{\"a\": \"\xC0\xAF\"}", "f.json:1:8: byte 0xC0 is not UTF-8 text (allowed: UTF-8)"},
        {"{\"a\": \"\xED\xA0\x80\"}", "f.json:1:8: byte 0xED is not UTF-8 text (allowed: UTF-8)"},
        {"{\"a\": \"\xF4\x90\x80\x80\"}",
         "f.json:1:8: byte 0xF4 is not UTF-8 text (allowed: UTF-8)"},
        {"{\"a\": \"\xE2\x82", "f.json:1:8: byte 0xE2 is not UTF-8 text (allowed: UTF-8)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        expect_refused(cases[i].text, strlen(cases[i].text), BST_ERR_FORMAT, cases[i].message);
    }
    expect_refused("{\"a\": 1}\0", 9, BST_ERR_FORMAT,
                   "f.json:1:9: byte 0x00 is not UTF-8 text (allowed: UTF-8)");
}

static void test_refused_content(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"{\"a\": 1, \"b\": 2, \"a\": 3}", "f.json: /a: the key is given twice"},
        {"{\"l\": [0, {\"x\": 1, \"x\": 1}]}", "f.json: /l/1/x: the key is given twice"},
        {"{\"a\": 1, \"\\u0061\": 2}", "f.json: /a: the key is given twice"},
        {"{\"o\": {\"x\": 1, \"a\\nb\": 1}}",
         "f.json: /o: element 1 has a control character in its key"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        expect_refused(cases[i].text, strlen(cases[i].text), BST_ERR_CONFIG, cases[i].message);
    }
}

static void test_accepted_texts(void **state) {
    (void)state;
    static const char *const texts[] = {
        "{}",
        "\xEF\xBB\xBF{} \r\n",
        "{\"a\": 1, \"A\": 2}",
        "[0, -0, 0.5, -1.25e-3, 1E+5, 10]",
        "\"gr\xC3\xBC\xC3\x9F \\u00e9 \\ud83d\\ude80 \\\\u0000 \xF0\x9F\x9A\x80\"",
        "{\"a\": \"[[[[{{{{ 01 1. - \\\" \"}",
        "[\"\\ud800\\udc00 \\ud800\\udfff \\udbff\\udc00 \\udbff\\udfff \\ud7ff \\ue000\"]",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bst_ctx ctx = {0};
        bst_json *json = NULL;
        bst_assert_ok(&ctx, bst_json_parse(&ctx, "f.json", texts[i], strlen(texts[i]), &json));
        assert_string_equal(bst_json_name(json), "f.json");
        bst_json_free(json);
    }
    bst_json_free(NULL);
}

static void test_depth(void **state) {
    (void)state;
    char text[2 * 65 + 1];
    memset(text, '[', 65);
    memset(text + 65, ']', 65);
    expect_refused(text, 130, BST_ERR_FORMAT, "f.json:1:65: nested too deep (allowed: 64 levels)");
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "f.json", text + 1, 128, &json));
    bst_json_free(json);
}

/* A quadratic search would take minutes for this, and the test would meet its time limit. */
static void test_many_keys(void **state) {
    (void)state;
    enum { KEYS = 250000, KEY_BYTES = 16 };
    char *text = malloc((size_t)KEYS * KEY_BYTES + 32);
    assert_non_null(text);
    size_t bytes = 0;
    for (int i = 0; i < KEYS; i++) {
        bytes += (size_t)sprintf(text + bytes, "%c\"k%d\":%d", i ? ',' : '{', i, i % 10);
    }
    memcpy(text + bytes, ",\"k7\":0}", 9);
    expect_refused(text, bytes + 8, BST_ERR_CONFIG, "f.json: /k7: the key is given twice");
    free(text);
}

static void test_every_truncation_is_refused(void **state) {
    (void)state;
    static const char text[] =
        "{\"a\": [1.5, true, null, {\"b\": \"\\u00e9\xC3\xA9\"}], \"c\": -2e-3}";
    for (size_t bytes = 0; bytes < sizeof text - 1; bytes++) {
        char *copy = malloc(bytes + 1); /* exact size, for the sanitizer */
        assert_non_null(copy);
        memcpy(copy, text, bytes);
        bst_ctx ctx = {0};
        bst_json *json = NULL;
        assert_int_equal(bst_json_parse(&ctx, "f.json", copy, bytes, &json), BST_ERR_FORMAT);
        free(copy);
    }
}

static void test_load(void **state) {
    (void)state;
    char path[BST_TEST_PATH];
    bst_test_template(path, "boresight_json");
    FILE *file = fdopen(mkstemp(path), "w");
    assert_non_null(file);
    fputs("{\"a\": 3}\n", file);
    fclose(file);
    bst_ctx ctx = {0};
    bst_json *json = NULL;
    bst_assert_ok(&ctx, bst_json_load(&ctx, path, &json));
    assert_string_equal(bst_json_name(json), path);
    assert_true(cJSON_HasObjectItem(bst_json_root(json), "a"));
    bst_json_free(json);
    unlink(path);
}

static bst_status set(bst_ctx *ctx, const char *assignment, char *result, size_t bytes) {
    static const char text[] = "{\"a\": 1, \"o\": {\"x\": 2}, \"l\": [{\"y\": 3}, {\"y\": 4}]}";
    bst_json *json = NULL;
    bst_assert_ok(ctx, bst_json_parse(ctx, "f.json", text, strlen(text), &json));
    bst_status status = bst_json_set(ctx, json, assignment);
    char *printed = cJSON_PrintUnformatted(bst_json_root(json));
    assert_non_null(printed);
    snprintf(result, bytes, "%s", printed);
    free(printed);
    bst_json_free(json);
    return status;
}

static void test_set(void **state) {
    (void)state;
    static const struct {
        const char *assignment, *result;
    } cases[] = {
        {"/a=5", "{\"a\":5,\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=ideal", "{\"a\":\"ideal\",\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=a=b", "{\"a\":\"a=b\",\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=0x1F", "{\"a\":\"0x1F\",\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=\"7\"", "{\"a\":\"7\",\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=[1, 2]", "{\"a\":[1,2],\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/a=null", "{\"a\":null,\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/o/x=-1.5", "{\"a\":1,\"o\":{\"x\":-1.5},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/o/z=true", "{\"a\":1,\"o\":{\"x\":2,\"z\":true},\"l\":[{\"y\":3},{\"y\":4}]}"},
        {"/n/m=1", "{\"a\":1,\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}],\"n\":{\"m\":1}}"},
        {"/l/1/y=9", "{\"a\":1,\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":9}]}"},
        {"/l/0={\"y\":8}", "{\"a\":1,\"o\":{\"x\":2},\"l\":[{\"y\":8},{\"y\":4}]}"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        char result[300];
        bst_assert_ok(&ctx, set(&ctx, cases[i].assignment, result, sizeof result));
        assert_string_equal(result, cases[i].result);
    }
}

static void test_set_refused(void **state) {
    (void)state;
    static const struct {
        const char *assignment, *message;
    } cases[] = {
        {"a=5", "--set a=5: expected /json/path=value, for example --set /duration_s=60"},
        {"/a", "--set /a: expected /json/path=value, for example --set /duration_s=60"},
        {"/=5", "--set /=5: expected /json/path=value, for example --set /duration_s=60"},
        {"//=5", "--set //=5: expected /json/path=value, for example --set /duration_s=60"},
        {"//a=5", "--set //a=5: expected /json/path=value, for example --set /duration_s=60"},
        {"/o//x=5", "--set /o//x=5: expected /json/path=value, for example --set /duration_s=60"},
        {"/o/=5", "--set /o/=5: expected /json/path=value, for example --set /duration_s=60"},
        {"/l/00/y=5", "--set /l/00/y=5: there is no element \"00\" (allowed: 0 to 1)"},
        {"", "--set : expected /json/path=value, for example --set /duration_s=60"},
        {"/a={",
         "--set /a={: the value is neither a plain word nor JSON: value:1:2: this is not valid "
         "JSON (found the "
         "end of the text; allowed: a key in double quotes or })"},
        {"/a=", "--set /a=: the value is missing"},
        {"/a={\"b\":1,\"b\":2}",
         "--set /a={\"b\":1,\"b\":2}: the value is neither a plain word nor JSON: value: /b: the "
         "key is given twice"},
        {"/l/2=1", "--set /l/2=1: there is no element \"2\" (allowed: 0 to 1)"},
        {"/l/2/y=1", "--set /l/2/y=1: there is no element \"2\" (allowed: 0 to 1)"},
        {"/l/-1/y=1", "--set /l/-1/y=1: there is no element \"-1\" (allowed: 0 to 1)"},
        {"/l/+1/y=1", "--set /l/+1/y=1: there is no element \"+1\" (allowed: 0 to 1)"},
        {"/l/4294967296/y=1",
         "--set /l/4294967296/y=1: there is no element \"4294967296\" (allowed: 0 to 1)"},
        {"/l/y=1", "--set /l/y=1: there is no element \"y\" (allowed: 0 to 1)"},
        {"/a/b=1", "--set /a/b=1: there is no element \"b\" in what is no object and no array"},
        {"/a/b/c=1", "--set /a/b/c=1: there is no element \"b\" in what is no object and no array"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        char result[300];
        assert_int_equal(set(&ctx, cases[i].assignment, result, sizeof result), BST_ERR_ARGUMENT);
        assert_string_equal(ctx.message, cases[i].message);
        assert_string_equal(result, "{\"a\":1,\"o\":{\"x\":2},\"l\":[{\"y\":3},{\"y\":4}]}");
    }
}

static void test_set_depth(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char assignment[300] = "", result[1000];
    for (int i = 0; i < 65; i++) {
        strcat(assignment, "/d");
    }
    strcat(assignment, "=1");
    assert_int_equal(set(&ctx, assignment, result, sizeof result), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, ": nested too deep"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refused_texts),  cmocka_unit_test(test_refused_content),
        cmocka_unit_test(test_accepted_texts), cmocka_unit_test(test_depth),
        cmocka_unit_test(test_many_keys),      cmocka_unit_test(test_every_truncation_is_refused),
        cmocka_unit_test(test_load),           cmocka_unit_test(test_set),
        cmocka_unit_test(test_set_refused),    cmocka_unit_test(test_set_depth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
