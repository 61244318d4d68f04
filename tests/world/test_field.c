/* The field query against brute force. */
#include "sim/optics/psf.h"
#include "sim/world/scene/truth_list.h"
#include "tests/world/field_scene.h"

/* The same through a lens with this distortion, focal plane turned by 30 degrees. */
static scene make_lens_scene(const char *distortion) {
    char text[2000];
    snprintf(
        text, sizeof text,
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"rotation_deg\": 30, \"distortion\": {%s}}}]}]}",
        distortion);
    return make_scene_in(test_world(text));
}

static void query(scene *s, int64_t end_tick, bst_window window) {
    bst_field_options options = {.v_limit = 13, .margin_px = 5};
    bst_assert_ok(&s->ctx,
                  bst_field_track(&s->ctx, s->field, s->history, 0, end_tick, RATE, &s->track));
    bst_assert_ok(&s->ctx, bst_field_query(&s->ctx, s->field, &s->track, 0, end_tick, RATE, window,
                                           &options, &s->truth, &s->sources, &s->count));
}

static const bst_window full = {0, 0, 1024, 1024};

static double noise(unsigned *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / 8388608.0 - 1.0;
}

/* Fills 0.5 s: a straight way of (dx, dy) px, a roll, and jitter of rms px per axis, by the sum of
 * sines between 5 and 200 Hz. */
static void fill_seeded(scene *s, double dx, double dy, double roll, double rms, unsigned seed) {
    double a[2][20], f[20], p[2][20];
    for (int k = 0; k < 20; k++) {
        f[k] = 5 + 195.0 * k / 19;
        for (int i = 0; i < 2; i++) {
            a[i][k] = rms * sqrt(2.0 / 20);
            p[i][k] = 3.14 * noise(&seed);
        }
    }
    s->history->written = 0;
    for (int64_t tick = 0; tick <= 3000; tick += 6) {
        double t = (double)tick / RATE, u = t / 0.5 - 0.5, j[2] = {0, 0};
        for (int i = 0; i < 2; i++) {
            for (int k = 0; k < 20; k++) {
                j[i] += a[i][k] * sin(2 * BST_PI * f[k] * t + p[i][k]);
            }
        }
        push(s->history, tick, turned(s->target, dx * u + j[0], dy * u + j[1], roll * u));
    }
}

static void fill(scene *s, double dx, double dy, double roll, double rms) {
    fill_seeded(s, dx, dy, roll, rms, 7);
}

/* Where the source is at many instants of the exposure, with equal weights. */
enum { FINE = 16, MOST = 500 * FINE + 16 };
static double x_of[MOST], y_of[MOST];
static int dense_track(const scene *s, const bst_scene_source *source, double *x, double *y) {
    const bst_camera *camera = bst_world_camera(s->world, 0, 0);
    double total = s->track.time_s[s->track.count - 1];
    int n = 0;
    for (int k = 0; k + 1 < s->track.count; k++) {
        for (int i = 0; i < FINE; i++) {
            double f = (i + 0.5) / FINE;
            bst_quat q =
                bst_quat_slerp(s->track.q_cam_from_gcrf[k], s->track.q_cam_from_gcrf[k + 1], f);
            double t = s->track.time_s[k] + f * (s->track.time_s[k + 1] - s->track.time_s[k]);
            bst_vec3 d = bst_scene_source_direction(source, t / total);
            assert_true(n < MOST);
            assert_true(bst_camera_project(camera, bst_quat_rotate(q, d), &x[n], &y[n]));
            n++;
        }
    }
    return n;
}

static double mean_of(const double *values, int n) {
    double sum = 0;
    for (int k = 0; k < n; sum += values[k++] / n) {
    }
    return sum;
}

