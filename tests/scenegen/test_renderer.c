#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

static bst_renderer *make(fixture *f, const bst_camera *camera,
                          const bst_renderer_options *options) {
    bst_renderer *r;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, camera, options, &r));
    return r;
}

/* Renders and copies the digital numbers out. */
static void frame_of(fixture *f, bst_renderer *r, const bst_render_request *q, uint16_t *out) {
    bst_frame *frame;
    const uint16_t *pixels;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, q, &frame));
    bst_assert_ok(&f->ctx, bst_frame_map(frame, &f->ctx, &pixels));
    memcpy(out, pixels, (size_t)q->window.width * (size_t)q->window.height * sizeof *out);
    bst_frame_unmap(frame);
    bst_frame_release(frame);
}

/* Largest error of the noise-free image against the reference, in sigma of the pixel. */
static double error_sigma(fixture *f, const bst_camera *camera, const scene_motion *motion,
                          const bst_scene_source *sources, int count, double background_e) {
    bst_renderer *r = make(f, camera, NULL);
    scene_track track = scene_track_make(camera, motion);
    bst_render_request q = {.window = {0, 0, (int)camera->width_px, (int)camera->height_px},
                            .track = &track.track,
                            .sources = sources,
                            .count = count,
                            .background_e = background_e};
    size_t pixels = (size_t)camera->width_px * (size_t)camera->height_px;
    float *fast = malloc(pixels * sizeof *fast);
    double *reference = calloc(pixels, sizeof *reference), worst = 0.0;
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, fast));
    bst_assert_ok(&f->ctx, bst_reference_render(&f->ctx, camera, q.window, &track.track, sources,
                                                count, 1e-9, reference));
    double variance = background_e + camera->read_noise_e * camera->read_noise_e;
    for (size_t i = 0; i < pixels; i++) {
        worst = fmax(worst,
                     fabs(fast[i] - background_e - reference[i]) / sqrt(reference[i] + variance));
    }
    free(fast);
    free(reference);
    scene_track_free(&track);
    bst_renderer_free(r);
    return worst;
}

static const scene_motion demo = {.x_px = 7.5,
                                  .y_px = 2.5,
                                  .bend_px = 0.05,
                                  .roll_rad = 1e-4,
                                  .jitter_px = 0.2,
                                  .duration_s = 0.5,
                                  .samples = 501,
                                  .seed = 3};

/* 0.05 sigma is the accuracy that the project states for the demonstration's scene. */
static void images_agree_with_the_reference(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(192, 160);
    bst_scene_source *stars = scene_stars(&camera, 12, 1e6, 5.0, 9);
    bst_assert_close(error_sigma(f, &camera, &demo, stars, 12, 1.0), 0.0, 0.05);
    scene_motion still = demo;
    still.x_px = still.y_px = 0.0;
    bst_assert_close(error_sigma(f, &camera, &still, stars, 12, 1.0), 0.0, 0.05);
    scene_motion fast = {.x_px = 120.0,
                         .y_px = 35.0,
                         .bend_px = 3.0,
                         .roll_rad = 0.02,
                         .jitter_px = 0.15,
                         .duration_s = 0.5,
                         .samples = 501};
    bst_assert_close(error_sigma(f, &camera, &fast, stars, 12, 1.0), 0.0, 0.05);
    /* two samples of the line of sight only */
    scene_motion sparse = {.x_px = 60.0, .y_px = -20.0, .duration_s = 0.5, .samples = 2};
    bst_assert_close(error_sigma(f, &camera, &sparse, stars, 12, 1.0), 0.0, 0.05);
    free(stars);
}

/* Rotation and distortion: 20 % in the corner, pincushion and barrel, stars and a moving object
 * against the reference, which projects every instant. */
