#include <stdint.h>

#include "sim/core/pages.h"
#include "tests/test_support.h"

/* Any size, from none on, is aligned for vectors and all the caller's; what cannot be is NULL. */
static void memory_of_any_size_is_aligned(void **state) {
    (void)state;
    const size_t sizes[] = {0, 1, 4096, 4194303, 4194304, 4194305, 50000000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        unsigned char *memory = bst_pages_alloc(sizes[i]);
        assert_non_null(memory);
        assert_int_equal((uintptr_t)memory % 64, 0);
        memset(memory, 0xA5, sizes[i]);
        if (sizes[i] >= (size_t)4 << 20) {
            assert_int_equal((uintptr_t)memory % ((size_t)2 << 20), 0);
        }
        free(memory);
    }
    assert_null(bst_pages_alloc(SIZE_MAX));
    assert_null(bst_pages_alloc(SIZE_MAX / 2 + 1));
}

/* Zeros of any size, also where an array that was freed before has left other content. */
static void zeros_of_any_size(void **state) {
    (void)state;
    const size_t sizes[] = {0, 1, 100, 32703, 32704, 100000, 3000000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        for (int round = 0; round < 2; round++) {
            unsigned char *memory = bst_pages_zero(sizes[i], 1);
            assert_non_null(memory);
            for (size_t k = 0; k < sizes[i]; k++) {
                assert_int_equal(memory[k], 0);
                memory[k] = 0xA5;
            }
            bst_pages_free(memory);
        }
    }
    bst_pages_free(NULL);
    assert_null(bst_pages_zero(SIZE_MAX, 1));
    assert_null(bst_pages_zero(SIZE_MAX / 4, 8));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_of_any_size_is_aligned),
        cmocka_unit_test(zeros_of_any_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