static void expect_means(scene *s, double tolerance_px) {
    assert_true(s->count > 20); /* a patch of the catalogue to V 12 lies there */
    bool object = false;
    for (int i = 0; i < s->count; i++) {
        int n = dense_track(s, &s->sources[i], x_of, y_of);
        double x = mean_of(x_of, n), y = mean_of(y_of, n);
        bst_truth_item item;
        bst_field_truth_item(s->field, &s->track, &s->sources[i], full, 1, &s->truth, &item);
        bst_assert_close(item.x_chief_px, x, tolerance_px);
        bst_assert_close(item.y_chief_px, y, tolerance_px);
        assert_int_equal((item.flags & BST_TRUTH_IN_FIELD) != 0,
                         x >= -0.5 && x < 1023.5 && y >= -0.5 && y < 1023.5);
        object |= item.kind == BST_SOURCE_OBJECT;
    }
    assert_true(object);
    /* the light of a star at the mean attitude's boresight has its middle there */
    bst_quat back = bst_quat_conj(s->truth.q_cam_from_gcrf_mean);
    const bst_scene_source star = {.apparent_mid = bst_quat_rotate(back, (bst_vec3){0, 0, 1})};
    int n = dense_track(s, &star, x_of, y_of);
    bst_assert_close(mean_of(x_of, n), 511.5, tolerance_px);
    bst_assert_close(mean_of(y_of, n), 511.5, tolerance_px);
}

static void mean_places_are_those_of_the_light(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    fill(&s, 3, 8, 0, 10); /* tracked, with jitter of 10 px */
    query(&s, 3000, full);
    expect_means(&s, 0.002);                  /* a tenth of the best centroid */
    fill(&s, 200, 224, 2 * BST_DEG_RAD, 0.2); /* a streak of 300 px that turns */
    query(&s, 3000, full);
    expect_means(&s, 0.02);
    free_scene(&s);
}

/* sum over pixels of the squared image of one electron. */
static double brute_squared_image(int n, double sigma) {
    enum { SIZE = 420 };
    static double image[SIZE][SIZE];
    memset(image, 0, sizeof image);
    const double r = sigma * sqrt(2.0);
    int left = (int)mean_of(x_of, n) - SIZE / 2, top = (int)mean_of(y_of, n) - SIZE / 2;
    for (int k = 0; k < n; k++) {
        int cx = (int)floor(x_of[k] + 0.5) - left, cy = (int)floor(y_of[k] + 0.5) - top;
        double wx[15], wy[15];
        for (int i = -7; i <= 7; i++) {
            double dx = cx + left + i - x_of[k], dy = cy + top + i - y_of[k];
            wx[i + 7] = 0.5 * (erf((dx + 0.5) / r) - erf((dx - 0.5) / r));
            wy[i + 7] = 0.5 * (erf((dy + 0.5) / r) - erf((dy - 0.5) / r));
        }
        for (int j = -7; j <= 7; j++) {
            for (int i = -7; i <= 7; i++) {
                assert_true(cx + i >= 0 && cx + i < SIZE && cy + j >= 0 && cy + j < SIZE);
                image[cy + j][cx + i] += wx[i + 7] * wy[j + 7] / n;
            }
        }
    }
    double sum = 0;
    for (int i = 0; i < SIZE * SIZE; i++) {
        sum += image[i / SIZE][i % SIZE] * image[i / SIZE][i % SIZE];
    }
    return sum;
}

static void expect_snr(scene *s, const bst_scene_source *source, double variance,
                       double tolerance) {
    int n = dense_track(s, source, x_of, y_of);
    double squared =
        brute_squared_image(n, bst_camera_psf_sigma_px(bst_world_camera(s->world, 0, 0)));
    bst_truth_item item;
    bst_field_truth_item(s->field, &s->track, source, full, 1, &s->truth, &item);
    bst_assert_close(item.electrons, source->electrons_per_s * 0.5, 1e-9);
    bst_assert_close(item.snr / (item.electrons * sqrt(squared / variance)), 1, tolerance);
}