static void distorted_images_agree_with_the_reference(void **state) {
    fixture *f = *state;
    const double signs[] = {1.0, -1.0};
    for (int i = 0; i < 2; i++) {
        bst_camera camera = scene_camera(192, 160);
        double corner = 125.0 * bst_camera_scale_rad(&camera);
        camera.rotation_deg = 30.0;
        camera.distortion.k1 = signs[i] * 0.2 / (corner * corner);
        camera.distortion.p2 = 0.01 / corner;
        camera.boresight_offset_px[0] = -3.5;
        if (signs[i] < 0.0) {
            camera.distortion.k1 *= 0.5; /* 10 %: a barrel of 20 % nearly folds */
        }
        bst_assert_ok(&f->ctx, bst_camera_prepare(&f->ctx, &camera));
        enum { STARS = 14 };
        bst_scene_source *stars = scene_stars(&camera, STARS, 1e6, 5.0, 9);
        /* the last is an object that crosses the field by itself */
        bst_scene_source *object = &stars[STARS - 1];
        object->kind = BST_SOURCE_OBJECT;
        object->electrons_per_s = 3e5;
        object->apparent_mid = bst_camera_unproject(&camera, 90.0, 75.0);
        bst_scene_source_path path = bst_scene_source_path_through(
            bst_camera_unproject(&camera, 30.0, 60.0), object->apparent_mid,
            bst_camera_unproject(&camera, 140.0, 100.0));
        object->path = &path;
        bst_assert_close(error_sigma(f, &camera, &demo, stars, STARS, 1.0), 0.0, 0.05);
        scene_motion fast = {.x_px = 60.0,
                             .y_px = 35.0,
                             .roll_rad = 0.02,
                             .jitter_px = 0.15,
                             .duration_s = 0.5,
                             .samples = 501};
        bst_assert_close(error_sigma(f, &camera, &fast, stars, STARS, 1.0), 0.0, 0.05);
        scene_motion sparse = {.x_px = 60.0, .y_px = -20.0, .duration_s = 0.5, .samples = 2};
        bst_assert_close(error_sigma(f, &camera, &sparse, stars, STARS, 1.0), 0.0, 0.05);
        free(stars);
    }
}

/* All light of a source arrives, wherever distortion puts it. */
static void distortion_keeps_the_light(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(192, 160);
    double corner = 125.0 * bst_camera_scale_rad(&camera);
    camera.rotation_deg = -75.0;
    camera.distortion.k1 = 0.3 / (corner * corner);
    bst_assert_ok(&f->ctx, bst_camera_prepare(&f->ctx, &camera));
    bst_scene_source star = scene_star(&camera, 165.25, 130.5, 1e5);
    scene_track track = scene_track_make(&camera, &demo);
    bst_renderer *r = make(f, &camera, NULL);
    bst_render_request q = {
        .window = {0, 0, 192, 160}, .track = &track.track, .sources = &star, .count = 1};
    static float image[192 * 160];
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    double sum = 0.0;
    for (int i = 0; i < 192 * 160; i++) {
        sum += (double)image[i];
    }
    /* 5e4 electrons; the stamp leaves out 0.015 of 8 e per pixel over some hundred pixels */
    bst_assert_close(sum, 5e4, 10.0);
    bst_renderer_free(r);
    scene_track_free(&track);
}

/* Stamps over several vectors, a star far over the full well, and a PSF narrower than a pixel. */
static void wide_narrow_and_bright(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(192, 160);
    bst_scene_source star = scene_star(&camera, 95.4, 80.7, 2e7);
    scene_motion still = {.duration_s = 0.5, .samples = 2};
    bst_assert_close(error_sigma(f, &camera, &still, &star, 1, 1.0), 0.0, 0.05);
    bst_assert_close(error_sigma(f, &camera, &demo, &star, 1, 1.0), 0.0, 0.05);
    camera.psf_fwhm_px = 9.0;
    bst_assert_close(error_sigma(f, &camera, &demo, &star, 1, 1.0), 0.0, 0.05);
    camera.psf_fwhm_px = 0.8; /* test_fidelity.c has its kernel compiled too */
    star.electrons_per_s = 1e5;
    bst_assert_close(error_sigma(f, &camera, &demo, &star, 1, 1.0), 0.0, 0.05);
}

