/* Configuration by tables: messages, defaults, overrides, echo, schema. */
#include <cjson/cJSON.h>
#include <stdlib.h>

#include "boresight/stage.h"
#include "tests/test_support.h"

typedef struct burn {
    double time_s;
    double dv_mps[3];
} burn;

typedef struct jitter {
    double rms_px;
    bool enabled;
} jitter;

typedef struct thing {
    char name[8];
    bool enabled;
    int64_t frames;
    int64_t big;
    double rate_hz;
    int32_t kind;
    uint64_t seed;
    double axis[3];
    jitter jitter;
    bst_config_list burns;
} thing;

static const char *const kinds[] = {"ideal", "two_axis", NULL};

static const bst_config_desc burn_table[] = {
    BST_REAL(burn, time_s, "s", 0, 1e6, NULL, "Time of the burn."),
    BST_REALS(burn, dv_mps, "m/s", -100, 100, "[0, 0, 0]", "Change of velocity."), BST_CONFIG_END};

static const bst_config_desc jitter_table[] = {
    BST_REAL(jitter, rms_px, "px", 0, 10, "0.5", "Jitter."),
    BST_BOOL(jitter, enabled, "true", "Whether it jitters."), BST_CONFIG_END};

static const bst_config_desc thing_table[] = {
    BST_STRING(thing, name, "\"thing\"", "Name."),
    BST_BOOL(thing, enabled, "false", "Switch."),
    BST_INT(thing, frames, "", 1, 1000, "10", "Frames."),
    BST_INT(thing, big, "", -9007199254740991.0, 9007199254740991.0, "0", "A large number."),
    BST_REAL(thing, rate_hz, "Hz", 0.1, 1e4, "1000", "Plant rate."),
    BST_ENUM(thing, kind, kinds, "\"ideal\"", "Kind."),
    BST_SEED(thing, seed, "\"0x1\"", "Seed."),
    BST_REALS(thing, axis, "", -1, 1, "[0, 0, 1]", "Axis."),
    BST_OBJECT(thing, jitter, jitter_table, "{}", "Jitter."),
    BST_LIST(thing, burns, burn, burn_table, 0, 2, "[]", "Burns."),
    {.key = "modules", .type = BST_CONFIG_RAW, .unit = "", .doc = "Module blocks."},
    BST_CONFIG_END};

typedef struct staged {
    double gain;
    bst_stage_use plug;
} staged;

typedef struct weighted_config {
    double weight;
    int64_t steps;
} weighted_config;

static const char *const stage_kinds[] = {"part", NULL};
static const bst_config_desc staged_table[] = {BST_REAL(staged, gain, "", 0, 10, "2", "Gain."),
                                               BST_STAGE(staged, plug, stage_kinds, "A library."),
                                               BST_CONFIG_END};
static const bst_config_desc plugged_table[] = {
    BST_REAL(weighted_config, weight, "kg", 0, 1, NULL, "Weight."),
    BST_INT(weighted_config, steps, "", 1, 9, "4", "Steps."), BST_CONFIG_END};
static const bst_stage_desc plugged_stage = {.abi = BST_STAGE_ABI,
                                             .kind = "part",
                                             .type = "mine",
                                             .config = plugged_table,
                                             .config_bytes = sizeof(weighted_config)};

static bst_status load_stage(void *user, bst_ctx *ctx, const bst_json *json, const char *path,
                             const char *plugin, const char *kind, const char *type,
                             const bst_stage_desc **out, char *file, size_t bytes) {
    (void)ctx;
    (void)json;
    assert_string_equal(path, "/plugin");
    assert_string_equal(plugin, "x.so");
    assert_string_equal(kind, "part");
    assert_true(!type || strcmp(type, "mine") == 0);
    *out = *(bool *)user ? &plugged_stage : NULL;
    snprintf(file, bytes, "/full/x.so");
    return BST_OK;
}

