/* The mask of parts against polygons that are projected here: windows, binning, a rotated camera
 * with distortion, and bodies that hide each other. */
#include "scenegen/part_mask.h"

#include "sim/world/scene/source_body.h"
#include "tests/satellite/satellite_support.h"
#include "tests/scenegen/scene_support.h"

enum { SIDE = 160, NEAR = 5, FAR = 9 }; /* NEAR, FAR: numbers of the bodies' first parts */

/* Two plates beside each other, the second tilted about y by 40 degrees. */
static const char *const plates =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"parts\": [{\"name\": \"a\", \"kind\": "
    "\"plate\", \"size_m\": [2, 3, 0], \"position_m\": [-1.6, 0, 0], \"material\": \"m\"}, "
    "{\"name\": \"b\", \"kind\": \"plate\", \"size_m\": [2, 3, 0], \"position_m\": [1, 0.5, 0], "
    "\"rotation_deg\": [0, 40, 0], \"material\": \"m\"}]}";

typedef struct scene {
    bst_camera camera;
    bst_test_model model;
    bst_scene_source_body body[2];
    bst_scene_source sources[2];
    scene_track track;
} scene;

/* The near body at 20 m, the far one at 40 m behind its right side; 1 m is 20 px at 20 m. */
static void make_scene(scene *s, bool general) {
    bst_ctx ctx = {0};
    static const double range_m[2] = {40.0, 20.0}, x_px[2] = {95.0, 70.0}, y_px[2] = {70.0, 85.0};
    *s = (scene){.camera = scene_camera(SIDE, SIDE), .model = bst_test_model_open(plates)};
    s->camera.pixel_scale_arcsec = 1.0 / (20.0 * 20.0) / BST_ARCSEC_RAD;
    if (general) {
        s->camera.rotation_deg = 25.0;
        s->camera.distortion.k1 = -0.3;
        bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &s->camera));
        assert_true(s->camera.geometry.general);
    }
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    s->track = scene_track_make(&s->camera, &still);
    for (int i = 0; i < 2; i++) {
        bst_vec3 direction = bst_camera_unproject(&s->camera, x_px[i], y_px[i]);
        s->body[i] = (bst_scene_source_body){
            .satellite = s->model.satellite,
            .first_part = i ? NEAR : FAR,
            .times = 1,
            .q_body_from_gcrf = {bst_quat_unit((bst_quat){0.1, -0.05, 0.2 * i, 1.0})},
            .object_m = {{7e6, 0, 0}, {7e6, 0, 0}},
            .sun_m = {BST_AU_M, 0, 0}};
        s->sources[i] = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                           .apparent_mid = direction,
                                           .range_m = range_m[i],
                                           .body = &s->body[i],
                                           .body_u = {0.0, 1.0}};
    }
}

static void close_scene(scene *s) {
    scene_track_free(&s->track);
    bst_test_model_close(&s->model);
}

/* Distance of a ray from the nearest border of a plate, m in its plane, positive inside. */
static double inside_m(const bst_scene_source *source, int part, bst_vec3 ray) {
    bst_quat q = source->body->q_body_from_gcrf[0];
    bst_vec3 eye = bst_quat_rotate(q, bst_vec3_scale(source->apparent_mid, -source->range_m));
    bst_vec3 way = bst_quat_rotate(q, ray);
    const bst_vec3 centre = part ? (bst_vec3){1, 0.5, 0} : (bst_vec3){-1.6, 0, 0};
    double a = part ? 40.0 * BST_DEG_RAD : 0.0;
    const bst_vec3 x = {cos(a), 0, -sin(a)}, y = {0, 1, 0}, z = {sin(a), 0, cos(a)};
    bst_vec3 from = bst_vec3_sub(eye, centre);
    double t = -bst_vec3_dot(from, z) / bst_vec3_dot(way, z);
    bst_vec3 at = bst_vec3_axpy(from, t, way);
    return fmin(1.0 - fabs(bst_vec3_dot(at, x)), 1.5 - fabs(bst_vec3_dot(at, y)));
}

/* Part that a ray meets first; *clear: it is farther than `border` px from all borders. */
static int expected(const scene *s, bst_vec3 ray, double border, bool *clear) {
    int found = 0;
    *clear = true;
    for (int i = 0; i < 2; i++) { /* the near one last */
        double per_px = s->sources[i].range_m / 400.0;
        for (int part = 0; part < 2; part++) {
            double in = inside_m(&s->sources[i], part, ray);
            *clear &= fabs(in) > border * per_px;
            found = in > 0.0 ? s->body[i].first_part + part : found;
        }
    }
    return found;
}

static void check(scene *s, bst_window window, int binning) {
    bst_ctx ctx = {0};
    bst_part_mask work = {0};
    static int32_t mask[SIDE * SIDE];
    int seen[16] = {0}, compared = 0;
    bst_render_request q = {.window = window,
                            .binning = binning,
                            .track = &s->track.track,
                            .sources = s->sources,
                            .count = 2};
    memset(mask, 7, sizeof mask);
    bst_assert_ok(&ctx, bst_part_mask_draw(&ctx, &work, &s->camera, &q, mask));
    int width = window.width / binning, height = window.height / binning;
    for (int i = 0; i < width * height; i++) {
        bool clear;
        double x = window.x0 + (i % width + 0.5) * binning - 0.5;
        double y = window.y0 + (i / width + 0.5) * binning - 0.5;
        int want = expected(s, bst_camera_unproject(&s->camera, x, y), 0.6, &clear);
        if (clear) {
            assert_int_equal(mask[i], want);
            compared++;
            seen[want]++;
        }
    }
    assert_true(compared > width * height * 3 / 4);
    assert_true(seen[0] > 20 && seen[NEAR] > 20 && seen[NEAR + 1] > 20 && seen[FAR] > 5);
    bst_part_mask_free(&work);
}

static void test_windows(void **state) {
    (void)state;
    for (int general = 0; general < 2; general++) {
        scene s;
        make_scene(&s, general);
        check(&s, (bst_window){0, 0, SIDE, SIDE}, 1);
        check(&s, (bst_window){0, 0, SIDE, SIDE}, 2);
        check(&s, (bst_window){30, 50, 90, 70}, 1);
        close_scene(&s);
    }
}

/* No body: nothing; a body beside the observer is left out. */
static void test_nothing(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scene s;
    bst_part_mask work = {0};
    static int32_t mask[SIDE * SIDE];
    make_scene(&s, false);
    bst_render_request q = {
        .window = {0, 0, SIDE, SIDE}, .track = &s.track.track, .sources = s.sources, .count = 2};
    s.sources[0].body = NULL;
    s.sources[1].range_m = 0.5;
    memset(mask, 7, sizeof mask);
    bst_assert_ok(&ctx, bst_part_mask_draw(&ctx, &work, &s.camera, &q, mask));
    for (int i = 0; i < SIDE * SIDE; i++) {
        assert_int_equal(mask[i], 0);
    }
    bst_part_mask_free(&work);
    close_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_windows),
                                       cmocka_unit_test(test_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
