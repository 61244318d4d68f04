/* Engines of random make give the same on any number of threads: what observers see and in which
 * order, what is counted, how a run fails.
 *
 *   test_engine_executor [ENGINES [FIRST_SEED]]
 */
#include "tests/engine/random_engine.h"

static void assert_same(const make *m, const scene *serial, const result *expected, int threads) {
    scene *s = new_scene(m, true);
    result r = play(s, threads);
    bool stopped = r.status == BST_ERR_INTERRUPTED;
    int count = stopped && s->count < serial->count ? s->count : serial->count;
    for (int i = 0; i < count && i < s->count; i++) {
        if (s->records[i] != serial->records[i]) {
            fail_msg("seed %llu, %d threads: record %d of %d differs", (unsigned long long)m->seed,
                     threads, i, serial->count);
        }
    }
    if (s->count != count || s->faults || (!stopped && r.status != expected->status)) {
        fail_msg("seed %llu, %d threads: %d records of %d, %d faults, status %d of %d: %s",
                 (unsigned long long)m->seed, threads, s->count, serial->count, s->faults,
                 (int)r.status, (int)expected->status, r.message);
    }
    if (!stopped) {
        assert_string_equal(r.message, expected->message);
    }
    if (expected->status == BST_OK && !stopped) { /* after a failure, others may have gone on */
        assert_int_equal(r.reported, expected->reported);
        assert_int_equal(r.stale, expected->stale);
        assert_int_equal(r.overflow, expected->overflow);
        assert_int_equal(r.steps, expected->steps);
    }
    for (int i = 0; i < m->sensors; i++) {
        assert_int_equal(s->pools[i].recycled, s->pools[i].made);
        assert_true(s->pools[i].most <= serial->pools[i].most + BST_OVERLAP_FRAMES);
    }
    test_free(s);
}

static int engines = 16;
static uint64_t first_seed = 1;

static void assert_threads_change_nothing(const make *m) {
    static const int threads[] = {1, 2, 3, 8};
    make whole = *m;
    whole.stops_at = -1;
    scene *serial = new_scene(&whole, false);
    result expected = play(serial, 0);
    assert_in_range(serial->count, 20, RECORDS - 1);
    for (int t = 0; t < 4; t++) {
        assert_same(m, serial, &expected, threads[t]);
    }
    test_free(serial);
}

static void threads_change_nothing(void **state) {
    (void)state;
    for (int k = 0; k < engines; k++) {
        make m = make_of(first_seed + (uint64_t)k);
        assert_threads_change_nothing(&m);
    }
}

/* Multi-sensor modules that step before the step that fails, in its tick, are observed. */
static void failures_leave_what_came_before(void **state) {
    (void)state;
    for (int k = 0; k < 12; k++) {
        make m = {.seed = first_seed + (uint64_t)k,
                  .sensors = 2,
                  .links = 1,
                  .closed = true,
                  .link_first = true,
                  .wakes = k % 2,
                  .fails_at = 200 + k,
                  .fails_module = k % 3 == 0   ? CAMERA
                                  : k % 3 == 1 ? SEEING
                                               : ROLES + FOLLOWING,
                  .full_at = -1,
                  .stops_at = -1,
                  .link_period = 1};
        assert_threads_change_nothing(&m);
    }
}

int main(int argc, char **argv) {
    engines = argc > 1 ? atoi(argv[1]) : engines;
    first_seed = argc > 2 ? (uint64_t)atoll(argv[2]) : first_seed;
    const struct CMUnitTest tests[] = {cmocka_unit_test(threads_change_nothing),
                                       cmocka_unit_test(failures_leave_what_came_before)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
