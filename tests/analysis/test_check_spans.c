/* Words for spans of time of a warning. */
#include "sim/analysis/check/check_spans.h"
#include "tests/test_support.h"

static void words(void **state) {
    (void)state;
    static const struct {
        double spans[3][2];
        int count;
        double examined_s, duration_s;
        const char *from, *more;
    } cases[] = {
        {{{1, 2.25}}, 1, 100, 100, "from 1.0 s until 2.2 s", ""},
        {{{1, 2}, {5, 7.5}, {80, 100}},
         3,
         100,
         100,
         "from 1.0 s until 2.0 s",
         " (the first of 3 times, 24 s in all)"},
        {{{30, 100}}, 1, 100, 100, "from 30.0 s until the end of the run", ""},
        {{{30, 86400}},
         1,
         86400,
         1e6,
         "from 30.0 s until the end of the time that was examined",
         " in the first 1 days"},
        {{{30, 40}, {50, 70}},
         2,
         129600,
         1e6,
         "from 30.0 s until 40.0 s",
         " (the first of 2 times, 30 s in all) in the first 1.5 days"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_check_spans s = {0};
        for (int k = 0; k < cases[i].count; k++) {
            bst_check_spans_add(&s, cases[i].spans[k][0], cases[i].spans[k][1]);
        }
        assert_int_equal(s.count, cases[i].count);
        bst_check_span_words w = bst_check_spans_word(&s, cases[i].examined_s, cases[i].duration_s);
        assert_string_equal(w.from, cases[i].from);
        assert_string_equal(w.more, cases[i].more);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(words)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