/* A target at rest on the image while the camera turns, and one that crosses a staring camera. */
static void moving_objects_have_their_own_tracks(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(192, 160);
    double cx = bst_camera_centre_x(&camera), cy = bst_camera_centre_y(&camera);
    bst_scene_source tracked = scene_star(&camera, cx, cy, 4e4);
    tracked.kind = BST_SOURCE_OBJECT;
    bst_vec3 middle = tracked.apparent_mid;
    bst_scene_source_path path =
        bst_scene_source_path_through(bst_camera_unproject(&camera, cx + 3.75, cy + 1.25), middle,
                                      bst_camera_unproject(&camera, cx - 3.75, cy - 1.25));
    tracked.path = &path;
    bst_assert_close(error_sigma(f, &camera, &demo, &tracked, 1, 1.0), 0.0, 0.05);
    bst_scene_source crossing = tracked;
    path = bst_scene_source_path_through(bst_camera_unproject(&camera, cx - 30.0, cy + 2.0), middle,
                                         bst_camera_unproject(&camera, cx + 30.0, cy + 5.0));
    scene_motion still = {.duration_s = 0.5, .samples = 2};
    bst_assert_close(error_sigma(f, &camera, &still, &crossing, 1, 1.0), 0.0, 0.05);
    still.jitter_px = 0.2;
    still.samples = 501;
    bst_assert_close(error_sigma(f, &camera, &still, &crossing, 1, 1.0), 0.0, 0.05);
}

/* An object so near that most of its way is beside or behind the camera. */
static void near_passes_are_drawn_where_they_cross(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(192, 160);
    bst_scene_source pass = scene_star(&camera, 0, 0, 1e8);
    pass.kind = BST_SOURCE_OBJECT;
    scene_motion still = {.duration_s = 0.5, .samples = 301, .jitter_px = 0.2};
    /* straight at a distance of 1 at mid-exposure: beside, then slantwise from behind */
    for (int c = 0; c < 2; c++) {
        bst_vec3 mid = bst_camera_unproject(&camera, 90.0, 70.0);
        bst_vec3 step = c == 0 ? (bst_vec3){0.15, 0.05, 0.0} : (bst_vec3){0.2, -0.3, 1.3};
        bst_scene_source_path path =
            bst_scene_source_path_through(bst_vec3_sub(mid, step), mid, bst_vec3_add(mid, step));
        pass.path = &path;
        double error = error_sigma(f, &camera, &still, &pass, 1, 1.0);
        bst_assert_close(error, 0.0, 0.05);
    }
}

/* Pixels and group of other tiles of the device's form (test_gpu_form.c compares the forms). */
static const int other_tiles[2][4][3] = {{{64, 1, 32}, {64, 4, 16}, {512, 64, 1}, {64, 16, 2}},
                                         {{64, 1, 0}, {64, 4, 0}, {64, 16, 0}, {64, 3, 0}}};

/* Each shape of tiles is compiled, for seconds: the others in the slow form. Tiles of one row tell
 * most: they find their nodes by the boxes that hold every row of every stamp. */
static int frame_shapes = 1;

/* The same pixels from any window, tile, group and number of threads. shapes: number of the tiles
 * above that are tried. */
