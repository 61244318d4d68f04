/* A controller that is saved and restored into a new one gives the same commands, to the bit, as
 * one that never is. */
#include "tests/archive_support.h"
#include "tests/control/loop_sim.h"

/* After every update, and after every seventh, so that caches are used between restores. */
static const int intervals[] = {1, 7};

static void follow(const char *name, const sim_options *options, sim_result *plain) {
    sim_options o = *options;
    o.restore_every = 0;
    sim_run(&o, plain);
    for (size_t i = 0; i < sizeof intervals / sizeof *intervals; i++) {
        sim_result r;
        o.restore_every = intervals[i];
        sim_run(&o, &r);
        assert_true(r.restored > 100);
        assert_int_equal(r.command_hash, plain->command_hash);
        assert_memory_equal(r.mode_count, plain->mode_count, sizeof r.mode_count);
        assert_int_equal(r.final_mode, plain->final_mode);
        assert_true(r.rms_px == plain->rms_px && r.p99_px == plain->p99_px);
    }
    print_message("%s: %d searches, %d acquisitions, %d reacquisitions, %d tiles, hash %016llx\n",
                  name, plain->mode_count[BST_MODE_SEARCH], plain->mode_count[BST_MODE_ACQUIRE],
                  plain->mode_count[BST_MODE_REACQUIRE], plain->tiles,
                  (unsigned long long)plain->command_hash);
}

/* A search, acquisition, track, a loss, and a search about it. */
static sim_options eventful(void) {
    sim_options o = sim_defaults();
    o.duration_s = 90;
    o.cue_error_x_deg = 0.6;
    o.drop_share = 0.1;
    o.dark_from_s = 50;
    o.dark_to_s = 75;
    return o;
}

static void observer(void **state) {
    (void)state;
    const sim_options o = eventful();
    sim_result r;
    follow("observer", &o, &r);
    assert_true(r.mode_count[BST_MODE_TRACK] > 0 && r.mode_count[BST_MODE_REACQUIRE] > 0);
    assert_true(r.tiles > 0);
}

static void late_model(bst_control_config *config) {
    config->compensator.gain_scale = 1.3;
    config->compensator.delay_s = 0.1;
}

static void model_error(void **state) {
    (void)state;
    sim_options o = sim_defaults(); /* the error starts after 30 frames with attitude in track */
    o.duration_s = 80;
    o.configure = late_model;
    sim_result r, other;
    follow("observer with a model error", &o, &r);
    o.configure = NULL;
    sim_run(&o, &other);
    assert_true(r.command_hash != other.command_hash);
}

static void image_error(bst_control_config *config) {
    config->compensator.type = BST_COMPENSATOR_PID;
    config->compensator.bandwidth_hz = 0.05;
    config->compensator.low_pass_hz = 0.3;
    config->compensator.delay_s = 0.7;
    config->compensator.output_limit = 1e-3;
}

static void image_loop(void **state) {
    (void)state;
    sim_options o = eventful();
    o.configure = image_error;
    sim_result r;
    follow("pid", &o, &r);
    assert_true(r.mode_count[BST_MODE_TRACK] > 0);
}

static void planned(bst_control_config *config) {
    config->guidance.slews = BST_SLEWS_PLANNED;
    config->guidance.prediction_horizon_s = 60.0;
    config->guidance.prediction_interval_s = 5.0;
    config->guidance.acceleration_feed_forward = true;
}

static void planned_slews(void **state) {
    (void)state;
    sim_options o = eventful();
    o.configure = planned;
    sim_result r;
    follow("planned slews", &o, &r);
    assert_true(r.mode_count[BST_MODE_TRACK] > 0);
}

static bst_status archive_control(void *control, bst_archive *archive) {
    return bst_control_archive(control, archive);
}

static void damage_is_refused_or_another_state(void **state) {
    (void)state;
    static bst_control control;
    bst_ctx ctx = {0};
    bst_control_config config;
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_control_config_table, &config));
    image_error(&config);
    const bst_control_env env = {.tick_rate_hz = SIM_TICKS_PER_S,
                                 .pixel_rad = SIM_PIXEL_RAD,
                                 .width_px = 1024,
                                 .height_px = 1024,
                                 .frame_exposure_s = 0.5,
                                 .frame_period_s = 1.0,
                                 .frame_latency_s = 0.2};
    bst_assert_ok(&ctx, bst_control_init(&ctx, &control, &config, &env));
    const bst_search_area area = {0.02, 0.02, 0.01, 0.01, 0.8};
    bst_search_plan(&control.search, BST_SEARCH_SPIRAL, &area);
    control.guidance.slew.active = true;
    bst_aim_history_add(&control.image_loop.aims, 10, (bst_vec3){1, 0, 0}, (bst_vec3){0, 0, 0},
                        false);
    test_saved saved = test_save(archive_control, &control);
    test_restore_damaged(archive_control, &control, saved, saved.size / 1500);
    free(saved.bytes);
    bst_archive *archive;
    bst_assert_ok(&ctx, bst_archive_create(&ctx, &archive));
    control.guidance.slew.path.count = BST_PATH_ARCS + 1;
    assert_int_equal(bst_control_archive(&control, archive), BST_ERR_FORMAT);
    control.guidance.slew.path.count = 0;
    control.guidance.mount.axes = BST_MOUNT_AXES + 1;
    assert_int_equal(bst_control_archive(&control, archive), BST_ERR_FORMAT);
    bst_archive_free(archive);
    bst_config_free(bst_control_config_table, &config);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(observer),
        cmocka_unit_test(model_error),
        cmocka_unit_test(image_loop),
        cmocka_unit_test(planned_slews),
        cmocka_unit_test(damage_is_refused_or_another_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