static void snr_is_that_of_the_smeared_image(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    const double cases[][4] = {/* dx, dy, roll in degrees, jitter rms px */
                               {0, 0, 0, 0},   {1, 0.5, 0, 0}, {10, -7, 0, 0},  {200, 220, 0, 0},
                               {0, 0, 0, 0.2}, {0, 0, 0, 0.6}, {25, 5, 0, 0.2}, {-40, 160, 1, 0.2}};
    /* 2 % is the task's. What is left: the phase within the pixel (0.5 %), jitter that is not
     * Gaussian, the bend of the last */
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        fill(&s, cases[c][0], cases[c][1], cases[c][2] * BST_DEG_RAD, cases[c][3]);
        query(&s, 3000, full);
        double variance = s.truth.background_e + s.truth.dark_e + 64;
        /* by hand: 4.44645 e/s of sky, 0.5 e/s of dark current, half a second */
        bst_assert_close(variance, 0.5 * (4.44645 + 0.5) + 64, 1e-4);
        for (int i = 0; i < s.count; i += 1 + s.count / 6) {
            expect_snr(&s, &s.sources[i], variance, 0.02);
        }
    }
    free_scene(&s);
}

/* Streaks with strong jitter: their ends are places of the jitter, which is not the length. */
static void snr_of_shaken_streaks(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    const double cases[][3] = {/* dx, dy, jitter rms px */ {8, 1, 1}, {2, 0, 0.7}, {0, 0, 1}};
    double worst = 0.0;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double sum = 0.0;
        enum { SEEDS = 4 };
        for (unsigned seed = 1; seed <= SEEDS; seed++) {
            fill_seeded(&s, cases[c][0], cases[c][1], 0, cases[c][2], seed);
            query(&s, 3000, full);
            const bst_scene_source *source = &s.sources[0];
            double variance = s.truth.background_e + s.truth.dark_e + 64;
            int n = dense_track(&s, source, x_of, y_of);
            double squared =
                brute_squared_image(n, bst_camera_psf_sigma_px(bst_world_camera(s.world, 0, 0)));
            bst_truth_item item;
            bst_field_truth_item(s.field, &s.track, source, full, 1, &s.truth, &item);
            double off = item.snr / (item.electrons * sqrt(squared / variance)) - 1.0;
            sum += off / SEEDS;
            worst = fmax(worst, fabs(off));
        }
        bst_assert_close(sum, 0, 0.02);
    }
    bst_assert_close(worst, 0, 0.05);
    free_scene(&s);
}

/* The noise of a multiplication register counts. */
static void snr_falls_with_multiplied_noise(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"read_noise_e\": 1, \"background_mag_arcsec2\": 19, "
        "\"detector\": {\"em_gain\": 5}}}]}]}"));
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    double variance = 1.8 * (s.truth.background_e + s.truth.dark_e) + 1.0;
    assert_true(s.truth.background_e > 5.0 && s.count > 3);
    for (int i = 0; i < s.count; i += 1 + s.count / 4) {
        expect_snr(&s, &s.sources[i], variance, 0.02); /* as above */
    }
    free_scene(&s);
}

/* A line of sight that moves by some px and swings across in half waves. */
static void snr_of_bent_streaks(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    /* the last four are long ones that turn back on themselves, or nearly */
    const double cases[][4] = {/* line, swing, half waves, roll in degrees */
                               {30, 4, 1, 0},  {60, 12, 1, 0},  {40, 6, 2, 0},   {0, 10, 1, 0},
                               {0, 30, 2, 0},  {150, 40, 1, 0}, {20, 20, 3, 0},  {10, 6, 1, 2},
                               {0, 180, 1, 0}, {0, 180, 2, 0},  {30, 180, 2, 0}, {4, 300, 1, 1}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        s.history->written = 0;
        for (int64_t tick = 0; tick <= 3000; tick += 6) {
            double u = (double)tick / 3000.0;
            double x = cases[c][0] * (u - 0.5), y = cases[c][1] * sin(BST_PI * cases[c][2] * u);
            push(s.history, tick, turned(s.target, x, y, cases[c][3] * BST_DEG_RAD * (u - 0.5)));
        }
        query(&s, 3000, full);
        double variance = s.truth.background_e + s.truth.dark_e + 64;
        for (int i = 0; i < s.count; i += 1 + s.count / 3) {
            expect_snr(&s, &s.sources[i], variance, 0.03);
        }
    }
    free_scene(&s);
}