static void bytes_do_not_depend_on(fixture *f, double read_noise_e, double full_well_e,
                                   int shapes) {
    enum { W = 300, H = 200 };
    static uint16_t full[W * H], other[W * H];
    bst_camera camera = scene_camera(W, H);
    camera.read_noise_e = read_noise_e;
    camera.full_well_e = full_well_e;
    /* so bright that the first plan, which no window changes, keeps the tolerance */
    bst_scene_source *stars = scene_stars(&camera, 200, 1e6, 6.0, 4);
    scene_track track = scene_track_make(&camera, &demo);
    bst_render_request q = {.window = {0, 0, W, H},
                            .track = &track.track,
                            .sources = stars,
                            .count = 200,
                            .background_e = 3.0,
                            .key = {{17, 23}},
                            .exposure_id = ((int64_t)1 << 40) + 5};
    bst_renderer *r = make(f, &camera, NULL);
    frame_of(f, r, &q, full);
    frame_of(f, r, &q, other);
    assert_memory_equal(full, other, sizeof full);

    const bst_window windows[] = {
        {0, 0, 1, 1}, {299, 199, 1, 1}, {37, 51, 101, 67}, {13, 0, 16, 200}, {5, 190, 290, 3}};
    for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
        bst_window w = windows[i];
        q.window = w;
        frame_of(f, r, &q, other);
        for (int y = 0; y < w.height; y++) {
            assert_memory_equal(&other[y * w.width], &full[(y + w.y0) * W + w.x0],
                                (size_t)w.width * sizeof *full);
        }
    }
    bst_renderer_free(r);

    q.window = (bst_window){0, 0, W, H};
    for (int i = 0; i < shapes; i++) {
        bst_renderer_options options = bst_renderer_default_options();
        options.tile_width = other_tiles[!bst_device_is_cpu(f->device)][i][0];
        options.tile_height = other_tiles[!bst_device_is_cpu(f->device)][i][1];
        options.group = other_tiles[!bst_device_is_cpu(f->device)][i][2];
        r = make(f, &camera, &options);
        frame_of(f, r, &q, other);
        assert_memory_equal(full, other, sizeof full);
        bst_renderer_free(r);
    }
    for (int threads = 1; threads <= 2; threads++) {
        fixture g = {0};
        bst_assert_ok(&g.ctx, bst_device_open(&g.ctx, "", threads, &g.device));
        r = make(&g, &camera, NULL);
        frame_of(&g, r, &q, other);
        assert_memory_equal(full, other, sizeof full);
        bst_renderer_free(r);
        bst_device_close(g.device);
    }
    /* another exposure, another key: other noise */
    r = make(f, &camera, NULL);
    q.exposure_id++;
    frame_of(f, r, &q, other);
    assert_memory_not_equal(full, other, sizeof full);
    q.exposure_id--;
    q.key.k[0]++;
    frame_of(f, r, &q, other);
    assert_memory_not_equal(full, other, sizeof full);
    bst_renderer_free(r);
    scene_track_free(&track);
    free(stars);
}

static void bytes_do_not_depend_on_how_they_are_made(void **state) {
    /* every method of the noise, and wells that fill; the device compiles each order of the noise
     * law (read noise below 3 and 5 e-) for each shape of tiles, for seconds: all shapes once. The
     * windows of the other orders begin and end anywhere in their tiles. */
    bytes_do_not_depend_on(*state, 8.0, 65000.0, frame_shapes);
    bytes_do_not_depend_on(*state, 8.0, 100.0, frame_shapes);
    bytes_do_not_depend_on(*state, 3.0, 100.0, 0);
    bytes_do_not_depend_on(*state, 1.0, 65000.0, 0);
    bytes_do_not_depend_on(*state, 0.4, 65000.0, 0);
}

/* The same light from tiles of one row and more, in every bit: the boxes by which tiles find the
 * nodes hold every row of every stamp. */
static void light_does_not_depend_on_tiles(void **state) {
    fixture *f = *state;
    enum { W = 300, H = 200, STARS = 400 };
    static float full[W * H], other[W * H];
    bst_camera camera = scene_camera(W, H);
    bst_scene_source *stars = scene_stars(&camera, STARS, 2e6, 6.0, 4);
    scene_track track = scene_track_make(&camera, &demo);
    bst_render_request q = {.window = {0, 0, W, H},
                            .track = &track.track,
                            .sources = stars,
                            .count = STARS,
                            .background_e = 3.0};
    enum { SHAPES = 4 };
    static const int vectors[SHAPES][3] = {{0, 0, 0}, {64, 1, 32}, {64, 2, 16}, {64, 64, 1}},
                     lanes[SHAPES][3] = {{0, 0, 0}, {64, 1, 0}, {64, 3, 0}, {64, 16, 0}};
    for (int i = 0; i < SHAPES; i++) {
        const int(*tiles)[3] = bst_device_is_cpu(f->device) ? vectors : lanes;
        bst_renderer_options options = bst_renderer_default_options();
        options.tile_width = tiles[i][0];
        options.tile_height = tiles[i][1];
        options.group = tiles[i][2];
        bst_renderer *r = make(f, &camera, &options);
        float *image = i == 0 ? full : other;
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
        assert_memory_equal(image, full, sizeof full);
        bst_renderer_free(r);
    }
    scene_track_free(&track);
    free(stars);
}

/* Frames that wait for their reader while others are begun are the same; what goes with them grows
 * meanwhile. */
