/* The plan of a run that begins from a saved state, ends early or saves its state, tick by tick.
 * Linked with wraps of engine, states and files. */
#include "sim/core/wall_clock.h"
#include "sim/engine/simulation_state.h"
#include "sim/run/run_internal.h"
#include "tests/stdout_text.h"
#include "tests/test_support.h"

#define RATE 6000

static struct {
    bst_state_head head; /* of the file that is read */
    int64_t ticks[16], saved[16];
    int steps, saves, runs, finishes;
    int interrupted_at; /* step; -1: none */
} now;

bst_status __wrap_bst_scenario_digest(bst_ctx *ctx, const bst_scenario *scenario,
                                      char digest[BST_SHA256_TEXT]);
bst_status __wrap_bst_state_file_read(bst_ctx *ctx, const char *path, char **bytes, size_t *size);
bst_status __wrap_bst_state_head_read(bst_ctx *ctx, const void *bytes, size_t size,
                                      const char *digest, bst_state_head *head);
bst_engine *__wrap_bst_simulation_engine(bst_simulation *simulation);
bst_status __wrap_bst_simulation_archive(bst_ctx *ctx, bst_simulation *sim, bst_archive *archive,
                                         int parts);
bst_status __wrap_bst_simulation_save(bst_ctx *ctx, bst_simulation *sim,
                                      const bst_state_origin *origin, void **bytes, size_t *size);
bst_status __wrap_bst_state_file_write(bst_ctx *ctx, const char *path, const void *bytes,
                                       size_t size);
bst_status __wrap_bst_run_file(bst_ctx *ctx, bst_run *run, const char *name, char *path,
                               size_t size);
const char *__wrap_bst_run_folder(const bst_run *run);
bst_status __wrap_bst_engine_run(bst_ctx *ctx, bst_engine *engine, int64_t tick);
bst_status __wrap_bst_engine_advance(bst_ctx *ctx, bst_engine *engine, int64_t tick);
bst_status __wrap_bst_engine_finish(bst_ctx *ctx, bst_engine *engine);
int64_t __wrap_bst_engine_tick(const bst_engine *engine);

bst_status __wrap_bst_scenario_digest(bst_ctx *ctx, const bst_scenario *scenario,
                                      char digest[BST_SHA256_TEXT]) {
    (void)ctx;
    (void)scenario;
    digest[0] = '\0';
    return BST_OK;
}
bst_status __wrap_bst_state_file_read(bst_ctx *ctx, const char *path, char **bytes, size_t *size) {
    (void)ctx;
    assert_string_equal(path, "FILE");
    *bytes = calloc(1, sizeof now.head);
    *size = sizeof now.head;
    return BST_OK;
}
bst_status __wrap_bst_state_head_read(bst_ctx *ctx, const void *bytes, size_t size,
                                      const char *digest, bst_state_head *head) {
    (void)ctx;
    (void)bytes;
    (void)size;
    (void)digest;
    *head = now.head;
    return BST_OK;
}
bst_engine *__wrap_bst_simulation_engine(bst_simulation *simulation) {
    (void)simulation;
    return NULL;
}
bst_status __wrap_bst_simulation_archive(bst_ctx *ctx, bst_simulation *sim, bst_archive *archive,
                                         int parts) {
    (void)ctx;
    (void)sim;
    (void)archive;
    (void)parts;
    return BST_OK;
}
bst_status __wrap_bst_simulation_save(bst_ctx *ctx, bst_simulation *sim,
                                      const bst_state_origin *origin, void **bytes, size_t *size) {
    (void)ctx;
    (void)sim;
    assert_int_equal(origin->seed, 77);
    now.saved[now.saves++] = origin->tick;
    *bytes = malloc(1);
    *size = 1;
    return BST_OK;
}
bst_status __wrap_bst_state_file_write(bst_ctx *ctx, const char *path, const void *bytes,
                                       size_t size) {
    (void)ctx;
    (void)bytes;
    (void)size;
    assert_string_equal(path, "OUT.partial/state");
    return BST_OK;
}
bst_status __wrap_bst_run_file(bst_ctx *ctx, bst_run *run, const char *name, char *path,
                               size_t size) {
    (void)ctx;
    (void)run;
    snprintf(path, size, "OUT.partial/%s", name);
    return BST_OK;
}
const char *__wrap_bst_run_folder(const bst_run *run) {
    (void)run;
    return "OUT.partial";
}
bst_status __wrap_bst_engine_run(bst_ctx *ctx, bst_engine *engine, int64_t tick) {
    (void)ctx;
    (void)engine;
    now.runs++;
    now.ticks[0] = tick;
    return BST_OK;
}
bst_status __wrap_bst_engine_advance(bst_ctx *ctx, bst_engine *engine, int64_t tick) {
    (void)engine;
    now.ticks[now.steps++] = tick;
    return now.steps - 1 == now.interrupted_at ? bst_fail(ctx, BST_ERR_INTERRUPTED, "stopped")
                                               : BST_OK;
}
bst_status __wrap_bst_engine_finish(bst_ctx *ctx, bst_engine *engine) {
    (void)ctx;
    (void)engine;
    now.finishes++;
    return BST_OK;
}
int64_t __wrap_bst_engine_tick(const bst_engine *engine) {
    (void)engine;
    return 33000;
}

