/* Options of boresight export: what they mean, and what does not go together. */
#include "sim/export/export_request.h"
#include "tests/test_support.h"

enum { WORDS = 6 };

/* Reads a command line as the command does. */
static bst_status read_line(bst_ctx *ctx, bst_export_request *r, const char *const given[WORDS],
                            char words[WORDS + 1][64]) {
    char *argv[WORDS + 2];
    bst_option table[BST_OPTIONS_MAX];
    int argc = 1, arguments = 0;
    snprintf(words[0], 64, "export");
    argv[0] = words[0];
    for (; argc <= WORDS && given[argc - 1]; argc++) {
        snprintf(words[argc], 64, "%s", given[argc - 1]);
        argv[argc] = words[argc];
    }
    *r = (bst_export_request)BST_EXPORT_REQUEST_DEFAULTS;
    bst_options_bind(bst_export_options, r, table);
    bst_assert_ok(ctx, bst_options_parse(ctx, table, argc, argv, &arguments));
    assert_int_equal(arguments, 1);
    return bst_export_request_settle(ctx, r);
}

static void test_defaults(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_export_request r;
    char words[WORDS + 1][64];
    bst_assert_ok(&ctx,
                  read_line(&ctx, &r, (const char *[WORDS]){"run", "--frames", "png"}, words));
    assert_false(r.parts.e.film || r.parts.e.each_stretch || r.parts.e.czml);
    assert_true(r.parts.e.first == 0 && r.parts.e.every == 1 && r.parts.e.last >= 9007199254740991);
    assert_int_equal(r.parts.e.image_bits, 16);
    assert_true(r.parts.e.box_px == 20.0 && r.parts.e.star_limit == 10.0);
    assert_int_equal(r.parts.table, BST_EXPORT_NOT);
}

static void test_words_become_formats(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_export_request r;
    char words[WORDS + 1][64];
    bst_assert_ok(&ctx, read_line(&ctx, &r,
                                  (const char *[WORDS]){"run", "--frames=mp4", "--fps=25",
                                                        "--stretch=frame", "--orbits=czml"},
                                  words));
    assert_true(r.parts.e.film && r.parts.e.each_stretch && r.parts.e.czml);
    assert_true(r.parts.e.frame_rate == 25.0);
    bst_assert_ok(
        &ctx,
        read_line(&ctx, &r, (const char *[WORDS]){"run", "--observations=csv", "--angles=filtered"},
                  words));
    assert_int_equal(r.parts.e.observation_format, BST_OBSERVATIONS_CSV);
    assert_true(r.parts.e.filtered);
    bst_assert_ok(
        &ctx, read_line(&ctx, &r, (const char *[WORDS]){"run", "--coco=new", "--bits=8"}, words));
    assert_int_equal(r.parts.e.image_bits, 8);
}

static void test_what_does_not_go_together(void **state) {
    (void)state;
    static const struct {
        const char *words[WORDS], *message;
    } cases[] = {
        {{"run"}, "nothing to export"},
        {{"run", "--frames=png", "--first=7", "--last=6"}, "--last 6 is before --first 7"},
        {{"run", "--frames=png", "--fps=5"}, "without --frames mp4"},
        {{"run", "--satnet=new", "--split=80,20"}, "--split"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_export_request r;
        char words[WORDS + 1][64];
        if (read_line(&ctx, &r, cases[i].words, words) != BST_ERR_ARGUMENT ||
            !strstr(ctx.message, cases[i].message)) {
            fail_msg("case %zu: %s", i, ctx.message);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_words_become_formats),
        cmocka_unit_test(test_what_does_not_go_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