static void frames_under_way(void **state) {
    fixture *f = *state;
    enum { W = 192, H = 160, FRAMES = 6, ALIVE = 3, STARS = 600 };
    static uint16_t alone[FRAMES][W * H];
    bst_camera camera = scene_camera(W, H);
    camera.detector.row_noise_e = 20.0;
    camera.detector.cosmic_rays = (bst_detector_cosmic_ray_config){.rate_per_cm2_s = 200.0,
                                                                   .pixel_pitch_um = 15.0,
                                                                   .depth_um = 10.0,
                                                                   .e_per_um = 80.0,
                                                                   .straggling = 0.2};
    bst_scene_source *stars = scene_stars(&camera, STARS, 2e6, 6.0, 4);
    scene_track track = scene_track_make(&camera, &demo);
    bst_render_request q[FRAMES];
    for (int i = 0; i < FRAMES; i++) {
        q[i] = (bst_render_request){.window = {0, 0, W - 9 * i, H},
                                    .track = &track.track,
                                    .sources = stars,
                                    .count = i * STARS / (FRAMES - 1),
                                    .background_e = i == 1 || i == 4 ? 1e6 : 3.0,
                                    .key = {{17, 23}},
                                    .exposure_id = i};
    }
    bst_renderer_options options = bst_renderer_default_options();
    options.shared_program = true; /* compiled for test_detector.c too */
    bst_renderer *r = make(f, &camera, &options);
    long long saturated[FRAMES], pixels;
    for (int i = 0; i < FRAMES; i++) {
        frame_of(f, r, &q[i], alone[i]);
        bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated[i]));
    }
    assert_int_equal(saturated[1], (W - 9) * H);
    long long frames = bst_renderer_saturated_frames(r);
    assert_true(frames >= 2);
    bst_renderer_free(r);

    r = make(f, &camera, &options);
    bst_frame *alive[FRAMES];
    for (int i = 0; i < FRAMES + ALIVE; i++) {
        if (i < FRAMES) {
            bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q[i], &alive[i]));
        }
        if (i >= ALIVE) {
            const uint16_t *dn;
            int n = i - ALIVE;
            bst_assert_ok(&f->ctx, bst_frame_map(alive[n], &f->ctx, &dn));
            assert_memory_equal(dn, alone[n], (size_t)(W - 9 * n) * H * sizeof *dn);
            bst_frame_unmap(alive[n]);
            bst_frame_release(alive[n]);
        }
    }
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &pixels));
    assert_int_equal(pixels, saturated[FRAMES - 1]);
    assert_int_equal(bst_renderer_saturated_frames(r), frames);
    bst_renderer_free(r);
    scene_track_free(&track);
    free(stars);
}

static void hard_cases(void **state) {
    fixture *f = *state;
    enum { W = 128, H = 96 };
    static uint16_t dn[W * H];
    static float image[W * H];
    bst_camera camera = scene_camera(W, H);
    camera.read_noise_e = 0.0;
    bst_renderer *r = make(f, &camera, NULL);
    scene_motion motion = {.duration_s = 0.0, .samples = 2};
    scene_track track = scene_track_make(&camera, &motion);
    bst_scene_source star = scene_star(&camera, 60.0, 40.0, 1e6);
    bst_render_request q = {
        .window = {0, 0, W, H}, .track = &track.track, .sources = &star, .count = 1};
    /* no time, no light, no noise: the offset everywhere */
    frame_of(f, r, &q, dn);
    for (int i = 0; i < W * H; i++) {
        assert_int_equal(dn[i], 100);
    }
    long long saturated;
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
    assert_int_equal(saturated, 0);
    /* light without end: full wells, clipped at the converter's top */
    q.background_e = 1e12;
    frame_of(f, r, &q, dn);
    for (int i = 0; i < W * H; i++) {
        assert_int_equal(dn[i], 65100);
    }
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
    assert_int_equal(saturated, W * H);
    bst_renderer_free(r);
    scene_track_free(&track);

    /* eight bits and an offset below zero: clip at both ends */
    camera.bits = 8;
    camera.offset_dn = -50.0;
    r = make(f, &camera, NULL);
    motion.duration_s = 0.5;
    track = scene_track_make(&camera, &motion);
    q.track = &track.track;
    q.background_e = 10.0;
    frame_of(f, r, &q, dn);
    assert_int_equal(dn[0], 0);
    assert_int_equal(dn[40 * W + 60], 255);
    bst_assert_ok(&f->ctx, bst_renderer_saturated(&f->ctx, r, &saturated));
    assert_true(saturated > 9 && saturated < 400); /* the star's core */
    /* occulted, dark, behind the camera, far off: nothing drawn */
    bst_scene_source none[4] = {star, star, star, star};
    none[0].occulted = true;
    none[1].electrons_per_s = 0.0;
    none[2].apparent_mid = (bst_vec3){0.0, 0.0, -1.0};
    none[3] = scene_star(&camera, 1e5, 0.0, 1e6);
    q.sources = none;
    q.count = 4;
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    for (int i = 0; i < W * H; i++) {
        assert_true(image[i] == 10.0f);
    }
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    assert_int_equal(stats.sources, 0);
    /* no sources at all */
    q.count = 0;
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    assert_true(image[W * H - 1] == 10.0f);
    bst_renderer_free(r);
    scene_track_free(&track);
}