/* An object that names a plug-in has the plug-in's keys, and its own defaults. */
static void test_stage(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bool there = true;
    const bst_stage_loader loader = {&there, load_stage};
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"{\"plugin\": \"x.so\", \"type\": \"mine\", \"weight\": 0.5}", NULL},
        {"{\"plugin\": \"x.so\", \"weight\": 2}",
         "f.json: /weight: out of range (found 2; allowed: a number from 0 to 1 kg)"},
        {"{\"plugin\": \"x.so\", \"weight\": 1, \"gain\": 3}",
         "f.json: /gain: unknown key (allowed: weight, steps)"},
        {"{\"plugin\": \"x.so\"}", "f.json: /weight: missing; it is required: Weight."},
        {"{\"plugin\": \"\"}",
         "f.json: /plugin: wrong type (found \"\"; allowed: the path of a shared library)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_json *json = NULL;
        staged s;
        bst_assert_ok(&ctx,
                      bst_json_parse(&ctx, "f.json", cases[i].text, strlen(cases[i].text), &json));
        bst_status status =
            bst_stage_read_config(&ctx, json, bst_json_root(json), "", staged_table, &loader, &s);
        if (cases[i].message) {
            assert_int_equal(status, BST_ERR_CONFIG);
            assert_string_equal(ctx.message, cases[i].message);
        } else {
            bst_assert_ok(&ctx, status);
            assert_float_equal(s.gain, 2.0, 0.0); /* the table's text, exact */
            assert_ptr_equal(s.plug.desc, &plugged_stage);
            assert_float_equal(((weighted_config *)s.plug.config)->weight, 0.5, 0.0); /* exact */
            assert_int_equal(((weighted_config *)s.plug.config)->steps, 4);
            cJSON *echo = bst_config_echo(staged_table, &s);
            char *text = cJSON_PrintUnformatted(echo);
            assert_string_equal(text,
                                "{\"weight\":0.5,\"steps\":4,\"plugin\":\"/full/x.so\","
                                "\"type\":\"mine\"}");
            free(text);
            cJSON_Delete(echo);
            bst_config_free(staged_table, &s);
        }
        /* without a loader; and with one that leaves it unread */
        assert_int_equal(bst_config_read(&ctx, json, bst_json_root(json), "", staged_table, &s),
                         BST_ERR_CONFIG);
        if (i == 0) {
            assert_string_equal(ctx.message,
                                "f.json: /plugin: no plug-in is loaded here (found "
                                "\"x.so\"; allowed: one in a scenario's modules)");
            there = false;
            bst_assert_ok(&ctx, bst_stage_read_config(&ctx, json, bst_json_root(json), "",
                                                      staged_table, &loader, &s));
            assert_null(s.plug.desc);
            there = true;
        }
        bst_json_free(json);
    }
}

static bst_status read_text(bst_ctx *ctx, const char *text, const bst_config_desc *table,
                            void *object) {
    bst_json *json = NULL;
    bst_assert_ok(ctx, bst_json_parse(ctx, "f.json", text, strlen(text), &json));
    bst_status status = bst_config_read(ctx, json, bst_json_root(json), "", table, object);
    bst_json_free(json);
    return status;
}

#define SEEDS                                                                                   \
    "allowed: a hexadecimal string such as \"0x1F\" or a decimal one such as \"31\", up to 64 " \
    "bits, or an integer from 0 to 9007199254740991)"

static void seeds_are_decimal_or_hexadecimal(void **state) {
    (void)state;
    static const struct {
        const char *text;
        uint64_t seed;
    } cases[] = {
        {"{\"seed\": \"0x1F\"}", 31},
        {"{\"seed\": \"31\"}", 31},
        {"{\"seed\": 31}", 31},
        {"{\"seed\": \"012\"}", 12}, /* not octal */
        {"{\"seed\": 9007199254740991}", (UINT64_C(1) << 53) - 1},
        {"{\"seed\": \"18446744073709551615\"}", UINT64_MAX},
        {"{\"seed\": \"0xffffffffffffffff\"}", UINT64_MAX},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        struct {
            uint64_t seed;
        } t;
        static const bst_config_desc table[] = {
            {.key = "seed", .type = BST_CONFIG_SEED, .unit = "", .doc = "", .size = sizeof t.seed},
            BST_CONFIG_END};
        bst_json *json = NULL;
        bst_assert_ok(&ctx,
                      bst_json_parse(&ctx, "f.json", cases[i].text, strlen(cases[i].text), &json));
        bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "", table, &t));
        assert_true(t.seed == cases[i].seed);
        bst_json_free(json);
    }
}

