/* A sensor that a file drives frame by frame, and an object whose states are in that file: a cubic
 * in time, which what is interpolated meets everywhere. */
#include <unistd.h>

#include "sim/world/frame_updates.h"
#include "sim/world/scene/object_shape.h"
#include "tests/world/world_support.h"

static const double place[4][3] = {
    {7e6, -2e5, 3e5}, {1200, 7300, -800}, {-4, 0.5, 1.5}, {-0.002, -0.003, 0.001}};

static bst_world_state cubic(double t) {
    double p[3], v[3];
    for (int i = 0; i < 3; i++) {
        p[i] = place[0][i] + t * (place[1][i] + t * (place[2][i] + t * place[3][i]));
        v[i] = place[1][i] + t * (2 * place[2][i] + 3 * t * place[3][i]);
    }
    return (bst_world_state){{p[0], p[1], p[2]}, {v[0], v[1], v[2]}};
}

static int print_object(char *out, size_t bytes, const char *name, double start, double end) {
    int n = snprintf(out, bytes, "{\"object\": \"%s\"", name);
    for (int e = 0; e < 2; e++) {
        bst_world_state s = cubic(e ? end : start);
        const char *word = e ? "end" : "start";
        n += snprintf(out + n, bytes - (size_t)n,
                      ", \"%s_position_m\": [%.17g, %.17g, %.17g], \"%s_velocity_mps\": [%.17g, "
                      "%.17g, %.17g]",
                      word, s.position_m.x, s.position_m.y, s.position_m.z, word, s.velocity_mps.x,
                      s.velocity_mps.y, s.velocity_mps.z);
    }
    return n + snprintf(out + n, bytes - (size_t)n, "}");
}

/* Frames of the second sensor begin at 2, 3 and 4 s; the second has 0.8 s, and no states. */
static void write_file(char path[BST_TEST_PATH + 8]) {
    char object[2][1200], base[BST_TEST_PATH];
    bst_test_template(base, "boresight_updates");
    int fd = mkstemp(base);
    assert_true(fd >= 0);
    close(fd);
    snprintf(path, BST_TEST_PATH + 8, "%s.json", base); /* the extension gives the format */
    assert_int_equal(rename(base, path), 0);
    print_object(object[0], sizeof object[0], "A", 2, 2.5);
    print_object(object[1], sizeof object[1], "A", 4, 4.8);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "{\"boresight_frame_updates\": 1, \"frames\": [{\"frame\": 0, \"objects\": [%s]}, "
            "{\"frame\": 1, \"exposure_s\": 0.8}, {\"frame\": 2, \"objects\": [%s]}]}",
            object[0], object[1]);
    fclose(f);
}

static bst_status try_world(bst_ctx *ctx, const char *updates, const char *states,
                            bst_world **out) {
    char text[2500];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"target\", "
             "\"orbit\": {\"source\": \"injected\", \"states_file\": \"%s\"}}]}, \"observers\": "
             "[{\"name\": \"a\", " TEST_NEOSSAT ", \"sensors\": [{\"name\": \"x\", " TEST_CAMERA
             "}, {\"name\": \"y\", \"exposure\": {\"exposure_s\": 0.5, \"period_s\": 1, "
             "\"first_s\": 2}, \"frame_updates_file\": \"%s\", " TEST_CAMERA "}]}]}",
             states, updates);
    return test_world_try(ctx, TEST_EPOCH, text, out);
}

