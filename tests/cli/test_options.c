/* Option parsing: every form, and the message of every mistake. */
#include "sim/cli/options.h"
#include "tests/test_support.h"

typedef struct values {
    bool verbose, help;
    const char *out;
    int64_t seed;
    double step_s;
    int frame;
    bst_option_list set;
    int64_t size;
} values;

enum { TABLE_LENGTH = 10, MOST_WORDS = 600 };

static void make_table(values *v, bst_option table[TABLE_LENGTH]) {
    const bst_option entries[TABLE_LENGTH] = {
        {.name = "verbose", .kind = BST_OPTION_FLAG, .target = &v->verbose, .doc = "Say more."},
        {.name = "out",
         .kind = BST_OPTION_TEXT,
         .target = &v->out,
         .argument = "FOLDER",
         .path = BST_PATH_INPUT,
         .doc = "Where to write.",
         .required = true},
        {.name = "seed",
         .kind = BST_OPTION_INT,
         .target = &v->seed,
         .argument = "N",
         .doc = "Seed.",
         .minimum = -5,
         .maximum = 9007199254740992.0},
        {.name = "step",
         .kind = BST_OPTION_REAL,
         .target = &v->step_s,
         .argument = "S",
         .doc = "Step.",
         .minimum = 0.001,
         .maximum = 1e6},
        {.name = "frame",
         .kind = BST_OPTION_CHOICE,
         .target = &v->frame,
         .argument = "teme|gcrf",
         .doc = "Frame."},
        {.name = "set",
         .kind = BST_OPTION_LIST,
         .target = &v->set,
         .argument = "/PATH=VALUE",
         .doc = "Override."},
        {.name = "seeds",
         .kind = BST_OPTION_INT,
         .target = &v->seed,
         .argument = "N",
         .doc = "The same.",
         .maximum = 9},
        {.name = "size",
         .kind = BST_OPTION_INT,
         .target = &v->size,
         .argument = "N",
         .doc = "Size.",
         .maximum = 9,
         .needs = "step|set|verbose"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &v->help, .doc = "This text."},
        {.name = NULL}};
    memcpy(table, entries, sizeof entries);
}

/* Parses the words of a line; the words are kept by the caller's buffer. */
static bst_status parse(bst_ctx *ctx, values *v, char *line, char *argv[MOST_WORDS],
                        int *arguments) {
    bst_option table[TABLE_LENGTH];
    memset(v, 0, sizeof *v);
    v->frame = -1;
    make_table(v, table);
    int argc = 0;
    char *save = NULL;
    argv[argc++] = line;
    for (char *word = strtok_r(line, " ", &save); word; word = strtok_r(NULL, " ", &save)) {
        argv[argc++] = word;
    }
    return bst_options_parse(ctx, table, argc, argv, arguments);
}

static void test_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    values v;
    char *argv[MOST_WORDS];
    int arguments = -1;
    char line[] =
        "a.json --out x --seed=7 --step 2.5e-1 --frame gcrf --set /a=1 b.json --set=/b=2 "
        "--verbose -- --c.json";
    bst_assert_ok(&ctx, parse(&ctx, &v, line, argv, &arguments));
    assert_string_equal(v.out, "x");
    assert_int_equal(v.seed, 7);
    bst_assert_close(v.step_s, 0.25, 0.0); /* 0.25 is exact in binary */
    assert_int_equal(v.frame, 1);
    assert_int_equal(v.set.count, 2);
    assert_string_equal(v.set.items[0], "/a=1");
    assert_string_equal(v.set.items[1], "/b=2");
    assert_true(v.verbose);
    assert_false(v.help);
    assert_int_equal(arguments, 3);
    assert_string_equal(argv[1], "a.json");
    assert_string_equal(argv[2], "b.json");
    assert_string_equal(argv[3], "--c.json");
}

static void test_repeated_flags_and_negative_numbers(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    values v;
    char *argv[MOST_WORDS];
    int arguments;
    char line[] = "--out - --seed -5 --verbose --frame teme --size 3 --verbose";
    bst_assert_ok(&ctx, parse(&ctx, &v, line, argv, &arguments));
    assert_int_equal(v.seed, -5);
    assert_string_equal(v.out, "-");
    assert_int_equal(v.frame, 0);
    assert_int_equal(arguments, 0);
}

static void test_help_wins(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    values v;
    char *argv[MOST_WORDS];
    char lines[2][40] = {"--help --nonsense", "-h"};
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&ctx, parse(&ctx, &v, lines[i], argv, NULL));
        assert_true(v.help);
    }
}

