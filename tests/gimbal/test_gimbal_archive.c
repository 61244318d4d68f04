/* Every type of gimbal, saved at a tick and restored into a new instance: it goes on to the bit as
 * the one that was not. */
#include "gimbal/modules.h"
#include "tests/gimbal/fake_steps.h"
#include "tests/io/scratch.h"

/* All kinds of jitter, and telemetry at a third of the plant's rate. */
#define JITTER                                                                                     \
    "\"history_s\": 0.05, \"telemetry_rate_hz\": 250, \"telemetry_history_s\": 0.1, "              \
    "\"jitter_low_px_rms\": 0.3, \"jitter_high_px_rms\": 0.2, \"jitter_psd\": {\"low\": "          \
    "[{\"frequency_hz\": 0.01, \"psd\": 1}, {\"frequency_hz\": 3, \"psd\": 0.1}], \"high\": "      \
    "[{\"frequency_hz\": 20, \"psd\": 1e-3}, {\"frequency_hz\": 300, \"psd\": 1e-3}], \"lines\": " \
    "[{\"frequency_hz\": 31.7, \"amplitude\": 0.4, \"axis\": \"both\"}]}"

#define DRIFTING                               \
    "\"platform\": {" JITTER                   \
    ", \"drift_arcsec_per_s\": [1, -2, 0.5], " \
    "\"attitude_bias_arcsec\": [20, 30, -10], \"attitude_noise_arcsec\": 2}"

/* A spacecraft that turns by an error (deg about x) to a law, with a mode, imbalance, motors that
 * reach their torque (N m), a drifting gyro slower than the controller, and star trackers that are
 * late and unlike each other. */
#define CRAFT(law, error, torque) \
    "\"platform\": {" JITTER ", \"spacecraft\": {\"type\": \"rigid_body\", \"inertia_kgm2\": "   \
    "[40, 50, 45, 1, -2, 0.5], \"initial_attitude_error_deg\": [" error ", -1e-3, 2e-3], "       \
    "\"filter_warm_up_s\": 20, \"modes\": [{\"frequency_hz\": 0.7, \"coupling\": [0.5, 0.2, "    \
    "0.3]}], \"wheels\": [" WHEEL("1, 0, 0", torque) ", " WHEEL("0, 1, 0", torque) ", "          \
    WHEEL("0, 0, 1", torque) "], \"gyro\": {\"rate_hz\": 40, \"angle_random_walk_deg_rth\": "    \
    "0.01, \"rate_random_walk_deg_rth3\": 0.1, \"bias_sigma_degph\": 1}, \"star_trackers\": "    \
    "[{\"axis\": [0, 1, 0], \"rate_hz\": 20, \"latency_s\": 0.1}, {\"axis\": [0, -1, 0], "       \
    "\"rate_hz\": 10, \"latency_s\": 0.12, \"noise_arcsec\": 9, \"outage_s\": [0.1, 0.25]}], "   \
    "\"disturbances\": {\"srp_area_m2\": 3, \"unload_dipole_am2\": 5}, \"attitude\": {\"law\": " \
    "\"" law "\", \"roll_deg\": 3, \"bandwidth_hz\": 0.5, \"integral_hz\": 0.1, \"accel_limit_degps2\": 5}}}"
#define WHEEL(axis, torque)                                                                       \
    "{\"axis\": [" axis "], \"inertia_kgm2\": 0.01, \"torque_limit_nm\": " torque                 \
    ", "                                                                                          \
    "\"speed_rpm\": 900, \"coulomb_nm\": 1e-3, \"viscous_nms\": 1e-6, \"static_imbalance_kgm\": " \
    "1e-5, \"dynamic_imbalance_kgm2\": 1e-6, \"position_m\": [0.2, 0.1, 0]}"

