/* Orbits from files: an OEM observer looking at an injected target. */
#include "sim/astro/kepler.h"
#include "tests/io/scratch.h"
#include "tests/world/world_support.h"

/* Two circular-ish two-body orbits, GCRF. */
static const bst_vec3 eye_r = {7.1e6, 0, 0}, eye_v = {0, 5e3, 5.5e3};
static const bst_vec3 target_r = {42.164e6, 1e5, 0}, target_v = {0, 3074.0, 10.0};

static void at(bst_vec3 r0, bst_vec3 v0, double seconds, bst_vec3 *r, bst_vec3 *v) {
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_kepler_propagate(&ctx, BST_EARTH_MU_M3PS2, r0, v0, seconds, r, v));
}

static const char *write_oem(scratch *s, const char *name, double from_s, double to_s) {
    const char *path = scratch_path(s, name);
    bst_ctx ctx = {0};
    bst_time epoch;
    char start[40], stop[40];
    bst_assert_ok(&ctx, bst_time_from_utc(&ctx, TEST_EPOCH, &epoch));
    bst_time_to_utc(bst_time_add(epoch, from_s), 6, start, sizeof start);
    bst_time_to_utc(bst_time_add(epoch, to_s), 6, stop, sizeof stop);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file,
            "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = EYE\nOBJECT_ID = 1\nCENTER_NAME = "
            "EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = %s\nSTOP_TIME = %s\n"
            "META_STOP\n",
            start, stop);
    for (double t = from_s; t <= to_s; t += 60.0) {
        bst_vec3 r, v;
        at(eye_r, eye_v, t, &r, &v);
        bst_time_to_utc(bst_time_add(epoch, t), 6, start, sizeof start);
        fprintf(file, "%s %.12f %.12f %.12f %.15f %.15f %.15f\n", start, r.x / 1e3, r.y / 1e3,
                r.z / 1e3, v.x / 1e3, v.y / 1e3, v.z / 1e3);
    }
    fclose(file);
    return path;
}