static void test_messages(void **state) {
    (void)state;
    static const struct {
        const char *line, *message;
    } cases[] = {
        {"--out x --sed 3", "unknown option --sed; did you mean --seed?"},
        {"--out x --seed 3 --seed 4", "--seed is given twice: give it once"},
        {"--out x --out x", "--out is given twice: give it once"},
        {"--out x --frame gcrf --frame=teme", "--frame is given twice: give it once"},
        {"--out x --seeds 3 --seed 4", "--seed and --seeds are the same: give one of them"},
        {"--out x --size 3",
         "--size has no effect without --step, --set or --verbose: add it or leave --size out"},
        {"--out x --seed 0x10", "--seed 0x10: give an integer from -5 to 9007199254740992"},
        {"--out x --step infinity", "--step infinity: give a number from 0.001 to 1000000"},
        {"--out x --step 1e", "--step 1e: give a number from 0.001 to 1000000"},
        {"--out x --vrbose", "unknown option --vrbose; did you mean --verbose?"},
        {"--out x --fram=teme", "unknown option --fram=teme; did you mean --frame?"},
        {"--out x --zzzzzzzz", "unknown option --zzzzzzzz"},
        {"--out x -v", "unknown option -v"},
        {"-out x", "unknown option -out; did you mean --out?"},
        {"--out", "--out needs a value: --out FOLDER"},
        {"--out --verbose", "--out needs a value: --out FOLDER"},
        {"--out=", "--out needs a value: --out FOLDER"},
        {"--verbose", "--out is missing: add --out FOLDER"},
        {"", "--out is missing: add --out FOLDER"},
        {"--out x --verbose=1", "--verbose takes no value"},
        {"--out x --seed 1.5", "--seed 1.5: give an integer from -5 to 9007199254740992"},
        {"--out x --seed 99999999999999999",
         "--seed 99999999999999999: give an integer from -5 to 9007199254740992"},
        {"--out x --step 0", "--step 0: give a number from 0.001 to 1000000"},
        {"--out x --step nan", "--step nan: give a number from 0.001 to 1000000"},
        {"--out x --step 1e400", "--step 1e400: give a number from 0.001 to 1000000"},
        {"--out x --step 5s", "--step 5s: give a number from 0.001 to 1000000"},
        {"--out x --step=", "--step : give a number from 0.001 to 1000000"},
        {"--out x --frame tem", "--frame tem: give one of teme|gcrf"},
        {"--out x stray", "\"stray\" is not expected here: every value follows its option"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bst_ctx ctx = {0};
        values v;
        char *argv[MOST_WORDS];
        char line[200];
        snprintf(line, sizeof line, "%s", cases[i].line);
        assert_int_equal(parse(&ctx, &v, line, argv, NULL), BST_ERR_ARGUMENT);
        assert_string_equal(ctx.message, cases[i].message);
    }
}

static void test_space_before_a_number(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    values v = {0};
    bst_option table[TABLE_LENGTH];
    make_table(&v, table);
    char words[][8] = {"x", "--out", "x", "--step", " 5"};
    char *argv[] = {words[0], words[1], words[2], words[3], words[4]};
    assert_int_equal(bst_options_parse(&ctx, table, 5, argv, NULL), BST_ERR_ARGUMENT);
    assert_string_equal(ctx.message, "--step  5: give a number from 0.001 to 1000000");
}

static void test_list_is_bounded(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    values v;
    char *argv[MOST_WORDS];
    char line[4000] = "--out x";
    for (int i = 0; i < BST_OPTION_LIST_MAX; i++) {
        strcat(line, " --set a");
    }
    char one_more[4000];
    snprintf(one_more, sizeof one_more, "%.3900s --set a", line);
    bst_assert_ok(&ctx, parse(&ctx, &v, line, argv, NULL));
    assert_int_equal(v.set.count, BST_OPTION_LIST_MAX);
    assert_int_equal(parse(&ctx, &v, one_more, argv, NULL), BST_ERR_ARGUMENT);
    assert_string_equal(ctx.message, "--set is given more than 256 times");
}

static void test_print(void **state) {
    (void)state;
    values v;
    bst_option table[TABLE_LENGTH];
    make_table(&v, table);
    char text[800] = "";
    FILE *stream = fmemopen(text, sizeof text, "w");
    assert_non_null(stream);
    bst_options_print(stream, table);
    fclose(stream);
    assert_string_equal(text,
                        "  --verbose          Say more.\n"
                        "  --out FOLDER       Where to write.\n"
                        "  --seed N           Seed.\n"
                        "  --step S           Step.\n"
                        "  --frame teme|gcrf  Frame.\n"
                        "  --set /PATH=VALUE  Override.\n"
                        "  --seeds N          The same.\n"
                        "  --size N           Size.\n"
                        "  --help             This text.\n");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_forms),
        cmocka_unit_test(test_repeated_flags_and_negative_numbers),
        cmocka_unit_test(test_help_wins),
        cmocka_unit_test(test_messages),
        cmocka_unit_test(test_space_before_a_number),
        cmocka_unit_test(test_list_is_bounded),
        cmocka_unit_test(test_print),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