static void test_messages(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"[]", "f.json: /: wrong type (found []; allowed: an object)"},
        {"{\"rate\": 1}", "f.json: /rate: unknown key; did you mean \"rate_hz\"?"},
        {"{\"Frames\": 1}", "f.json: /Frames: unknown key; did you mean \"frames\"?"},
        {"{\"jitter\": {\"rms\": 1}}",
         "f.json: /jitter/rms: unknown key; did you mean \"rms_px\"?"},
        {"{\"jitter\": {\"something\": 1}}",
         "f.json: /jitter/something: unknown key (allowed: rms_px, enabled)"},
        {"{\"frames\": \"10\"}",
         "f.json: /frames: wrong type (found \"10\"; allowed: an integer "
         "from 1 to 1000)"},
        {"{\"frames\": null}",
         "f.json: /frames: wrong type (found null; allowed: an integer from 1 to 1000)"},
        {"{\"frames\": 1.5}",
         "f.json: /frames: not an integer (found 1.5; allowed: an integer from 1 to 1000)"},
        {"{\"frames\": 0}",
         "f.json: /frames: out of range (found 0; allowed: an integer from 1 to 1000)"},
        {"{\"big\": 9007199254740993}",
         "f.json: /big: out of range (found 9007199254740992; allowed: an integer from "
         "-9007199254740991 to 9007199254740991)"},
        {"{\"rate_hz\": 0.05}",
         "f.json: /rate_hz: out of range (found 0.05; allowed: a number from 0.1 to 10000 Hz)"},
        {"{\"rate_hz\": true}",
         "f.json: /rate_hz: wrong type (found true; allowed: a number from 0.1 to 10000 Hz)"},
        {"{\"enabled\": 1}", "f.json: /enabled: wrong type (found 1; allowed: true or false)"},
        {"{\"enabled\": \"true\"}",
         "f.json: /enabled: wrong type (found \"true\"; allowed: true or false)"},
        {"{\"name\": \"12345678\"}",
         "f.json: /name: too long (found \"12345678\"; allowed: a string of at most 7 bytes)"},
        {"{\"name\": 7}",
         "f.json: /name: wrong type (found 7; allowed: a string of at most 7 bytes)"},
        {"{\"kind\": \"Ideal\"}",
         "f.json: /kind: unknown choice (found \"Ideal\"; allowed: "
         "\"ideal\", \"two_axis\")"},
        {"{\"kind\": 0}", "f.json: /kind: wrong type (found 0; allowed: \"ideal\", \"two_axis\")"},
        {"{\"axis\": [1, 0]}",
         "f.json: /axis: wrong type (found [1,0]; allowed: an array of 3 numbers)"},
        {"{\"axis\": [1, 0, 2]}",
         "f.json: /axis/2: out of range (found 2; allowed: a number from -1 to 1)"},
        {"{\"axis\": [1, \"0\", 0]}",
         "f.json: /axis/1: wrong type (found \"0\"; allowed: a number from -1 to 1)"},
        {"{\"burns\": {}}",
         "f.json: /burns: wrong type (found {}; allowed: an array of 0 to 2 objects)"},
        {"{\"burns\": [{\"time_s\": 1}, {\"time_s\": 1}, {\"time_s\": 1}]}",
         "f.json: /burns: wrong number of elements (found an array of 3; allowed: an array of 0 "
         "to 2 objects)"},
        {"{\"burns\": [{\"time_s\": 1}, {}]}",
         "f.json: /burns/1/time_s: missing; it is required: Time of the burn."},
        {"{\"burns\": [3]}", "f.json: /burns/0: wrong type (found 3; allowed: an object)"},
        {"{\"seed\": true}", "f.json: /seed: wrong type (found true; " SEEDS},
        {"{\"seed\": -1}", "f.json: /seed: out of range (found -1; " SEEDS},
        {"{\"seed\": 1.5}", "f.json: /seed: not an integer (found 1.5; " SEEDS},
        {"{\"seed\": 1e16}", "f.json: /seed: out of range (found 1e+16; " SEEDS},
        {"{\"seed\": \"1F\"}", "f.json: /seed: not a seed (found \"1F\"; " SEEDS},
        {"{\"seed\": \"\"}", "f.json: /seed: not a seed (found \"\"; " SEEDS},
        {"{\"seed\": \"0x\"}", "f.json: /seed: not a seed (found \"0x\"; " SEEDS},
        {"{\"seed\": \"0x12345678901234567\"}",
         "f.json: /seed: not a seed (found \"0x12345678901234567\"; " SEEDS},
        {"{\"seed\": \"18446744073709551616\"}", /* 2^64 */
         "f.json: /seed: not a seed (found \"18446744073709551616\"; " SEEDS},
        {"{\"seed\": \"0x-1\"}", "f.json: /seed: not a seed (found \"0x-1\"; " SEEDS},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        thing t;
        assert_int_equal(read_text(&ctx, cases[i].text, thing_table, &t), BST_ERR_CONFIG);
        assert_string_equal(ctx.message, cases[i].message);
        assert_null(t.burns.items); /* freed, nothing dangles */
    }
}

