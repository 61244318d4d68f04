/* What the renderer does differently with a GPU, on any device: planning on several threads, and
 * (with the argument "slow": PoCL compiles it for a minute) tiles that a work-group renders. */
#include "scenegen/renderer.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"

enum { W = 230, H = 160, STARS = 300, MOVING = 3, SOURCES = STARS + MOVING };

/* A scene with every way in which sources move, and a detector with every effect of its own. */
typedef struct scene {
    bst_camera camera;
    scene_track track;
    bst_scene_source_path paths[MOVING];
    bst_scene_source *sources;
    bst_render_request request;
} scene;

static void make_scene(scene *s) {
    static const scene_motion motion = {.x_px = 60.0,
                                        .y_px = 25.0,
                                        .bend_px = 2.0,
                                        .roll_rad = 0.02,
                                        .jitter_px = 0.2,
                                        .duration_s = 0.5,
                                        .samples = 501,
                                        .seed = 3};
    s->camera = scene_camera(W, H);
    s->camera.dark_current_e_per_s =
        5.0; /* the effects that test_cosmic_rays.c compiles for, too */
    s->camera.detector = (bst_detector_config){.prnu_rms = 0.01,
                                               .dsnu_rms = 0.2,
                                               .column_offset_rms_e = 1.0,
                                               .row_noise_e = 0.5,
                                               .telegraph_noise_fraction = 0.01,
                                               .telegraph_noise_rms_e = 12.0,
                                               .nonlinearity = {-0.005, 0.001, 0.0},
                                               .cosmic_rays = {.rate_per_cm2_s = 200.0,
                                                               .pixel_pitch_um = 15.0,
                                                               .depth_um = 10.0,
                                                               .e_per_um = 80.0,
                                                               .straggling = 0.2}};
    s->track = scene_track_make(&s->camera, &motion);
    bst_scene_source *stars = scene_stars(&s->camera, STARS, 2e6, 6.0, 4);
    s->sources = calloc(SOURCES, sizeof *s->sources);
    memcpy(s->sources, stars, STARS * sizeof *stars);
    free(stars);
    for (int i = 0; i < MOVING; i++) {
        double x = 60.0 + 40.0 * i, y = 50.0 + 20.0 * i;
        bst_scene_source *t = &s->sources[STARS + i];
        *t = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                .apparent_mid = bst_camera_unproject(&s->camera, x, y),
                                .electrons_per_s = 20000.0};
        s->paths[i] = bst_scene_source_path_through(
            bst_camera_unproject(&s->camera, x - 20.0, y + 5.0), t->apparent_mid,
            bst_camera_unproject(&s->camera, x + 20.0, y - 4.0));
        t->path = &s->paths[i];
    }
    s->request = (bst_render_request){.window = {0, 0, W, H},
                                      .track = &s->track.track,
                                      .sources = s->sources,
                                      .count = SOURCES,
                                      .background_e = 3.0,
                                      .key = {{17, 23}},
                                      .exposure_id = 5};
}

static void free_scene(scene *s) {
    free(s->sources);
    scene_track_free(&s->track);
}

typedef struct picture {
    uint16_t dn[W * H];
    float light[W * H];
    double predicted_sigma;
    long long nodes, saturated;
} picture;

static void render(fixture *f, const scene *s, const bst_renderer_options *options, picture *out) {
    bst_renderer *r;
    bst_frame *frame;
    const uint16_t *dn;
    bst_render_stats stats;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s->camera, options, &r));
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &s->request, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &dn));
    int side = s->request.binning > 1 ? s->request.binning : 1;
    *out = (picture){.nodes = 0};
    memcpy(out->dn, dn, (size_t)(W / side) * (size_t)(H / side) * sizeof *out->dn);
    bst_frame_unmap(frame);
    bst_frame_release(frame);
    bst_renderer_get_stats(r, &stats);
    out->predicted_sigma = stats.predicted_sigma;
    out->nodes = stats.nodes;
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &out->saturated));
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &s->request, out->light));
    bst_renderer_free(r);
}

static void planning_threads_change_nothing(void **state) {
    fixture *f = *state;
    static picture one, many;
    for (int binning = 1; binning <= 3; binning += 2) { /* a pixel that is read is of 1, of 9 */
        scene s;
        make_scene(&s);
        s.request.binning = binning;
        bst_renderer_options options = bst_renderer_default_options();
        options.planning_threads = 1;
        render(f, &s, &options, &one);
        options.planning_threads = 3;
        render(f, &s, &options, &many);
        assert_true(one.nodes > 16 * SOURCES);
        assert_int_equal(one.nodes, many.nodes);
        assert_true(one.predicted_sigma == many.predicted_sigma);
        assert_memory_equal(one.dn, many.dn, sizeof one.dn);
        assert_memory_equal(one.light, many.light, sizeof one.light);
        free_scene(&s);
    }
}

/* The same light in every bit, and digital numbers that differ by rounding: the noise law of dark
 * pixels is interpolated by one form only. */
static void work_groups_render_the_same_frame(void **state) {
    fixture *f = *state;
    static picture vectors, lanes, rows;
    scene s;
    make_scene(&s);
    bst_renderer_options options = bst_renderer_default_options();
    options.tile_width = 64;
    options.tile_height = 64;
    options.group = 1;
    render(f, &s, &options, &vectors);
    options.tile_height = 8;
    options.group = 0;
    render(f, &s, &options, &lanes);
    assert_memory_equal(vectors.light, lanes.light, sizeof lanes.light);
    assert_int_equal(vectors.saturated, lanes.saturated);
    int others = 0;
    for (int i = 0; i < W * H; i++) {
        int away = abs((int)vectors.dn[i] - (int)lanes.dn[i]);
        assert_true(away <= 1);
        others += away;
    }
    assert_true(others < W * H / 1000);
    options.tile_height = 3;
    render(f, &s, &options, &rows);
    assert_memory_equal(rows.light, lanes.light, sizeof lanes.light);
    assert_memory_equal(rows.dn, lanes.dn, sizeof lanes.dn);
    free_scene(&s);
}

int main(int argc, char **argv) {
    const struct CMUnitTest fast[] = {cmocka_unit_test(planning_threads_change_nothing)};
    const struct CMUnitTest slow[] = {cmocka_unit_test(work_groups_render_the_same_frame)};
    return argc > 1 && strcmp(argv[1], "slow") == 0
               ? cmocka_run_group_tests(slow, open_device, close_device)
               : cmocka_run_group_tests(fast, open_device, close_device);
}