#define SERVO                                                                                    \
    "\"friction\": {\"coulomb_nm\": [0.02, 0.01, 0.01], \"breakaway_nm\": [0.03, 0.02, 0.02]}, " \
    "\"flexible\": {\"frequency_hz\": [40, 60, 70]}, \"encoder\": {\"noise_arcsec\": 0.5}, "     \
    "\"servo\": {\"delay_steps\": 3, \"compensator\": {\"crossover_hz\": 6, \"delay_s\": "       \
    "0.0025, \"notches\": [{\"frequency_hz\": 60, \"width_hz\": 20, \"depth_db\": 20}]}}"

typedef struct fixture {
    fake_scene scene;
    bst_world *world;
    bst_knowledge *knowledge;
    unsigned char config[65536];
    scratch folder;
} fixture;

static void make_world(fixture *f) {
    static const char frames[] =
        "{\"boresight_frame_updates\": 1, \"frames\": [{\"frame\": 0, \"exposure_s\": 0.0335, "
        "\"period_s\": 0.05, \"q_cam_from_gcrf_start\": [0, 0, 0, 1], \"q_cam_from_gcrf_end\": "
        "[0.001, 0, 0, 0.9999995]}, {\"frame\": 1, \"q_cam_from_gcrf_start\": [0.001, 0, 0, "
        "0.9999995], \"q_cam_from_gcrf_end\": [0, 0.001, 0, 0.9999995]}, {\"frame\": 20, "
        "\"q_cam_from_gcrf_start\": [0, 0.002, 0, 0.999998], \"q_cam_from_gcrf_end\": [0, 0, "
        "0.002, 0.999998]}]}";
    scratch_make(&f->folder);
    FILE *file = fopen(scratch_path(&f->folder, "frames.json"), "w");
    assert_non_null(file);
    fputs(frames, file);
    fclose(file);
    char sensor[1200];
    snprintf(sensor, sizeof sensor,
             ", \"cue\": {\"object\": \"GX5\"}, \"frame_updates_file\": \"%s\"",
             scratch_path(&f->folder, "frames.json"));
    f->world = test_world_with("{\"name\": \"GX5\", " TEST_GX5 "}", sensor);
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_knowledge_create(&ctx, f->world, 0, 0, &f->knowledge));
}

/* A world whose observer accompanies an object that another program commands. */
static void make_commanded_world(fixture *f) {
    static const char sensor[] = "{" TEST_CAMERA ", \"cue\": {\"object\": \"GX5\"}}";
    char text[4000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"leader\", "
             "\"external_states\": true, " TEST_NEOSSAT "}, {\"name\": \"GX5\", " TEST_GX5
             "}]}, \"observers\": [{\"name\": \"follower\", \"orbit\": {\"source\": \"relative\", "
             "\"reference\": \"leader\", \"offset_rtn_m\": [0, 500, 0]}, \"sensors\": [%s]}]}",
             sensor);
    bst_ctx ctx = {0};
    f->world = test_world(text);
    bst_assert_ok(&ctx, bst_knowledge_create(&ctx, f->world, 0, 0, &f->knowledge));
}

static void begin(fixture *f, void (*make)(fixture *f), const bst_module_desc *desc,
                  const char *keys) {
    memset(f, 0, sizeof *f);
    make(f);
    bst_ctx ctx = {0};
    bst_json *json;
    char text[4000];
    snprintf(text, sizeof text, "{%s}", keys);
    assert_true(desc->config_bytes <= sizeof f->config);
    bst_assert_ok(&ctx, bst_json_parse(&ctx, "test", text, strlen(text), &json));
    bst_assert_ok(&ctx,
                  bst_config_read(&ctx, json, bst_json_root(json), "", desc->config, f->config));
    bst_json_free(json);
    f->scene = (fake_scene){desc, f->config, f->world, f->knowledge};
}

static void end(fixture *f) {
    bst_config_free(f->scene.desc->config, f->config);
    bst_knowledge_free(f->knowledge);
    bst_world_free(f->world);
    if (*f->folder.folder) {
        scratch_remove_tree(f->folder.folder);
    }
}