/* A Moffat PSF that widens over the field, and vignetting: what the truth says of the light. */
static void truth_follows_the_optics(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"optics\": {\"psf\": \"moffat\", \"field_columns\": 2, "
        "\"field\": [{\"psf_fwhm_px\": 2}, {\"psf_fwhm_px\": 4}], \"vignetting\": "
        "{\"model\": \"polynomial\", \"coefficients\": [-0.4, 0, 0]}}}}]}]}"));
    const bst_camera *camera = bst_world_camera(s.world, 0, 0);
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    assert_true(s.count > 20);
    double variance = s.truth.background_e + s.truth.dark_e + 64, least = 1.0, most = 0.0;
    for (int i = 0; i < s.count; i++) {
        bst_truth_item item;
        bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
        double dx = item.x_chief_px - bst_camera_centre_x(camera),
               dy = item.y_chief_px - bst_camera_centre_y(camera);
        double share = 1.0 - 0.4 * (dx * dx + dy * dy) / (2.0 * 512.0 * 512.0);
        bst_assert_close(item.electrons, share * s.sources[i].electrons_per_s * 0.5, 1e-9);
        double u = fmin(fmax(item.x_chief_px / 1023.0, 0.0), 1.0);
        if (s.sources[i].kind == BST_SOURCE_STAR) { /* at rest: the image is a mean of two */
            double snr = item.electrons * sqrt(test_mixed_square(camera->psf, u) / variance);
            bst_assert_close(item.snr / snr, 1, 0.02);
        }
        least = fmin(least, u);
        most = fmax(most, u);
    }
    assert_true(least < 0.2 && most > 0.8);
    free_scene(&s);
}

static bool has_star(const scene *s, uint32_t id) {
    for (int i = 0; i < s->count; i++) {
        if (s->sources[i].kind == BST_SOURCE_STAR && s->sources[i].id == id) {
            return true;
        }
    }
    return false;
}

/* Every star of the whole sky that is on the window at any sample is among the sources. */
static void expect_no_star_missed(scene s) {
    const bst_camera *camera = bst_world_camera(s.world, 0, 0);
    const double cases[][3] = {{0, 0, 0}, {300, 0, 0}, {-200, 250, 0}, {50, 0, 5}, {900, 900, 20}};
    const bst_window windows[] = {{0, 0, 1024, 1024}, {700, 10, 200, 100}, {1000, 1000, 24, 24}};
    enum { ROOM = 400000 };
    bst_star *all = malloc(ROOM * sizeof *all);
    assert_non_null(all);
    for (int c = 0; c < 5; c++) {
        fill(&s, cases[c][0], cases[c][1], cases[c][2] * BST_DEG_RAD, 0.2);
        for (int w = 0; w < 3; w++) {
            query(&s, 3000, windows[w]);
            bst_light light = {s.truth.velocity_bary_mps, s.truth.sun_m};
            /* a wide cone stands for the whole sky, with proper motion to the same date */
            bst_vec3 centre = bst_quat_rotate(bst_quat_conj(s.target), (bst_vec3){0, 0, 1});
            int n = 0, there = 0;
            bst_assert_ok(&s.ctx, bst_stars_query(&s.ctx, bst_world_stars(s.world), centre,
                                                  6 * BST_DEG_RAD, 13, 2022.457, all, ROOM, &n));
            assert_true(n < ROOM);
            for (int i = 0; i < n; i++) {
                bst_vec3 apparent = bst_light_apparent_star(&light, all[i].icrs);
                bool on = false;
                for (int k = 0; k < s.track.count && !on; k += 10) {
                    double x, y;
                    const bst_window *win = &windows[w];
                    on = bst_camera_project(camera,
                                            bst_quat_rotate(s.track.q_cam_from_gcrf[k], apparent),
                                            &x, &y) &&
                         x >= win->x0 - 4.9 && x <= win->x0 + win->width - 1 + 4.9 &&
                         y >= win->y0 - 4.9 && y <= win->y0 + win->height - 1 + 4.9;
                }
                there += on;
                if (on && !has_star(&s, all[i].id)) {
                    fail_msg("case %d window %d: star %08x is missing", c, w, all[i].id);
                }
            }
            assert_true(w > 0 || there > 20);
        }
    }
    free(all);
    free_scene(&s);
}

