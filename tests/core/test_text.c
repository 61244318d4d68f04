/* Distances of words, by hand from the definition (Levenshtein 1966). */
#include "sim/core/text.h"
#include "tests/test_support.h"

static void test_distance(void **state) {
    (void)state;
    assert_int_equal(bst_text_distance("", ""), 0);
    assert_int_equal(bst_text_distance("", "abc"), 3);
    assert_int_equal(bst_text_distance("abc", ""), 3);
    assert_int_equal(bst_text_distance("kitten", "sitting"), 3);
    assert_int_equal(bst_text_distance("rate_hz", "rate_hz"), 0);
    assert_int_equal(bst_text_distance("flaw", "lawn"), 2);
    char longest[66];
    memset(longest, 'a', sizeof longest);
    longest[64] = '\0';
    assert_int_equal(bst_text_distance(longest, ""), 64);
    longest[64] = 'a';
    longest[65] = '\0';
    assert_int_equal(bst_text_distance(longest, longest), 64); /* too long to be compared */
}

static void test_nearer(void **state) {
    (void)state;
    size_t best = SIZE_MAX;
    assert_false(bst_text_is_nearer("xyz", "ab", &best)); /* no letter in common */
    assert_true(bst_text_is_nearer("stap", "start", &best));
    assert_int_equal(best, 2);
    assert_true(bst_text_is_nearer("stap", "step", &best));
    assert_int_equal(best, 1);
    assert_false(bst_text_is_nearer("stap", "stop", &best)); /* as near: the first holds */
    best = SIZE_MAX;
    assert_true(bst_text_is_nearer("rate", "rate_multiplier_hz", &best));
    assert_int_equal(best, 1);
}

static void test_file_name(void **state) {
    (void)state;
    static const char *const good[] = {"a", "my run 3", "a..b", "x.", "caf\xc3\xa9"};
    static const char *const bad[] = {"",    ".",    "..",    ".hidden", "../x",
                                      "a/b", "a\nb", "a\x7f", "/"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        assert_true(bst_text_is_file_name(good[i]));
    }
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_false(bst_text_is_file_name(bad[i]));
    }
    char name[257];
    memset(name, 'a', 256);
    name[256] = '\0';
    assert_false(bst_text_is_file_name(name));
    assert_true(bst_text_is_file_name(name + 1));
}

static void test_ends_in(void **state) {
    (void)state;
    assert_true(bst_text_ends_in("a/frame.FITS", ".fits"));
    assert_true(bst_text_ends_in("list.txt", ".txt"));
    assert_false(bst_text_ends_in(".txt", ".txt"));
    assert_false(bst_text_ends_in("txt", ".txt"));
    assert_false(bst_text_ends_in("list.txt.gz", ".txt"));
    assert_false(bst_text_ends_in("", ".txt"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distance),
        cmocka_unit_test(test_nearer),
        cmocka_unit_test(test_file_name),
        cmocka_unit_test(test_ends_in),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