/* What control commands at a tick: nothing, then a slow turn, then a jump, then a roll with it. */
static bst_los_command command_at(int64_t tick) {
    bst_quat nominal = bst_quat_unit((bst_quat){0.1, 0.4, -0.3, 0.8});
    double t = (double)tick / STEPS_RATE, ahead = tick > 3000 ? 0.4 : 0.0;
    bst_los_command out = {.tick = tick < 120 ? -1 : tick / 300 * 300};
    bst_vec3 d = bst_vec3_from_radec(0.3 + ahead + 0.02 * floor(t * 20) / 20, 0.2 + ahead);
    out.direction_gcrf = bst_quat_rotate(nominal, d);
    out.rate_gcrf_radps =
        bst_vec3_scale(bst_vec3_cross((bst_vec3){0, 0, 1}, out.direction_gcrf), 0.02);
    out.accel_gcrf_radps2 = (bst_vec3){1e-4, -1e-4, 0};
    out.roll_given = tick > 1800;
    out.roll_rad = 0.05;
    return out;
}

/* Steps an instance at each tick of its period and at those that it requests, from `from` on. */
static void step_until(bst_step *s, int64_t from, int64_t until) {
    for (int64_t tick = from; tick < until; tick++) {
        if (tick % STEPS_PERIOD == 0 || tick == s->wake) {
            s->tick = tick;
            s->command = command_at(tick);
            bst_assert_ok(&s->ctx, s->desc->step(s->self, s));
        }
    }
}

/* What the engine restores: messages, requested step and log. */
static void copy_surroundings(const bst_step *from, bst_step *to) {
    to->wake = from->wake;
    memcpy(to->log, from->log, sizeof to->log);
    for (int port = 0; port < BST_GIMBAL_PORTS; port++) {
        assert_int_equal(from->bytes[port], to->bytes[port]);
        memcpy(to->message[port], from->message[port], from->bytes[port]);
    }
}

static void expect_same(const bst_step *a, const bst_step *b) {
    for (int port = 0; port < BST_GIMBAL_PORTS; port++) {
        assert_memory_equal(a->message[port], b->message[port], a->bytes[port]);
    }
    assert_string_equal(a->log, b->log);
    assert_int_equal(a->wake, b->wake);
}

/* Runs one instance to the end, and at each of some ticks a new one that continues from there. */
static void check(const bst_module_desc *desc, const char *keys) {
    static const int64_t saves[] = {0, 1, 97, 1543, 1800, 4501, 6001};
    enum { END = 9000, CHECKS = 37 };
    fixture f;
    begin(&f, make_world, desc, keys);
    bst_step *whole = fake_create(&f.scene), *straight = fake_create(&f.scene);
    int64_t at = 0;
    for (size_t k = 0; k < sizeof saves / sizeof *saves; k++) {
        step_until(whole, at, saves[k]);
        at = saves[k];
        bst_step *part = fake_create(&f.scene);
        test_saved saved = test_save(desc->archive, whole->self);
        bst_assert_ok(&part->ctx, test_restore(&part->ctx, desc->archive, part->self, saved));
        copy_surroundings(whole, part);
        int64_t next = k + 1 < sizeof saves / sizeof *saves ? saves[k + 1] : END;
        /* another instance than `whole`, so that each part continues from where it began */
        bst_step *other = fake_create(&f.scene);
        step_until(other, 0, at);
        expect_same(whole, other);
        for (int64_t t = at; t < next;) {
            int64_t until = t + CHECKS < next ? t + CHECKS : next;
            step_until(part, t, until);
            step_until(other, t, until);
            expect_same(part, other);
            t = until;
        }
        /* back in time, in the same instance */
        bst_assert_ok(&part->ctx, test_restore(&part->ctx, desc->archive, part->self, saved));
        copy_surroundings(whole, part);
        step_until(part, at, next);
        expect_same(part, other);
        test_restore_damaged(desc->archive, part->self, saved, 11);
        copy_surroundings(whole, part);
        step_until(part, at, next);
        expect_same(part, other);
        free(saved.bytes);
        fake_free(part);
        fake_free(other);
    }
    /* saving has changed nothing */
    step_until(whole, at, END);
    step_until(straight, 0, END);
    expect_same(whole, straight);
    assert_true(((bst_los_history *)whole->message[BST_GIMBAL_HISTORY])->written >= END / 6);
    fake_free(whole);
    fake_free(straight);
    end(&f);
}