static void no_star_is_missed(void **state) {
    (void)state;
    expect_no_star_missed(make_scene(GX5));
    /* barrel and pincushion, 8 % and 15 % in the corner, and one that folds just outside */
    expect_no_star_missed(make_lens_scene("\"k1\": -720, \"p1\": 0.1"));
    expect_no_star_missed(make_lens_scene("\"k1\": 1350"));
    expect_no_star_missed(make_lens_scene("\"k1\": -1330"));
}

static double no_peak(const void *user, int index, const bst_truth_item *item) {
    return (void)user, (void)index, (void)item, 0.0;
}

/* Truth of a window by the latest query, with room for `capacity` sources. */
static bst_truth *truth_of(scene *s, bst_window window, int capacity) {
    bst_truth *truth = calloc(1, sizeof *truth + 4000 * sizeof truth->items[0]);
    bst_truth_list list = {0};
    memcpy(truth, &s->truth, sizeof *truth);
    const bst_truth_request q = {.field = s->field,
                                 .camera = bst_world_camera(s->world, 0, 0),
                                 .track = &s->track,
                                 .sources = s->sources,
                                 .count = s->count,
                                 .window = window,
                                 .binning = 1,
                                 .peak_e = no_peak};
    bst_assert_ok(&s->ctx, bst_truth_list_fill(&s->ctx, &list, &q, truth, capacity, NULL));
    bst_truth_list_free(&list);
    return truth;
}

/* A window of a sensor whose pixels exchange charge: the frame has the sources of the whole sensor,
 * the truth those near the window. */
static void truth_of_windows_is_near_them(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    bst_camera coupled = *bst_world_camera(s.world, 0, 0);
    coupled.detector.interpixel_coupling = 0.02;
    bst_field_set_camera(s.field, &coupled);
    const bst_window windows[] = {{480, 480, 64, 64}, {0, 0, 300, 200}};
    fill(&s, 12, 5, 0.001, 0.2);
    query(&s, 3000, full);
    int of_sensor = s.count;
    for (int w = 0; w < 2; w++) {
        bst_field_options options = {.v_limit = 13, .margin_px = 5};
        query(&s, 3000, windows[w]);
        const int of_window = s.count, most = w == 0 ? 4000 : of_window / 2;
        bst_truth *want = truth_of(&s, windows[w], most);
        options.read_charge = true;
        bst_assert_ok(&s.ctx, bst_field_query(&s.ctx, s.field, &s.track, 0, 3000, RATE, windows[w],
                                              &options, &s.truth, &s.sources, &s.count));
        assert_true(s.count == of_sensor && of_window > 0 && of_window < of_sensor);
        bst_truth *found = truth_of(&s, windows[w], most);
        assert_int_equal(found->count, want->count);
        assert_int_equal(found->lost, want->lost);
        bst_assert_close(found->background_e, want->background_e, 0.0);
        assert_memory_equal(found->items, want->items, (size_t)want->count * sizeof want->items[0]);
        free(want);
        free(found);
    }
    free_scene(&s);
}

static void an_exposure_of_no_length(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    push(s.history, 0, s.target);
    query(&s, 0, full);
    assert_int_equal(s.track.count, 2);
    assert_true(s.truth.background_e == 0 && s.truth.dark_e == 0);
    assert_true(s.count > 10);
    for (int i = 0; i < s.count; i++) {
        bst_truth_item item;
        bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
        assert_true(item.electrons == 0 && item.snr == 0);
        bst_assert_close(item.x_chief_px, item.x_mid_px, 1e-9);
        bst_assert_close(item.x_start_px, item.x_mid_px, 1e-9);
        bst_assert_close(item.y_end_px, item.y_mid_px, 1e-9);
    }
    free_scene(&s);
}