static void states_come_with_the_frames(void **state) {
    (void)state;
    char path[BST_TEST_PATH + 8];
    bst_ctx ctx = {0};
    bst_world *world;
    bst_world_view *view;
    write_file(path);
    bst_assert_ok(&ctx, try_world(&ctx, path, path, &world));
    assert_null(bst_world_frame_updates(world, 0, 0));
    const bst_frame_updates *updates = bst_world_frame_updates(world, 0, 1);
    assert_non_null(updates);
    assert_int_equal(bst_frame_updates_count(updates), 3);
    assert_string_equal(bst_frame_updates_name(updates), path);
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    for (double t = 2; t <= 4.8; t += 0.1) {
        bst_world_state got, want = cubic(t);
        bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, t, &got));
        /* rounding of 7e6 m, and of its derivative over half a second */
        bst_assert_close(test_distance(got.position_m, want.position_m), 0, 1e-6);
        bst_assert_close(test_distance(got.velocity_mps, want.velocity_mps), 0, 1e-5);
    }
    bst_world_state got; /* for 5 s they are continued */
    assert_int_equal(bst_world_view_object_state(&ctx, view, 0, -3.1, &got), BST_ERR_NUMERIC);
    assert_int_equal(bst_world_view_object_state(&ctx, view, 0, 9.9, &got), BST_ERR_NUMERIC);
    bst_world_view_free(view);
    bst_world_free(world);
    /* of no sensor, the file has no times */
    assert_int_equal(try_world(&ctx, "", path, &world), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "is no sensor's frame_updates_file"));
    assert_int_equal(try_world(&ctx, "/nowhere.json", "/nowhere.csv", &world), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "/observers/0/sensors/1/frame_updates_file"));
    unlink(path);
}

/* Attitudes of a shape come with the frames, on an orbit of another source. */
static void attitudes_come_with_the_frames(void **state) {
    (void)state;
    char path[BST_TEST_PATH + 8], text[3000];
    bst_ctx ctx = {0};
    bst_world *world;
    write_file(path);
    for (int wrong = 0; wrong < 2; wrong++) {
        FILE *f = fopen(path, "w");
        assert_non_null(f);
        fprintf(f,
                "{\"boresight_frame_updates\": 1, \"frames\": [{\"frame\": 0, \"objects\": "
                "[{\"object\": \"A\", \"start_q_body_from_gcrf\": [0, 0, 0, 1], "
                "\"end_q_body_from_gcrf\": [0, 0, 0.6, 0.8]}, {\"object\": \"B\", "
                "\"start_q_body_from_gcrf\": [1, 0, 0, 0], \"end_q_body_from_gcrf\": [1, 0, 0, "
                "0]}]}]}");
        fclose(f);
        snprintf(text, sizeof text,
                 "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": "
                 "\"target\", " TEST_GX5
                 ", \"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": "
                 "[{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"p\", "
                 "\"material\": \"w\"}]}, \"attitude\": [{\"law\": \"table\", \"file\": "
                 "\"%s\"%s}]}]}, \"observers\": [{\"name\": \"a\", " TEST_NEOSSAT
                 ", \"sensors\": [{\"name\": \"y\", \"exposure\": {\"exposure_s\": 0.5, "
                 "\"period_s\": 1, \"first_s\": 2}, \"frame_updates_file\": \"%s\", " TEST_CAMERA
                 "}]}]}",
                 path, wrong ? "" : ", \"object\": \"A\"", path);
        if (wrong) {
            assert_int_equal(test_world_try(&ctx, TEST_EPOCH, text, &world), BST_ERR_CONFIG);
            assert_non_null(strstr(ctx.message, "attitudes of several objects; give \"object\""));
            continue;
        }
        bst_assert_ok(&ctx, test_world_try(&ctx, TEST_EPOCH, text, &world));
        const bst_object_shape *shape = bst_world_object(world, 0)->shape;
        /* at 2.25 s half of the turn of 2 asin 0.6; before and after it is held */
        static const double when[] = {0, 2, 2.25, 2.5, 9}, half[] = {0, 0, 0.5, 1, 1};
        for (int i = 0; i < 5; i++) {
            bst_attitude_state at = {{7e6, 0, 0}, {0, 7e3, 0}, {1, 0, 0}, when[i]};
            bst_quat q = bst_body_attitude_at(shape->attitude, &at);
            bst_assert_close(q.z, sin(half[i] * asin(0.6)), 1e-12); /* rounding */
        }
        bst_world_free(world);
    }
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(states_come_with_the_frames),
                                       cmocka_unit_test(attitudes_come_with_the_frames)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