static void second_order(void **state) {
    (void)state;
    static const char keys[] = "\"encoder_noise_arcsec\": 1, \"inner_travel_deg\": 30, ";
    char text[4000];
    snprintf(text, sizeof text, "%s" DRIFTING, keys);
    check(&bst_gimbal_second_order_module, text);
    snprintf(text, sizeof text, "%s" CRAFT("target", "1e-3", "0.2"), keys);
    check(&bst_gimbal_second_order_module, text);
}

static void azimuth_elevation(void **state) {
    (void)state;
    check(&bst_gimbal_azimuth_elevation_module,
          "\"third_axis\": true, \"fault\": {\"stuck_axis\": \"third\", \"stuck_from_s\": 0.6}, "
          "\"travel_max_deg\": [270, 90, 5], " SERVO ", " CRAFT("nadir", "1", "0.01"));
}

static void cross_elevation(void **state) {
    (void)state;
    check(&bst_gimbal_cross_elevation_module,
          "\"integrator\": \"leapfrog\", \"travel_max_deg\": [10, 10, 0], \"travel_min_deg\": "
          "[-10, -10, 0], " SERVO ", " DRIFTING);
}

static void ideal(void **state) {
    (void)state;
    check(&bst_gimbal_ideal_module, "\"object\": \"GX5\", " CRAFT("sun", "179", "0.2"));
    check(&bst_gimbal_ideal_module,
          "\"target\": \"direction\", \"ra_deg\": 40, \"dec_deg\": 10, " DRIFTING);
}

static void scripted(void **state) {
    (void)state;
    check(&bst_gimbal_scripted_module, "\"missing_frames\": \"hold\", " DRIFTING);
}

/* A state that comes after nodes ahead of it were worked out changes none of them: they are part of
 * what is saved. */
static void nodes_ahead_of_a_state_are_kept(void **state) {
    (void)state;
    enum { BEFORE = 4802 }; /* 0.8 s */
    static const struct {
        const bst_module_desc *desc;
        const char *keys;
    } cases[] = {{&bst_gimbal_ideal_module, "\"object\": \"GX5\", " DRIFTING},
                 {&bst_gimbal_second_order_module, CRAFT("nadir", "0", "0.2")},
                 {&bst_gimbal_second_order_module, CRAFT("target", "0", "0.2")}};
    for (int k = 0; k < 3; k++) {
        fixture f;
        begin(&f, make_commanded_world, cases[k].desc, cases[k].keys);
        bst_step *whole = fake_create(&f.scene), *part = fake_create(&f.scene);
        step_until(whole, 0, BEFORE);
        bst_world_view *view;
        bst_world_state at;
        bst_assert_ok(&whole->ctx, bst_world_view_create(&whole->ctx, f.world, &view));
        bst_assert_ok(&whole->ctx, bst_world_view_object_state(&whole->ctx, view, 0, 0.81, &at));
        at.position_m.x += 5000.0;
        bst_assert_ok(&whole->ctx, bst_world_steer(&whole->ctx, f.world, "leader", 0.81, &at));
        test_saved saved = test_save(cases[k].desc->archive, whole->self);
        bst_assert_ok(&part->ctx,
                      test_restore(&part->ctx, cases[k].desc->archive, part->self, saved));
        copy_surroundings(whole, part);
        for (int64_t t = BEFORE; t < 12000; t += 60) {
            step_until(whole, t, t + 60);
            step_until(part, t, t + 60);
            expect_same(whole, part);
        }
        free(saved.bytes);
        bst_world_view_free(view);
        fake_free(whole);
        fake_free(part);
        end(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(second_order),    cmocka_unit_test(azimuth_elevation),
        cmocka_unit_test(cross_elevation), cmocka_unit_test(ideal),
        cmocka_unit_test(scripted),        cmocka_unit_test(nodes_ahead_of_a_state_are_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