typedef struct fixture {
    bst_ctx ctx;
    bst_scenario scenario;
    bst_run_saving saving;
    bst_run_request request;
    bst_run_execution run;
    bst_run_restored *restored;
    bst_simulation_options options;
} fixture;

static int set_up(void **state) {
    fixture *f = test_calloc(1, sizeof *f);
    memset(&now, 0, sizeof now);
    now.interrupted_at = -1;
    f->scenario.tick_rate_hz = RATE;
    f->scenario.duration_ticks = 75000;
    f->scenario.duration_s = 12.5;
    f->scenario.run = 4;
    f->scenario.seed = 77;
    f->scenario.pacing.mode = BST_PACING_LOCKSTEP;
    f->request.saving = &f->saving;
    f->run.ctx = &f->ctx;
    f->run.scenario = &f->scenario;
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    bst_run_restored_free(f->restored);
    test_free(f);
    return 0;
}

/* Reads a state at a tick; the run begins there. */
static bst_status read_state(fixture *f, int64_t tick, uint64_t number, bool recording) {
    now.head = (bst_state_head){.run = number, .tick = tick, .recording = recording};
    f->saving.restore = "FILE";
    bst_status status = bst_run_restored_read(&f->ctx, &f->scenario, &f->saving, "OUT", false,
                                              &f->options, &f->restored);
    f->request.restored = f->restored;
    return status;
}

static void expect_ticks(const int64_t *found, int count, const int64_t *wanted, int size) {
    assert_int_equal(count, size);
    for (int i = 0; i < size; i++) {
        assert_int_equal(found[i], wanted[i]);
    }
}

static void a_whole_run(void **state) {
    fixture *f = *state;
    f->request.saving = NULL;
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    assert_int_equal(f->run.start_tick, 0);
    assert_int_equal(f->run.end_tick, 75000);
    bst_assert_ok(&f->ctx, bst_run_advance(&f->run));
    assert_int_equal(now.runs, 1);
    assert_int_equal(now.ticks[0], 75000);
    assert_int_equal(now.saves + now.steps, 0);
}

static void states_on_the_way(void **state) {
    fixture *f = *state;
    static const int64_t ticks[] = {27000, 40500, 54000, 66000}, saved[] = {27000, 40500, 54000};
    bst_assert_ok(&f->ctx, read_state(f, 20000, 4, false));
    assert_ptr_equal(f->options.restore_user, f->restored);
    assert_false(bst_run_resumes(&f->request));
    f->saving.until_s = 11.0;
    f->saving.save_every_s = 2.25; /* 13500 ticks, counted from the epoch */
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    assert_int_equal(f->run.start_tick, 20000);
    assert_int_equal(f->run.begin_tick, 20000);
    assert_int_equal(f->run.save_ticks, 13500);
    bst_assert_ok(&f->ctx, bst_run_advance(&f->run));
    expect_ticks(now.ticks, now.steps, ticks, 4);
    expect_ticks(now.saved, now.saves, saved, 3);
    assert_int_equal(now.finishes, 1);
    /* the engine's last tick is 33000: of 33001 ticks the record has those from 20000 on */
    bst_assert_close(bst_run_seconds(&f->run), 33001.0 / 6000.0, 1e-12);
    bst_assert_close(bst_run_simulated_s(&f->run), 13001.0 / 6000.0, 1e-12);
}

