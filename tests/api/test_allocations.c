/* Once its buffers have their size, a simulation steps without allocating memory. Counts what the
 * program and the libraries that are linked statically ask for. */
#include "boresight/boresight.h"
#include "tests/test_support.h"

static int64_t calls;
static bool counting;

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t count, size_t bytes);
void *__real_realloc(void *block, size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t count, size_t bytes);
void *__wrap_realloc(void *block, size_t bytes);

static void count_call(void) {
    if (__atomic_load_n(&counting, __ATOMIC_RELAXED)) {
        __atomic_fetch_add(&calls, 1, __ATOMIC_RELAXED);
    }
}
void *__wrap_malloc(size_t bytes) {
    count_call();
    return __real_malloc(bytes);
}
void *__wrap_calloc(size_t count, size_t bytes) {
    count_call();
    return __real_calloc(count, bytes);
}
void *__wrap_realloc(void *block, size_t bytes) {
    count_call();
    return __real_realloc(block, bytes);
}

/* Steps a scenario from a time to another, counting. */
static int64_t calls_between(const char *scenario, const char *const *assignments, int count,
                             double from_s, double to_s) {
    bst_ctx ctx;
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    const bst_model_options options = {
        .assignments = assignments, .assignment_count = count, .threads = 1};
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&ctx, bst_model_load(&ctx, scenario, &options, &model));
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, NULL, &sim));
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, sim, from_s));
    calls = 0;
    counting = true;
    bst_status status = bst_sim_run_until(&ctx, sim, to_s);
    counting = false;
    bst_assert_ok(&ctx, status);
    bst_sim_free(sim);
    bst_model_free(model);
    return calls;
}

static void images(void **state) {
    (void)state;
    static const char *const small[] = {"/observers/0/sensors/0/camera/width_px=256",
                                        "/observers/0/sensors/0/camera/height_px=256"};
    assert_int_equal(calls_between("scenarios/neossat_geo_track.json", small, 2, 120.0, 150.0), 0);
}

static void generator(void **state) {
    (void)state;
    static const char *const generated[] = {"/observers/0/sensors/0/observation_source=generator"};
    assert_int_equal(calls_between("scenarios/neossat_geo_track.json", generated, 1, 30.0, 40.0),
                     0);
}

static void plant(void **state) {
    (void)state;
    assert_int_equal(calls_between("scenarios/full_plant.json", NULL, 0, 20.0, 22.0), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(images), cmocka_unit_test(generator),
                                       cmocka_unit_test(plant)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