/* A long value is cut between characters, not within one. */
static void test_long_value_is_shortened(void **state) {
    (void)state;
    for (int shift = 0; shift < 3; shift++) {
        bst_ctx ctx = {0};
        thing t;
        char text[400];
        int n = sprintf(text, "{\"frames\": \"%.*s", shift, "xx");
        for (int i = 0; i < 60; i++) {
            n += sprintf(text + n, "\xC3\xA9");
        }
        sprintf(text + n, "\"}");
        assert_int_equal(read_text(&ctx, text, thing_table, &t), BST_ERR_CONFIG);
        const char *cut = strstr(ctx.message, "...");
        assert_non_null(cut);
        assert_int_equal((unsigned char)cut[-1], 0xA9);
        assert_int_equal((unsigned char)cut[-2], 0xC3);
    }
}

static void test_defaults(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    thing read, typed;
    bst_assert_ok(&ctx, read_text(&ctx, "{}", thing_table, &read));
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, thing_table, &typed));
    const thing *both[] = {&read, &typed};
    for (int i = 0; i < 2; i++) {
        const thing *t = both[i];
        assert_string_equal(t->name, "thing");
        assert_false(t->enabled);
        assert_int_equal(t->frames, 10);
        /* exact: parsed from short decimal texts */
        bst_assert_close(t->rate_hz, 1000.0, 0.0);
        assert_int_equal(t->kind, 0);
        assert_true(t->seed == 1);
        bst_assert_close(t->axis[2], 1.0, 0.0);
        bst_assert_close(t->jitter.rms_px, 0.5, 0.0);
        assert_true(t->jitter.enabled);
        assert_int_equal(t->burns.count, 0);
    }
    bst_config_free(thing_table, &read);
    bst_config_free(thing_table, &typed);
    burn b;
    assert_int_equal(bst_config_defaults(&ctx, burn_table, &b), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "defaults: /time_s: missing; it is required: Time of the burn.");
}

static const char full[] =
    "{\"$schema\": \"x\", \"description\": \"d\", \"name\": \"abcdefg\", \"enabled\": true,"
    "\"frames\": 1000, \"big\": -9007199254740991, \"rate_hz\": 0.1, \"kind\": \"two_axis\","
    "\"seed\": \"0xFFFFFFFFFFFFFFFF\", \"axis\": [0.1, -0.30000000000000004, 1e-300],"
    "\"jitter\": {\"rms_px\": 3.3333333333333335, \"enabled\": false},"
    "\"burns\": [{\"time_s\": 100, \"dv_mps\": [0, 10, 0]}, {\"time_s\": 7e-7}],"
    "\"modules\": {\"anything\": [1, {}]}}";

