/* Results that a memo keeps: found by function and arguments, the oldest replaced. */
#include "sim/core/memo.h"
#include "tests/test_support.h"

static bst_memo_call call_of(const char *function, const int *argument, double *result) {
    return (bst_memo_call){.function = function,
                           .arguments = argument,
                           .argument_bytes = sizeof *argument,
                           .result = result,
                           .result_bytes = sizeof *result};
}

static void finds_what_it_keeps(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_memo *memo;
    int argument = 3, other = 4;
    double result = 1.5, found = 0.0;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&ctx, bst_memo_create(&ctx, &memo));
    const bst_memo_call kept = call_of("f", &argument, &result);
    const bst_memo_call same = call_of("f", &argument, &found);
    const bst_memo_call another_argument = call_of("f", &other, &found);
    const bst_memo_call another_function = call_of("g", &argument, &found);
    assert_false(bst_memo_find(memo, &same));
    bst_memo_keep(memo, &kept);
    assert_false(bst_memo_find(memo, &another_argument));
    assert_false(bst_memo_find(memo, &another_function));
    assert_true(found == 0.0);
    assert_true(bst_memo_find(memo, &same));
    assert_true(found == 1.5);
    bst_memo_free(memo);
}

static void replaces_the_oldest(void **state) {
    (void)state;
    enum { MANY = 100 };
    bst_ctx ctx;
    bst_memo *memo;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&ctx, bst_memo_create(&ctx, &memo));
    for (int i = 0; i < MANY; i++) {
        double result = i, found = -1.0;
        const bst_memo_call kept = call_of("f", &i, &result), same = call_of("f", &i, &found);
        bst_memo_keep(memo, &kept);
        assert_true(bst_memo_find(memo, &same));
        assert_true(found == i);
    }
    int first = 0;
    double found = -1.0;
    const bst_memo_call oldest = call_of("f", &first, &found);
    assert_false(bst_memo_find(memo, &oldest));
    bst_memo_free(memo);
}

static void without_a_memo_nothing_is_kept(void **state) {
    (void)state;
    int argument = 3;
    double result = 1.5;
    const bst_memo_call call = call_of("f", &argument, &result);
    bst_memo_keep(NULL, &call);
    assert_false(bst_memo_find(NULL, &call));
    bst_memo_free(NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_it_keeps),
        cmocka_unit_test(replaces_the_oldest),
        cmocka_unit_test(without_a_memo_nothing_is_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