/* Frames of 0.5 s, one a second, from 0 to to_s. */
static const char *write_states(scratch *s, const char *name, double to_s) {
    const char *path = scratch_path(s, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(
        "object,start_s,end_s,start_x_m,start_y_m,start_z_m,start_vx_mps,start_vy_mps,start_vz_mps,"
        "end_x_m,end_y_m,end_z_m,end_vx_mps,end_vy_mps,end_vz_mps\n",
        file);
    for (double t = 0.0; t < to_s; t += 1.0) {
        fprintf(file, "T,%.17g,%.17g", t, t + 0.5);
        for (int end = 0; end < 2; end++) {
            bst_vec3 r, v;
            at(target_r, target_v, t + 0.5 * end, &r, &v);
            fprintf(file, ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", r.x, r.y, r.z, v.x, v.y, v.z);
        }
        fputc('\n', file);
    }
    fclose(file);
    return path;
}

static bst_status make_late(bst_ctx *ctx, const char *oem, const char *states, const char *more,
                            double clock_offset_s, bst_world **out) {
    char text[6000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"target\", "
             "\"orbit\": {\"source\": \"injected\", \"states_file\": \"%s\"%s}}, {\"name\": \"by "
             "number\", " TEST_GX5
             "}, {\"name\": \"beside\", \"orbit\": {\"source\": "
             "\"relative\", \"reference\": \"target\", \"offset_rtn_m\": [0, 0, 1000]}}]}, "
             "\"observers\": [{\"name\": \"eye\", \"orbit\": {\"source\": \"oem\", \"oem_file\": "
             "\"%s\"}, \"sensors\": [{" TEST_CAMERA
             ", \"cue\": {\"object\": \"beside\"}, "
             "\"knowledge\": {\"clock_offset_s\": %g}}]}]}",
             states, more, oem, clock_offset_s);
    return test_world_try(ctx, TEST_EPOCH, text, out);
}

static bst_status make(bst_ctx *ctx, const char *oem, const char *states, const char *more,
                       bst_world **out) {
    return make_late(ctx, oem, states, more, 0.0, out);
}

static void an_oem_observer_sees_an_injected_target(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    char oem[1024], states[1024];
    bst_ctx ctx = {0};
    bst_world *world;
    snprintf(oem, sizeof oem, "%s", write_oem(&s, "eye.oem", 0.0, 120.0));
    snprintf(states, sizeof states, "%s", write_states(&s, "t.csv", 120.0));
    bst_assert_ok(&ctx, make(&ctx, oem, states, "", &world));
    bst_assert_ok(&ctx, bst_world_check_spans(&ctx, "test", world, 119.5));
    bst_world_view *view;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    /* the ends of the files too, and what look-back and look-ahead need beyond them */
    static const double times[] = {-4.9, -0.5, 0.0, 0.1, 0.75, 31.4159, 119.25, 119.5, 124.0};
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        bst_world_state eye, target;
        bst_vec3 r, v;
        bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, times[i], &eye));
        at(eye_r, eye_v, times[i], &r, &v);
        /* Hermite of degree 5 through rows 60 s apart: 0.148 7.1e6 (1.055e-3 60)^6 / 720 = 9.4e-5
         * m; its slope */
        bst_assert_close(test_distance(eye.position_m, r), 0.0, 1e-4);
        bst_assert_close(test_distance(eye.velocity_mps, v), 0.0, 1e-5);
        bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, times[i], &target));
        at(target_r, target_v, times[i], &r, &v);
        bst_assert_close(test_distance(target.position_m, r), 0.0, 1e-7); /* rounding at 4e7 */
        bst_world_sight sight;
        bst_assert_ok(&ctx, bst_world_view_sight(&ctx, view, 0, 0, fmax(times[i], -4.0), &sight));
        assert_true(sight.range_m > 3e7 && sight.range_m < 4e7);
    }
    bst_world_state target;
    assert_int_equal(bst_world_view_object_state(&ctx, view, 0, -5.1, &target), BST_ERR_NUMERIC);
    assert_non_null(strstr(ctx.message, "orbit of target: "));
    assert_non_null(strstr(ctx.message,
                           "t.csv: no state of \"T\" -5.100000 s after the epoch: the "
                           "file covers 0.000000 s to 119.500000 s"));
    assert_int_equal(bst_world_view_object_state(&ctx, view, 0, 200.0, &target), BST_ERR_NUMERIC);
    bst_world_view_free(view);
    char message[2000];
    /* the last frame ends before the run does */
    bst_assert_ok(&ctx, bst_world_check_spans(&ctx, "test", world, 120.0));
    assert_int_equal(bst_world_check_spans(&ctx, "test", world, 121.0), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "test: /observers/0/orbit: the states of \"eye\" do not cover the run "
                        "(found 0 s to 120 s after the epoch; needed: 0 s to 121 s)");
    bst_world_free(world);
    /* the onboard side evaluates the orbits by its own clock */
    bst_assert_ok(&ctx, make_late(&ctx, oem, states, "", 30.0, &world));
    bst_assert_ok(&ctx, bst_world_check_spans(&ctx, "test", world, 89.5));
    assert_int_equal(bst_world_check_spans(&ctx, "test", world, 100.0), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "test: /observers/0/orbit: the states of \"eye\" do not cover the run "
                        "(found 0 s to 120 s after the epoch; needed: 0 s to 130 s, with the "
                        "onboard clock's offset)");
    bst_world_free(world);
    bst_assert_ok(&ctx, make_late(&ctx, oem, states, "", -3.0, &world));
    assert_int_equal(bst_world_check_spans(&ctx, "test", world, 10.0), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "needed: -3 s to 10 s, with the onboard clock's offset)"));
    bst_world_free(world);

    assert_int_equal(make(&ctx, oem, states, ", \"states_object\": \"U\"", &world), BST_ERR_CONFIG);
    snprintf(message, sizeof message,
             "test: /world/objects/0/orbit/states_file: %s: no object \"U\" among 1 (the first: "
             "\"T\")",
             states);
    assert_string_equal(ctx.message, message);
    assert_int_equal(make(&ctx, "nowhere.oem", states, "", &world), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "test: /observers/0/orbit/oem_file: nowhere.oem: cannot be opened: No such "
                        "file or directory; give an OEM file (CCSDS 502.0, KVN)");
    snprintf(oem, sizeof oem, "%s", write_oem(&s, "late.oem", 60.0, 120.0));
    assert_int_equal(make(&ctx, oem, states, "", &world), BST_ERR_CONFIG);
    snprintf(message, sizeof message,
             "test: /observers/0/sensors/0/cue: orbit of eye: %s: no state of \"EYE\" at "
             "2022-06-16T22:10:00.000Z: the file covers 2022-06-16T22:11:00.000Z to "
             "2022-06-16T22:12:00.000Z",
             oem);
    assert_string_equal(ctx.message, message);
    assert_int_equal(make(&ctx, "", states, "", &world), BST_ERR_CONFIG);
    assert_string_equal(ctx.message, "test: /observers/0/orbit: source \"oem\" needs \"oem_file\"");
    scratch_remove(&s);
}

/* TEME states turn as element sets' do. */
static void injected_states_may_be_teme(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    char oem[1024], states[1024];
    bst_ctx ctx = {0};
    bst_world *world;
    snprintf(oem, sizeof oem, "%s", write_oem(&s, "eye.oem", -60.0, 120.0));
    snprintf(states, sizeof states, "%s", write_states(&s, "t.csv", 120.0));
    bst_assert_ok(&ctx, make(&ctx, oem, states, ", \"states_frame\": \"teme\"", &world));
    bst_world_view *view;
    bst_world_state target;
    bst_astro_earth_frames frames;
    bst_vec3 r, v;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, 30.25, &target));
    bst_assert_ok(&ctx, bst_world_view_earth_frames(&ctx, view, 30.25, &frames));
    at(target_r, target_v, 30.25, &r, &v);
    bst_assert_close(test_distance(target.position_m, bst_mat3_mul_vec(&frames.gcrf_from_teme, r)),
                     0.0, 1e-7); /* rounding at 4e7 */
    assert_true(test_distance(target.position_m, r) > 1e4);
    bst_world_view_free(view);
    bst_world_free(world);
    scratch_remove(&s);
}