/* A record that goes on has the times from its own begin, of all its parts. */
static void times_of_a_record_that_goes_on(void **state) {
    fixture *f = *state;
    bst_assert_ok(&f->ctx, read_state(f, 20000, 4, false));
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    f->run.begin_tick = 6000;
    bst_assert_close(bst_run_simulated_s(&f->run), 27001.0 / 6000.0, 1e-12);
    f->run.started = bst_wall_seconds() - 50.0;
    f->run.earlier_s = 1000.0;
    bst_assert_close(bst_run_wall_s(&f->run), 1050.0, 10.0); /* what the test itself may take */
}

/* At a multiple the next state is a whole interval later. */
static void an_interrupt(void **state) {
    fixture *f = *state;
    static const int64_t ticks[] = {27000, 40500}, saved[] = {27000, 33001};
    bst_assert_ok(&f->ctx, read_state(f, 13500, 4, false));
    f->saving.save_every_s = 2.25;
    now.interrupted_at = 1;
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    assert_int_equal(bst_run_advance(&f->run), BST_ERR_INTERRUPTED);
    expect_ticks(now.ticks, now.steps, ticks, 2);
    expect_ticks(now.saved, now.saves, saved, 2); /* the tick after the last one that was stepped */
    assert_string_equal(f->ctx.message, "stopped; --restore OUT.partial/state goes on");
    assert_int_equal(now.finishes, 1);
}

static void limits(void **state) {
    fixture *f = *state;
    bst_assert_ok(&f->ctx, read_state(f, 20000, 4, false));
    static const struct {
        double until_s, save_every_s;
        const char *message;
    } cases[] = {{3.333, 0,
                  "--until 3.333: allowed is more than 3.33333333 s, where the run begins, "
                  "up to 12.5 s"},
                 {12.501, 0, "--until 12.501: allowed is more than"},
                 {0, 1e-5, "--save-every"}};
    for (int i = 0; i < 3; i++) {
        f->saving.until_s = cases[i].until_s;
        f->saving.save_every_s = cases[i].save_every_s;
        assert_int_equal(bst_run_plan(&f->run, &f->request), BST_ERR_ARGUMENT);
        bst_assert_has(f->ctx.message, cases[i].message);
    }
    f->saving.save_every_s = 0;
    f->saving.until_s = 20001.0 / RATE; /* one tick more, and the very end */
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    assert_int_equal(f->run.end_tick, 20001);
    f->saving.until_s = 12.5;
    bst_assert_ok(&f->ctx, bst_run_plan(&f->run, &f->request));
    assert_int_equal(f->run.end_tick, 75000);
}

static void states_that_do_not_fit(void **state) {
    fixture *f = *state;
    assert_int_equal(read_state(f, 20000, 3, false), BST_ERR_STATE);
    assert_non_null(strstr(f->ctx.message, "run 3 of the scenario, this is run 4"));
    assert_int_equal(read_state(f, 75000, 4, false), BST_ERR_STATE);
    assert_non_null(strstr(f->ctx.message, "at 12.5 s, the scenario ends at 12.5 s"));
    assert_int_equal(read_state(f, 20000, 4, true), BST_ERR_ARGUMENT); /* not in OUT.partial */
    f->scenario.pacing.mode = BST_PACING_REALTIME;
    assert_int_equal(read_state(f, 20000, 4, false), BST_ERR_ARGUMENT);
    f->scenario.pacing.mode = BST_PACING_LOCKSTEP;
    bst_assert_ok(&f->ctx, read_state(f, 74999, 4, false));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_whole_run, set_up, tear_down),
        cmocka_unit_test_setup_teardown(states_on_the_way, set_up, tear_down),
        cmocka_unit_test_setup_teardown(times_of_a_record_that_goes_on, set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_interrupt, set_up, tear_down),
        cmocka_unit_test_setup_teardown(limits, set_up, tear_down),
        cmocka_unit_test_setup_teardown(states_that_do_not_fit, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
