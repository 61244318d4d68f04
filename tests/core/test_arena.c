/* Arrays that are allocated together: aligned, apart from each other, zero; sums that overflow. */
#include <string.h>

#include "sim/core/arena.h"
#include "tests/test_support.h"

typedef struct arrays {
    char *letters;
    double (*rows)[3];
    int *empty, *numbers;
} arrays;

static void lay_out(arrays *a, bst_arena *arena) {
    BST_ARENA_TAKE(arena, a->letters, 5);
    BST_ARENA_TAKE(arena, a->rows, 7);
    BST_ARENA_TAKE(arena, a->empty, 0);
    BST_ARENA_TAKE(arena, a->numbers, 9);
}

static void arrays_do_not_overlap(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_arena arena = {0};
    arrays a;
    lay_out(&a, &arena);
    assert_null(a.letters);
    assert_null(a.numbers);
    assert_true(arena.used >= 5 + 7 * sizeof *a.rows + 9 * sizeof *a.numbers);
    bst_assert_ok(&ctx, bst_arena_alloc(&ctx, &arena, "a test"));
    lay_out(&a, &arena);
    assert_int_equal(arena.used, arena.room);
    assert_int_equal((uintptr_t)a.rows % BST_ARENA_ALIGNMENT, 0);
    assert_int_equal((uintptr_t)a.numbers % BST_ARENA_ALIGNMENT, 0);
    for (int i = 0; i < 9; i++) {
        assert_int_equal(a.numbers[i], 0);
        a.numbers[i] = -1;
    }
    memset(a.letters, 'x', 5);
    for (int i = 0; i < 7; i++) {
        for (int k = 0; k < 3; k++) {
            assert_true(a.rows[i][k] == 0.0);
            a.rows[i][k] = 1.0;
        }
    }
    assert_memory_equal(a.letters, "xxxxx", 5);
    assert_int_equal(a.numbers[0], -1);
    bst_arena_free(&arena);
    assert_null(arena.memory);
}

static void overflow_is_no_memory(void **state) {
    (void)state;
    const size_t counts[2][2] = {{SIZE_MAX / 4, 1}, {SIZE_MAX / 8, SIZE_MAX / 8}};
    const size_t bytes[2] = {8, 4};
    for (int k = 0; k < 2; k++) {
        bst_ctx ctx = {0};
        bst_arena arena = {0};
        (void)bst_arena_take(&arena, counts[k][0], bytes[k]);
        (void)bst_arena_take(&arena, counts[k][1], bytes[k]);
        (void)bst_arena_take(&arena, counts[k][1], bytes[k]);
        assert_int_equal(arena.overflow, true);
        assert_int_equal(bst_arena_alloc(&ctx, &arena, "a test"), BST_ERR_MEMORY);
        bst_arena_free(&arena);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(arrays_do_not_overlap),
        cmocka_unit_test(overflow_is_no_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
