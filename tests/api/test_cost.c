/* Processor time that a second simulation on a model of the main scenario costs, and the clone of a
 * running one. What may cost 5 ms is compared by the least of many measurements, which other
 * programs on the machine disturb little. */
#include <math.h>
#include <time.h>

#include "boresight/boresight.h"
#include "tests/test_support.h"

enum { TRIES = 40 };
/* of 5 ms, with a reserve; 1 to 3 ms were measured (docs/results/api.md), 5 to 8 ms before modules
 * took their work arrays from fresh pages */
static const double LIMIT_MS = 4.0;

static double processor_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

typedef bst_status (*make_sim)(bst_ctx *ctx, const bst_model *model, bst_sim *running,
                               bst_sim **out);

static bst_status create(bst_ctx *ctx, const bst_model *model, bst_sim *running, bst_sim **out) {
    (void)running;
    return bst_sim_create(ctx, model, NULL, out);
}

static bst_status clone(bst_ctx *ctx, const bst_model *model, bst_sim *running, bst_sim **out) {
    (void)model;
    return bst_sim_clone(ctx, running, out);
}

/* Least time of making a sim, with all of them kept: none reuses the memory of another. */
static double least_ms(make_sim make) {
    bst_ctx ctx;
    bst_model *model;
    bst_sim *running, *made[TRIES];
    double least = INFINITY;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_assert_ok(&ctx, bst_model_load(&ctx, "scenarios/neossat_geo_track.json", NULL, &model));
    bst_assert_ok(&ctx, bst_sim_create(&ctx, model, NULL, &running));
    bst_assert_ok(&ctx, bst_sim_run_until(&ctx, running, 8.7));
    for (int i = 0; i < TRIES; i++) {
        double before = processor_ms();
        bst_assert_ok(&ctx, make(&ctx, model, running, &made[i]));
        least = fmin(least, processor_ms() - before);
    }
    for (int i = 0; i < TRIES; i++) {
        bst_sim_free(made[i]);
    }
    bst_sim_free(running);
    bst_model_free(model);
    return least;
}

static void second_simulation(void **state) {
    (void)state;
    double ms = least_ms(create);
    print_message("a second simulation: %.2f ms\n", ms);
    assert_true(ms < LIMIT_MS);
}

static void clone_of_a_running_one(void **state) {
    (void)state;
    double ms = least_ms(clone);
    print_message("a clone: %.2f ms\n", ms);
    assert_true(ms < LIMIT_MS);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(second_simulation),
                                       cmocka_unit_test(clone_of_a_running_one)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