/* The object's place on a camera that points at it, and its numbers. */
static void the_target_is_where_the_sight_says(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    const bst_scene_source *object = &s.sources[s.count - 1];
    assert_int_equal(object->kind, BST_SOURCE_OBJECT);
    bst_world_view *view;
    bst_world_sight mid, end;
    bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &view));
    bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, view, 0, 0, 0.25, &mid));
    bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, view, 0, 0, 0.5, &end));
    bst_truth_item item;
    bst_field_truth_item(s.field, &s.track, object, full, 1, &s.truth, &item);
    const bst_camera *camera = bst_world_camera(s.world, 0, 0);
    double x = NAN, y = NAN;
    assert_true(bst_camera_project(camera, bst_quat_rotate(s.target, mid.apparent), &x, &y));
    bst_assert_close(item.x_mid_px, x, 1e-8);
    bst_assert_close(item.y_mid_px, y, 1e-8);
    assert_true(bst_camera_project(camera, bst_quat_rotate(s.target, end.apparent), &x, &y));
    bst_assert_close(item.x_end_px, x, 1e-8);
    assert_int_equal(item.norad, 44801);
    bst_assert_close(item.v_mag, mid.v_mag, 1e-12);
    bst_assert_close(item.range_m, mid.range_m, 1e-6);
    bst_assert_close(item.electrons, 0.5 * bst_camera_electrons_per_s(camera, mid.v_mag), 1e-9);
    /* half a second at 45 to 50 arcsec/s and 3 arcsec/px */
    bst_assert_close(hypot(item.x_end_px - item.x_start_px, item.y_end_px - item.y_start_px), 8, 1);
    /* the mean attitude of a camera at rest is the attitude */
    bst_assert_close(bst_vec3_norm(bst_quat_to_rotvec(
                         bst_quat_mul(s.truth.q_cam_from_gcrf_mean, bst_quat_conj(s.target)))),
                     0, 1e-14);
    bst_world_view_free(view);
    free_scene(&s);
}

static void the_earth_hides_stars(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    bst_world_view *view;
    bst_world_state eye;
    bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &view));
    bst_assert_ok(&s.ctx, bst_world_view_observer_state(&s.ctx, view, 0, 0.25, &eye));
    bst_vec3 down = bst_vec3_scale(eye.position_m, -1.0);
    s.target = bst_quat_look(down, (bst_vec3){0, 0, 1});
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    assert_true(s.count > 0);
    for (int i = 0; i < s.count; i++) {
        bst_truth_item item;
        bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
        assert_true(item.flags & BST_TRUTH_OCCULTED);
        assert_true(item.electrons == 0 && item.snr == 0 && isfinite(item.v_mag));
    }
    /* the opposite way all shine */
    s.target = bst_quat_look(eye.position_m, (bst_vec3){0, 0, 1});
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    assert_true(s.count > 0);
    for (int i = 0; i < s.count; i++) {
        assert_false(s.sources[i].occulted);
        assert_true(s.sources[i].electrons_per_s > 0);
    }
    bst_world_view_free(view);
    free_scene(&s);
}

static void what_came_down_is_not_there(void **state) {
    (void)state;
    scene s = make_scene(
        "{\"name\": \"gone\", \"orbit\": {\"elements_file\": "
        "\"tests/world/data/decayed.tle\", \"norad\": 28872}}, " GX5);
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    assert_int_equal(s.sources[s.count - 1].kind, BST_SOURCE_OBJECT);
    assert_int_equal(s.sources[s.count - 1].id, 1);
    assert_int_equal(s.sources[s.count - 2].kind, BST_SOURCE_STAR);
    free_scene(&s);
}

static int count_objects(const scene *s) {
    int n = 0;
    for (int i = 0; i < s->count; i++) {
        n += s->sources[i].kind == BST_SOURCE_OBJECT;
    }
    return n;
}