static void assert_same(const thing *a, const thing *b) {
    assert_string_equal(a->name, b->name);
    assert_int_equal(a->enabled, b->enabled);
    assert_true(a->frames == b->frames && a->big == b->big && a->seed == b->seed);
    assert_true(a->rate_hz == b->rate_hz); /* to the bit: printing keeps 17 digits where needed */
    assert_int_equal(a->kind, b->kind);
    assert_memory_equal(a->axis, b->axis, sizeof a->axis);
    assert_true(a->jitter.rms_px == b->jitter.rms_px);
    assert_int_equal(a->jitter.enabled, b->jitter.enabled);
    assert_int_equal(a->burns.count, b->burns.count);
    const burn *x = a->burns.items, *y = b->burns.items;
    for (int i = 0; i < a->burns.count; i++) {
        assert_true(x[i].time_s == y[i].time_s);
        assert_memory_equal(x[i].dv_mps, y[i].dv_mps, sizeof x[i].dv_mps);
    }
}

static void test_values(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    thing t;
    bst_assert_ok(&ctx, read_text(&ctx, full, thing_table, &t));
    assert_string_equal(t.name, "abcdefg");
    assert_true(t.enabled);
    assert_true(t.big == -9007199254740991);
    assert_true(t.seed == UINT64_MAX);
    assert_int_equal(t.kind, 1);
    assert_int_equal(t.burns.count, 2);
    const burn *burns = t.burns.items;
    bst_assert_close(burns[0].dv_mps[1], 10.0, 0.0); /* exact in binary */
    bst_assert_close(burns[1].time_s, 7e-7, 0.0);    /* the same literal */
    bst_config_free(thing_table, &t);
}

static void test_echo_reads_back(void **state) {
    (void)state;
    const char *const texts[] = {full, "{}"};
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx = {0};
        thing first, second;
        bst_assert_ok(&ctx, read_text(&ctx, texts[i], thing_table, &first));
        cJSON *echo = bst_config_echo(thing_table, &first);
        char *text = cJSON_Print(echo);
        assert_non_null(text);
        bst_assert_ok(&ctx, read_text(&ctx, text, thing_table, &second));
        assert_same(&first, &second);
        free(text);
        cJSON_Delete(echo);
        bst_config_free(thing_table, &first);
        bst_config_free(thing_table, &second);
    }
}

static void test_seeds(void **state) {
    (void)state;
    static const struct {
        const char *text;
        uint64_t seed;
    } cases[] = {{"{\"seed\": \"0x0\"}", 0},
                 {"{\"seed\": \"0x1f\"}", 0x1F},
                 {"{\"seed\": \"0xDEADBEEFcafe\"}", 0xDEADBEEFCAFE},
                 {"{\"seed\": \"0x0020000000000001\"}", 0x20000000000001}}; /* beyond 2^53 */
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        thing t;
        bst_assert_ok(&ctx, read_text(&ctx, cases[i].text, thing_table, &t));
        assert_true(t.seed == cases[i].seed);
        bst_config_free(thing_table, &t);
    }
}

static void test_override_reaches_the_struct(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    thing t;
    bst_json *json = NULL;
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "f.json", full, strlen(full), &json));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/kind=ideal"));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/burns/1/time_s=12.5"));
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/seed=0xA"));
    bst_assert_ok(&ctx, bst_config_read(&ctx, json, bst_json_root(json), "", thing_table, &t));
    assert_int_equal(t.kind, 0);
    assert_true(t.seed == 10);
    bst_assert_close(((const burn *)t.burns.items)[1].time_s, 12.5, 0.0); /* exact in binary */
    bst_config_free(thing_table, &t);
    bst_assert_ok(&ctx, bst_json_set(&ctx, json, "/jitter/rms=1"));
    assert_int_equal(bst_config_read(&ctx, json, bst_json_root(json), "", thing_table, &t),
                     BST_ERR_CONFIG);
    assert_string_equal(ctx.message, "f.json: /jitter/rms: unknown key; did you mean \"rms_px\"?");
    bst_json_free(json);
}