/* The sum over the frame is what the sources give: sources well inside, 5e-4 for the cut stamps of
 * the faintest (0.02 sigma of 8 e- in each of some tens of pixels). */
static void a_hundred_thousand_stars(void **state) {
    fixture *f = *state;
    enum { W = 512, H = 512, N = 100000 };
    static float image[W * H];
    bst_camera camera = scene_camera(W, H);
    bst_renderer *r = make(f, &camera, NULL);
    scene_track track =
        scene_track_make(&camera, &(scene_motion){.x_px = 5.0, .duration_s = 0.5, .samples = 51});
    bst_scene_source *stars = malloc(N * sizeof *stars);
    bst_rng_key key = bst_rng_make_key(1, 0, "test", "stars");
    double total = 0.0;
    for (int i = 0; i < N; i++) {
        double flux = 200.0 / (1e-3 + bst_rng_uniform(key, (uint64_t)i, 2));
        stars[i] = scene_star(&camera, 20.0 + 470.0 * bst_rng_uniform(key, (uint64_t)i, 0),
                              20.0 + 470.0 * bst_rng_uniform(key, (uint64_t)i, 1), flux);
        total += 0.5 * flux;
    }
    bst_render_request q = {
        .window = {0, 0, W, H}, .track = &track.track, .sources = stars, .count = N};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    double sum = 0.0;
    for (int i = 0; i < W * H; i++) {
        sum += image[i];
    }
    bst_assert_close(sum / total, 1.0, 3e-3);
    bst_render_stats stats;
    bst_renderer_get_stats(r, &stats);
    assert_int_equal(stats.sources, N);
    bst_renderer_free(r);
    scene_track_free(&track);
    free(stars);
}

static void frames_come_from_a_pool(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(64, 64);
    bst_renderer_options options = bst_renderer_default_options();
    options.pool_frames = 2;
    bst_renderer *r = make(f, &camera, &options);
    scene_track track = scene_track_make(&camera, &(scene_motion){.duration_s = 0.5, .samples = 2});
    bst_render_request q = {.window = {8, 8, 32, 16}, .track = &track.track, .background_e = 5.0};
    bst_frame *a, *b, *c;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &a));
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &b));
    assert_int_equal(bst_renderer_render(&f->ctx, r, &q, &c), BST_ERR_STATE);
    assert_non_null(strstr(f->ctx.message, "pool_frames"));
    assert_int_equal(a->width, 32);
    assert_int_equal(a->height, 16);
    assert_non_null(bst_frame_device_buffer(a));
    bst_frame_release(a);
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &c));
    bst_frame_release(c);
    /* a frame outlives its renderer */
    bst_renderer_free(r);
    const uint16_t *p, *again;
    bst_assert_ok(&f->ctx, bst_frame_map(b, &f->ctx, &p));
    bst_assert_ok(&f->ctx, bst_frame_map(b, &f->ctx, &again));
    assert_ptr_equal(p, again);
    assert_true(p[0] > 50 && p[0] < 160);
    bst_frame_unmap(b);
    bst_frame_unmap(b);
    bst_frame_release(b);
    scene_track_free(&track);
}