/* A run of 120 s with frames that end at `to_s`. */
static bst_status run_with_frames_to(bst_ctx *ctx, double to_s) {
    scratch s;
    scratch_make(&s);
    char oem[1024], states[1024];
    bst_world *world;
    snprintf(oem, sizeof oem, "%s", write_oem(&s, "eye.oem", 0.0, 120.0));
    snprintf(states, sizeof states, "%s", write_states(&s, "t.csv", to_s));
    bst_assert_ok(ctx, make(ctx, oem, states, "", &world));
    bst_status status = bst_world_check_spans(ctx, "test", world, 120.0);
    bst_world_free(world);
    scratch_remove(&s);
    return status;
}

static void frames_may_end_a_little_before_the_run(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, run_with_frames_to(&ctx, 118.0));
    assert_int_equal(run_with_frames_to(&ctx, 117.0), BST_ERR_CONFIG);
    assert_string_equal(ctx.message,
                        "test: /observers/0/sensors/0/cue/object: the states of \"target\" do not "
                        "cover the run (found 0 s to 116.5 s after the epoch; needed: 0 s to 120 "
                        "s)");
}

/* An observer at rest is no orbit: it stays where it is, look-back and look-ahead beyond the file's
 * ends included. One on a turntable goes on round. */
static void a_body_at_rest_stays(void **state) {
    (void)state;
    static const double times[] = {-4.9, -0.5, 0.0, 7.3, 10.0, 12.6, 14.9};
    const double turn = 7.292115e-5, radius = 6.378e6; /* rad/s, m: a place on the equator */
    scratch s;
    scratch_make(&s);
    for (int turning = 0; turning < 2; turning++) {
        const char *path = scratch_path(&s, "rest.csv");
        FILE *file = fopen(path, "w");
        assert_non_null(file);
        fputs(
            "object,start_s,end_s,start_x_m,start_y_m,start_z_m,start_vx_mps,start_vy_mps,"
            "start_vz_mps,end_x_m,end_y_m,end_z_m,end_vx_mps,end_vy_mps,end_vz_mps\n",
            file);
        for (int k = 0; k < 10; k++) {
            fprintf(file, "EYE,%d,%d", k, k + 1);
            for (int end = 0; end < 2; end++) {
                double a = turning * turn * (k + end), v = turning * turn * radius;
                fprintf(file, ",%.9f,%.9f,0,%.9f,%.9f,0", radius * cos(a), radius * sin(a),
                        -v * sin(a), v * cos(a));
            }
            fputc('\n', file);
        }
        fclose(file);
        char text[4000];
        bst_ctx ctx = {0};
        bst_world *world;
        for (int wrong = 0; wrong < 2; wrong++) {
            snprintf(text, sizeof text,
                     "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": "
                     "\"GX5\", " TEST_GX5
                     "}]}, \"observers\": [{\"name\": \"eye\", \"orbit\": {\"source\": "
                     "\"injected\", \"states_file\": \"%s\"}, \"sensors\": [{" TEST_CAMERA
                     ", \"cue\": {\"object\": \"GX5\"}, \"knowledge\": {\"orbit\": "
                     "{\"position_rtn_m\": [10, %d, 0]}}}]}]}",
                     path, wrong);
            bst_assert_ok(&ctx, test_world_try(&ctx, TEST_EPOCH, text, &world));
            bst_status status = bst_world_check_spans(&ctx, "test", world, 10.0);
            assert_int_equal(status, wrong && !turning ? BST_ERR_CONFIG : BST_OK);
            if (status != BST_OK) {
                assert_non_null(strstr(ctx.message,
                                       "/observers/0/sensors/0/knowledge/orbit: an "
                                       "error along the transverse"));
            }
            bst_world_view *view;
            bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
            for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
                bst_world_state eye;
                double a = turning * turn * times[i];
                bst_assert_ok(&ctx, bst_world_view_observer_state(&ctx, view, 0, times[i], &eye));
                /* 5 s beyond: third derivative 2.5e-6 m/s3 (5 s)^3 / 6 and half a second of its
                 * acceleration's lag, 2.5e-6 0.5 (5 s)^2 / 2; falling would be 120 m */
                const bst_vec3 there = {radius * cos(a), radius * sin(a), 0.0};
                bst_assert_close(test_distance(eye.position_m, there), 0.0, 1e-4);
            }
            bst_world_view_free(view);
            bst_world_free(world);
        }
    }
    scratch_remove(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_oem_observer_sees_an_injected_target),
        cmocka_unit_test(injected_states_may_be_teme),
        cmocka_unit_test(frames_may_end_a_little_before_the_run),
        cmocka_unit_test(a_body_at_rest_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