static void test_schema(void **state) {
    (void)state;
    static const bst_config_desc table[] = {
        BST_STRING(thing, name, NULL, "Name."),
        BST_INT(thing, frames, "", 1, 1000, "10", "Frames."),
        BST_REAL(thing, rate_hz, "Hz", 0.5, INFINITY, "1000", "Rate."),
        BST_BOOL(thing, enabled, "false", "Switch."),
        BST_ENUM(thing, kind, kinds, "\"ideal\"", "Kind."),
        BST_SEED(thing, seed, "\"0x1\"", "Seed."),
        BST_REALS(thing, axis, "", -1, 1, "[0, 0, 1]", "Axis."),
        BST_OBJECT(thing, jitter, jitter_table, "{}", "Jitter."),
        BST_LIST(thing, burns, burn, burn_table, 0, 2, "[]", "Burns."),
        {.key = "modules", .type = BST_CONFIG_RAW, .unit = "", .doc = "Module blocks."},
        BST_CONFIG_END};
    static const char expected[] =
        "{\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"
        "\"name\":{\"type\":\"string\",\"maxLength\":7,\"description\":\"Name.\"},"
        "\"frames\":{\"type\":\"integer\",\"minimum\":1,\"maximum\":1000,"
        "\"description\":\"Frames.\",\"default\":10},"
        "\"rate_hz\":{\"type\":\"number\",\"minimum\":0.5,\"description\":\"Rate. [Hz]\","
        "\"default\":1000},"
        "\"enabled\":{\"type\":\"boolean\",\"description\":\"Switch.\",\"default\":false},"
        "\"kind\":{\"enum\":[\"ideal\",\"two_axis\"],\"description\":\"Kind.\","
        "\"default\":\"ideal\"},"
        "\"seed\":{\"type\":[\"string\",\"integer\"],\"pattern\":\"^(0x[0-9a-fA-F]{1,16}|[0-9]{1,"
        "20})$\","
        "\"minimum\":0,\"maximum\":9007199254740991,"
        "\"description\":\"Seed.\",\"default\":\"0x1\"},"
        "\"axis\":{\"type\":\"array\",\"minItems\":3,\"maxItems\":3,\"items\":{"
        "\"type\":\"number\",\"minimum\":-1,\"maximum\":1},\"description\":\"Axis.\","
        "\"default\":[0,0,1]},"
        "\"jitter\":{\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"
        "\"rms_px\":{\"type\":\"number\",\"minimum\":0,\"maximum\":10,"
        "\"description\":\"Jitter. [px]\",\"default\":0.5},"
        "\"enabled\":{\"type\":\"boolean\",\"description\":\"Whether it jitters.\","
        "\"default\":true},\"description\":{\"type\":\"string\"}},"
        "\"description\":\"Jitter.\"},"
        "\"burns\":{\"type\":\"array\",\"minItems\":0,\"maxItems\":2,\"items\":{"
        "\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"
        "\"time_s\":{\"type\":\"number\",\"minimum\":0,\"maximum\":1000000,"
        "\"description\":\"Time of the burn. [s]\"},"
        "\"dv_mps\":{\"type\":\"array\",\"minItems\":3,\"maxItems\":3,\"items\":{"
        "\"type\":\"number\",\"minimum\":-100,\"maximum\":100},"
        "\"description\":\"Change of velocity. [m/s]\",\"default\":[0,0,0]},"
        "\"description\":{\"type\":\"string\"}},\"required\":[\"time_s\"]},"
        "\"description\":\"Burns.\",\"default\":[]},"
        "\"modules\":{\"description\":\"Module blocks.\"},"
        "\"description\":{\"type\":\"string\"}},\"required\":[\"name\"]}";
    cJSON *schema = bst_config_schema(table);
    char *text = cJSON_PrintUnformatted(schema);
    assert_non_null(text);
    assert_string_equal(text, expected);
    free(text);
    cJSON_Delete(schema);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(seeds_are_decimal_or_hexadecimal),
        cmocka_unit_test(test_messages),
        cmocka_unit_test(test_long_value_is_shortened),
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_echo_reads_back),
        cmocka_unit_test(test_seeds),
        cmocka_unit_test(test_override_reaches_the_struct),
        cmocka_unit_test(test_stage),
        cmocka_unit_test(test_schema),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
