/* Each index once, whatever the number of threads. */
#include "sim/core/parallel.h"

#include <stdlib.h>

#include "tests/test_support.h"

enum { COUNT = 10007 };

static void add_one(void *user, int begin, int end) {
    int *hits = user;
    for (int i = begin; i < end; i++) {
        hits[i]++;
    }
}

static void each_index_once(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static int hits[COUNT];
    for (int threads = 0; threads <= 4; threads++) {
        bst_parallel *pool = NULL;
        if (threads > 0) {
            bst_assert_ok(&ctx, bst_parallel_create(&ctx, threads, &pool));
            assert_int_equal(bst_parallel_threads(pool), threads);
        }
        memset(hits, 0, sizeof hits);
        for (int round = 0; round < 50; round++) {
            bst_parallel_for(pool, COUNT, 1 + 37 * round, add_one, hits);
            bst_parallel_for(pool, 0, 1, add_one, hits);
        }
        for (int i = 0; i < COUNT; i++) {
            assert_int_equal(hits[i], 50);
        }
        bst_parallel_free(pool);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_index_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
