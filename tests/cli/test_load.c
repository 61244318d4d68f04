/* What the options of a command change in a scenario: each its own place, also with the values that
 * are nothing special to it. */
#include "sim/cli/load.h"
#include "sim/engine/kernel/pacing.h"
#include "tests/test_support.h"

static const bst_option none[] = {{.name = NULL}};

/* Loads the shipped scenario of two observers; NULL: it is refused. Free it with end(). */
static bst_json *begin(bst_ctx *ctx, bst_load_options *load, bst_scenario *out) {
    bst_json *json = NULL;
    bst_assert_ok(ctx, bst_load_check(ctx, load, none));
    if (bst_load_scenario(ctx, "scenarios/two_observers.json", load, &json, out) != BST_OK) {
        return NULL;
    }
    return json;
}

static void end(bst_json *json, bst_scenario *scenario) {
    bst_scenario_free(scenario);
    bst_json_free(json);
}

static void options_have_their_places(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_scenario s;
    static const char *const sets[] = {"/run=5", "/seed=77", "/duration_s=12", "/pacing/mode=fast",
                                       "/observers/0/sensors/1/modules/gimbal/offset_s=0.25"};
    bst_load_options load = BST_LOAD_DEFAULTS;
    for (int i = 0; i < 5; i++) {
        load.set.items[load.set.count++] = sets[i];
    }
    bst_json *json = begin(&ctx, &load, &s);
    assert_non_null(json);
    assert_true(s.run == 5 && s.seed == 77 && s.duration_s == 12.0);
    assert_int_equal(s.pacing.mode, BST_PACING_FAST);
    for (int k = 0; k < 3; k++) {
        const bst_scenario_module_config *m = bst_scenario_module(&s, k / 2, k % 2, "gimbal");
        assert_non_null(m);
        assert_true(m->offset_s == (k == 1 ? 0.25 : 0.0));
        assert_int_equal(m->offset_ticks, k == 1 ? s.tick_rate_hz / 4 : 0);
    }
    end(json, &s);
    /* an option wins over --set, and 0 is a value */
    load.run = 0;
    load.duration_s = 0.0;
    load.seed = "0x1f";
    load.pacing = "realtime";
    json = begin(&ctx, &load, &s);
    assert_non_null(json);
    assert_true(s.run == 0 && s.seed == 31 && s.duration_s == 0.0 && s.duration_ticks == 0);
    assert_int_equal(s.pacing.mode, BST_PACING_REALTIME);
    end(json, &s);
}

/* A module of one sensor, or those of all. */
static void modules_go_outside(void **state) {
    (void)state;
    static const char *const names[] = {"neossat/wide/gimbal", "gimbal"};
    bst_ctx ctx = {0};
    for (int all = 0; all < 2; all++) {
        bst_scenario s;
        bst_load_options load = BST_LOAD_DEFAULTS;
        load.external = names[all];
        load.link = "ipc:///tmp/none";
        bst_json *json = begin(&ctx, &load, &s);
        if (!json) {
            fail_msg("%s", ctx.message);
        }
        for (int k = 0; k < 3; k++) {
            const bst_scenario_module_config *m = bst_scenario_module(&s, k / 2, k % 2, "gimbal");
            assert_int_equal(strcmp(m->desc->type, "external") == 0, all || k == 1);
        }
        end(json, &s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(options_have_their_places),
                                       cmocka_unit_test(modules_go_outside)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
