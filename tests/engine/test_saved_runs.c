/* Engines of random make that are saved at a random tick and restored in another engine go on as if
 * they had not been saved.
 *
 *   test_engine_saved_runs [ENGINES [FIRST_SEED]]
 */
#include "tests/engine/random_engine.h"

static int engines = 16;
static uint64_t first_seed = 1;

/* A run that is saved at a random tick and restored in another engine gives the records, counters
 * and steps of a run without interruption, with any number of threads before and after. */
static void saved_runs_go_on(void **state) {
    (void)state;
    static const int threads[] = {0, 1, 3};
    uint64_t r = mix(first_seed, 9);
    for (int k = 0; k < engines; k++) {
        make m = make_of(first_seed + (uint64_t)k);
        m.stops_at = m.full_at = m.fails_at = -1;
        scene *whole = new_scene(&m, false);
        result expected = play(whole, 0);
        for (int trial = 0; trial < 4; trial++) {
            bst_ctx ctx = {0};
            scene *s = new_scene(&m, false);
            saving save = {.tick = 1 + below(&r, END - 2)};
            int before = threads[below(&r, 3)], after = threads[below(&r, 3)];
            bst_assert_ok(&ctx, bst_archive_create(&ctx, &save.archive));
            result first = play_part(s, before, &save, NULL);
            assert_int_equal(first.status, BST_OK);
            int made[MOST_SENSORS];
            for (int i = 0; i < m.sensors; i++) {
                made[i] = s->pools[i].made;
                assert_int_equal(s->pools[i].recycled, made[i]);
            }
            size_t size;
            const void *bytes = bst_archive_data(save.archive, &size);
            saving restored = {.tick = save.tick};
            bst_assert_ok(&ctx, bst_archive_open(&ctx, bytes, size, &restored.archive));
            result last = play_part(s, after, NULL, &restored);
            for (int i = 0; i < s->count && i < whole->count; i++) {
                if (s->records[i] != whole->records[i]) {
                    fail_msg("seed %llu, saved at %lld, %d and %d threads: record %d of %d differs",
                             (unsigned long long)m.seed, (long long)save.tick, before, after, i,
                             whole->count);
                }
            }
            assert_int_equal(s->count, whole->count);
            assert_int_equal(s->faults, 0);
            assert_int_equal(last.status, expected.status);
            assert_int_equal(last.reported, expected.reported);
            assert_int_equal(last.stale, expected.stale);
            assert_int_equal(last.overflow, expected.overflow);
            assert_int_equal(last.steps, expected.steps);
            bst_archive_free(restored.archive);
            bst_archive_free(save.archive);
            test_free(s);
        }
        test_free(whole);
    }
}

int main(int argc, char **argv) {
    engines = argc > 1 ? atoi(argv[1]) : engines;
    first_seed = argc > 2 ? (uint64_t)atoll(argv[2]) : first_seed;
    const struct CMUnitTest tests[] = {cmocka_unit_test(saved_runs_go_on)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
