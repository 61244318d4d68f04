/* Element-set files that are wrong. The format's own faults, column by column: tests/astro. */
#include "sim/astro/tle.h"
#include "tests/bad_input/faults.h"

/* Public element sets of the US space catalogue, June 2022. */
#define GOES_1 "1 10061U 77048A   22166.94040701  .00000081  00000+0  00000+0 0  9993"
#define GOES_2 "2 10061   9.8539 307.1213 0011382  31.5637 332.0402  0.99393421 31740"

static bst_status read_tle(bst_ctx *ctx, const char *path) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_status status = bst_tle_load(ctx, path, NULL, &sets, &count);
    assert_true((status == BST_OK) == (sets != NULL && count > 0));
    free(sets);
    return status;
}

static const bad_reader reader = {read_tle, "a file of two-line element sets", "", 256 << 20};

static void paths(void **state) {
    (void)state;
    bad_paths(&reader);
}

static void exact_messages(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", ":1: the file is empty (expected two-line element sets)"},
        {"\n \n# nothing\n",
         ":1: the file holds no element set (expected "
         "two-line element sets)"},
        {"{\"OBJECT_NAME\": \"GOES\"}",
         ":1: the file ends within an element set (found \"{\"OBJECT_NAME\": \"GOES\"}\", expected "
         "a line that starts with \"1 \" after it)"},
        {GOES_1 "\n" GOES_2 "\n3 10061\n",
         ":3: the file ends within an element set (found \"3 10061\", expected a line that starts "
         "with \"1 \" after it)"},
        {GOES_1 "\n" GOES_2 "0\n",
         ":2: line 2 of the set goes on after column 69 (found \"0\", expected 69 characters)"},
        {GOES_1 "\n" GOES_1 "\n" GOES_2,
         ":2: element set has no line 2 (found \"" GOES_1 "\", expected a line that starts with "
         "\"2 \")"},
        {GOES_1 "\n2 10061      nan 307.1213 0011382  31.5637 332.0402  0.99393421 31746\n",
         ":2: columns 9-16: inclination is not a number (found \"     nan\", expected 0 to 180 "
         "degrees)"},
        {GOES_1 "\n2 10061   1e400  307.1213 0011382  31.5637 332.0402  0.99393421 31741\n",
         ":2: columns 9-16: inclination is not a number (found \"  1e400 \", expected 0 to 180 "
         "degrees)"},
        {"GOES \xFC\n" GOES_1 "\n" GOES_2,
         ":1: name has a character that is not printable ASCII (found \"GOES \\xFC\", expected a "
         "plain ASCII name)"},
        {"\xFF\xFEG", ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bad_text(&reader, cases[i].text, BST_ERR_FORMAT, cases[i].message);
    }
    char wide[400];
    size_t bytes = bad_utf16("GOES\n" GOES_1 "\n" GOES_2 "\n", false, false, wide);
    bad_bytes(&reader, wide, bytes, BST_ERR_FORMAT,
              ":1: a zero byte: the file is not text (allowed: ASCII or UTF-8)");
    bad_bytes(&reader, GOES_1 "\n" GOES_2 "\n\0", 141, BST_ERR_FORMAT,
              ":3: a zero byte: the file is not text (allowed: ASCII or UTF-8)");
}

/* A cut file is never taken for a whole one, but where it is cut between two sets. */
static void every_truncation(void **state) {
    (void)state;
    static const char text[] = "GOES\n" GOES_1 "\n" GOES_2 "\n" GOES_1 "\n" GOES_2 "\n";
    const size_t one = 4 + 1 + 69 + 1 + 69, two = one + 1 + 69 + 1 + 69;
    for (size_t n = 0; n < sizeof text; n++) {
        char *copy = malloc(n + 1);
        assert_non_null(copy);
        memcpy(copy, text, n);
        bst_ctx ctx = {0};
        bst_elements *sets = NULL;
        int count = 0;
        bst_status status = bst_tle_read_buffer(&ctx, "x", copy, n, NULL, &sets, &count);
        bool whole = n == one || n == one + 1 || n == two || n == two + 1;
        assert_int_equal(status, whole ? BST_OK : BST_ERR_FORMAT);
        assert_int_equal(count, whole ? (n >= two ? 2 : 1) : 0);
        free(sets);
        free(copy);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths),
        cmocka_unit_test(exact_messages),
        cmocka_unit_test(every_truncation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