/* A catalogue holds the observer too: without its burns, 96 m ahead and brighter than the Sun. */
static void nobody_sees_itself_in_a_catalogue(void **state) {
    (void)state;
    scene s = make_scene_in(
        test_world("{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": "
                   "[{\"elements_file\": \"scenarios/catalogue_2022-06.tle\"}]}, \"observers\": "
                   "[{\"name\": \"neossat\", " TEST_NEOSSAT
                   ", \"burns\": [{\"time_s\": -100, \"dv_rtn_mps\": [0, 1, 0]}], \"sensors\": "
                   "[{" TEST_CAMERA ", \"cue\": {\"object\": \"NEOSSAT\"}}]}]}"));
    assert_int_equal(s.world->observers[0].norad, 39089);
    fill(&s, 0, 0, 0, 0);
    query(&s, 3000, full);
    assert_int_equal(count_objects(&s), 0);
    /* but others do */
    s.world->observers[0].norad = 0;
    query(&s, 3000, full);
    assert_int_equal(count_objects(&s), 1);
    assert_true(s.sources[s.count - 1].range_m > 50.0 && s.sources[s.count - 1].range_m < 200.0);
    free_scene(&s);
}

/* An object that passes the observer: the quartic against sights at many instants. */
static void fast_passes_are_followed(void **state) {
    (void)state;
    const struct {
        double radial_km, along_kmps, radial_kmps, exposure_s;
        double tolerance_px; /* at 0.5 arcsec a pixel */
    } cases[] = {
        {500, 10, 0, 2, 1e-3},   {500, 15, 0, 20, 1e-3}, {50, 10, 0, 2, 1e-3},
        {11, 15, 0, 2, 1e-3},    {11, 15, -5, 4, 1e-3},  {40, 0, 15, 2, 1e-3},
        {2000, 10, 5, 40, 1e-3}, {11, 15, 0, 40, 0.02}, /* w T / 2 = 0.02: where it ends */
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double duration = cases[c].exposure_s;
        char text[600];
        snprintf(text, sizeof text,
                 GX5 ", {\"name\": \"near\", " TEST_NEOSSAT
                     ", \"albedo\": 0}, {\"name\": \"pass\", \"orbit\": {\"source\": "
                     "\"relative\", \"reference\": \"near\", \"at_s\": %g, \"offset_rtn_m\": "
                     "[%g, 0, 3000], \"rate_rtn_mps\": [%g, %g, 100]}}",
                 0.5 * duration, 1e3 * cases[c].radial_km, 1e3 * cases[c].radial_kmps,
                 1e3 * cases[c].along_kmps);
        scene s = make_scene(text);
        bst_world_view *view;
        bst_world_sight sight;
        bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &view));
        bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, view, 0, 2, 0.5 * duration, &sight));
        s.target = bst_quat_look(sight.apparent, (bst_vec3){0, 0, 1});
        int64_t end = (int64_t)(RATE * duration);
        push(s.history, 0, s.target);
        push(s.history, end, s.target);
        query(&s, end, full);
        const bst_scene_source *source = &s.sources[s.count - 1];
        assert_true(source->kind == BST_SOURCE_OBJECT && source->id == 2);
        for (int i = 0; i <= 100; i++) {
            double u = i / 100.0;
            bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, view, 0, 2, u * duration, &sight));
            double off =
                test_distance(bst_vec3_unit(bst_scene_source_direction(source, u)), sight.apparent);
            bst_assert_close(off / (0.5 * BST_ARCSEC_RAD), 0, cases[c].tolerance_px);
        }
        bst_world_view_free(view);
        free_scene(&s);
    }
}

/* A ring of 100 samples that has been round several times gives the same as one that has not. */
int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mean_places_are_those_of_the_light),
        cmocka_unit_test(snr_is_that_of_the_smeared_image),
        cmocka_unit_test(snr_of_shaken_streaks),
        cmocka_unit_test(snr_falls_with_multiplied_noise),
        cmocka_unit_test(snr_of_bent_streaks),
        cmocka_unit_test(truth_follows_the_optics),
        cmocka_unit_test(no_star_is_missed),
        cmocka_unit_test(truth_of_windows_is_near_them),
        cmocka_unit_test(an_exposure_of_no_length),
        cmocka_unit_test(the_target_is_where_the_sight_says),
        cmocka_unit_test(the_earth_hides_stars),
        cmocka_unit_test(what_came_down_is_not_there),
        cmocka_unit_test(nobody_sees_itself_in_a_catalogue),
        cmocka_unit_test(fast_passes_are_followed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