static void streaks_without_end_are_refused(void **state) {
    fixture *f = *state;
    enum { N = 40000 };
    bst_camera camera = scene_camera(64, 64);
    bst_renderer *r = make(f, &camera, NULL);
    /* 20,000 px take about as many nodes of 12 bytes, 9 GB in all: more than can be counted */
    scene_track track = scene_track_make(
        &camera, &(scene_motion){.x_px = 20000.0, .duration_s = 0.5, .samples = 51});
    bst_scene_source *stars = malloc(N * sizeof *stars);
    for (int i = 0; i < N; i++) {
        stars[i] = scene_star(&camera, 32.0, 64.0 * i / N, 1e9);
    }
    bst_render_request q = {
        .window = {0, 0, 64, 64}, .track = &track.track, .sources = stars, .count = N};
    bst_frame *frame;
    assert_int_equal(bst_renderer_render(&f->ctx, r, &q, &frame), BST_ERR_RANGE);
    assert_non_null(strstr(f->ctx.message, "the sources move too far in one exposure"));
    assert_non_null(strstr(f->ctx.message, "of 40000 need"));
    /* the renderer goes on */
    q.count = 2;
    bst_assert_ok(&f->ctx, bst_renderer_render(&f->ctx, r, &q, &frame));
    bst_frame_release(frame);
    bst_renderer_free(r);
    scene_track_free(&track);
    free(stars);
}

static void wrong_requests_and_cameras_are_refused(void **state) {
    fixture *f = *state;
    bst_camera camera = scene_camera(64, 64);
    bst_renderer *r = make(f, &camera, NULL);
    scene_track track = scene_track_make(&camera, &(scene_motion){.duration_s = 0.5, .samples = 2});
    const bst_window windows[] = {{-1, 0, 8, 8}, {0, 0, 65, 8}, {60, 0, 5, 5}, {0, 0, 0, 4}};
    bst_frame *frame;
    for (size_t i = 0; i < 4; i++) {
        bst_render_request q = {.window = windows[i], .track = &track.track};
        assert_int_equal(bst_renderer_render(&f->ctx, r, &q, &frame), BST_ERR_ARGUMENT);
        assert_null(frame);
    }
    bst_render_request q = {.window = {0, 0, 8, 8}, .track = &track.track, .background_e = NAN};
    assert_int_equal(bst_renderer_render(&f->ctx, r, &q, &frame), BST_ERR_ARGUMENT);
    bst_renderer_free(r);
    scene_track_free(&track);
    camera.psf_fwhm_px = 100.0;
    assert_int_equal(bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r), BST_ERR_ARGUMENT);
    assert_non_null(strstr(f->ctx.message, "psf_fwhm_px"));
    camera.psf_fwhm_px = 2.0;
    camera.bits = 17;
    assert_int_equal(bst_renderer_create(&f->ctx, f->device, &camera, NULL, &r), BST_ERR_ARGUMENT);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(images_agree_with_the_reference),
        cmocka_unit_test(distorted_images_agree_with_the_reference),
        cmocka_unit_test(distortion_keeps_the_light),
        cmocka_unit_test(wide_narrow_and_bright),
        cmocka_unit_test(moving_objects_have_their_own_tracks),
        cmocka_unit_test(near_passes_are_drawn_where_they_cross),
        cmocka_unit_test(bytes_do_not_depend_on_how_they_are_made),
        cmocka_unit_test(frames_under_way),
        cmocka_unit_test(hard_cases),
        cmocka_unit_test(a_hundred_thousand_stars),
        cmocka_unit_test(frames_come_from_a_pool),
        cmocka_unit_test(streaks_without_end_are_refused),
        cmocka_unit_test(wrong_requests_and_cameras_are_refused),
    };
    const struct CMUnitTest slow[] = {cmocka_unit_test(bytes_do_not_depend_on_how_they_are_made),
                                      cmocka_unit_test(light_does_not_depend_on_tiles)};
    bool is_slow = argc > 1 && strcmp(argv[1], "slow") == 0;
    frame_shapes = is_slow ? 4 : frame_shapes;
    return is_slow ? cmocka_run_group_tests(slow, open_device, close_device)
                   : cmocka_run_group_tests(tests, open_device, close_device);
}
