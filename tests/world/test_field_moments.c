/* Moments of a track and of images against sums over the track: the sigma points, streaks of a PSF
 * with wings, ghosts. */
#include "sim/optics/psf.h"
#include "sim/world/scene/field_internal.h"
#include "tests/world/field_scene.h"

static const bst_window full = {0, 0, 1024, 1024};

static void query(scene *s, double ghost_sigma) {
    bst_field_options options = {.v_limit = 13, .margin_px = 5, .ghost_sigma = ghost_sigma};
    bst_assert_ok(&s->ctx,
                  bst_field_track(&s->ctx, s->field, s->history, 0, 3000, RATE, &s->track));
    bst_assert_ok(&s->ctx, bst_field_query(&s->ctx, s->field, &s->track, 0, 3000, RATE, full,
                                           &options, &s->truth, &s->sources, &s->count));
}

/* Rotation of an attitude from that at mid-exposure, and the time, as numbers of one kind. */
static void coordinates(const scene *s, bst_quat q, double u, double out[4]) {
    const bst_vec3 d = bst_quat_to_rotvec(bst_quat_mul(q, bst_quat_conj(s->field->q_mid)));
    const double of[4] = {d.x, d.y, d.z, u};
    memcpy(out, of, sizeof of);
}

/* The points have the mean and the covariance of a track that slews, rolls, swings and stops. */
static void sigma_points_have_the_moments_of_the_track(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    for (int64_t tick = 0; tick <= 3000; tick += 60) {
        const double u = (double)tick / 3000.0, late = fmin(u, 0.7);
        push(s.history, tick,
             turned(s.target, 40 * late + 9 * sin(7 * u), -25 * u * u + 6 * cos(11 * u),
                    0.004 * late - 0.003 * u * u));
    }
    query(&s, 0.0);
    enum { PARTS = 50, FINE = 40 };
    double mean[4] = {0}, second[4][4] = {{0}}, found[4] = {0}, spread[4][4] = {{0}};
    assert_int_equal(s.track.count, PARTS + 1);
    for (int n = 0; n < PARTS * FINE; n++) {
        const int k = n / FINE;
        const double f = (n % FINE + 0.5) / FINE;
        double c[4];
        coordinates(&s,
                    bst_quat_slerp(s.track.q_cam_from_gcrf[k], s.track.q_cam_from_gcrf[k + 1], f),
                    (k + f) / PARTS, c);
        for (int i = 0; i < 4; i++) {
            mean[i] += c[i] / (PARTS * FINE);
            for (int j = 0; j < 4; j++) {
                second[i][j] += c[i] * c[j] / (PARTS * FINE);
            }
        }
    }
    for (int p = 1; p < BST_FIELD_SIGMA_POINTS; p++) {
        double c[4];
        coordinates(&s, s.field->sigma_q[p], s.field->sigma_time[p], c);
        for (int i = 0; i < 4; i++) {
            found[i] += c[i] / (BST_FIELD_SIGMA_POINTS - 1);
            for (int j = 0; j < 4; j++) {
                spread[i][j] += c[i] * c[j] / (BST_FIELD_SIGMA_POINTS - 1);
            }
        }
    }
    double centre[4];
    coordinates(&s, s.field->sigma_q[0], s.field->sigma_time[0], centre);
    for (int i = 0; i < 4; i++) {
        const double sigma = sqrt(second[i][i] - mean[i] * mean[i]);
        /* midpoints of 40 parts of each step: 1e-4 of a step's variance */
        bst_assert_close(found[i], mean[i], 1e-6 * sigma);
        bst_assert_close(centre[i], mean[i], 1e-6 * sigma);
        for (int j = 0; j < 4; j++) {
            const double other = sqrt(second[j][j] - mean[j] * mean[j]);
            bst_assert_close((spread[i][j] - found[i] * found[j]) / (sigma * other),
                             (second[i][j] - mean[i] * mean[j]) / (sigma * other), 1e-5);
        }
    }
    free_scene(&s);
}

/* A straight streak of a Moffat image: the squares of the PSF drawn over the streak's length. */
static void streaks_of_wide_wings_are_as_long_as_they_are(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"psf_fwhm_px\": 2.4, \"optics\": {\"psf\": \"moffat\", "
        "\"moffat_beta\": 2.5}}}]}]}"));
    const bst_camera *camera = bst_world_camera(s.world, 0, 0);
    const double ways[][2] = {{0, 0}, {3, -2}, {22, 9}, {-14, 60}};
    for (size_t k = 0; k < sizeof ways / sizeof *ways; k++) {
        s.history->written = 0;
        for (int64_t tick = 0; tick <= 3000; tick += 300) {
            const double u = (double)tick / 3000.0 - 0.5;
            push(s.history, tick, turned(s.target, ways[k][0] * u, ways[k][1] * u, 0.0));
        }
        query(&s, 0.0);
        const double variance = s.truth.background_e + s.truth.dark_e + 64;
        int stars = 0;
        for (int i = 0; i < s.count; i++) {
            const bst_scene_source *star = &s.sources[i];
            bst_truth_item item;
            bst_field_truth_item(s.field, &s.track, star, full, 1, &s.truth, &item);
            if (star->kind == BST_SOURCE_STAR) {
                const double square =
                    bst_psf_squared_image(camera->psf, star->colour, item.x_mid_px, item.y_mid_px,
                                          0.0, 0.0, hypot(ways[k][0], ways[k][1]));
                /* off the boresight a rotation moves stars by some 1e-4 more or less */
                bst_assert_close(item.snr / (item.electrons * sqrt(square / variance)), 1, 2e-3);
                stars++;
            }
        }
        assert_true(stars > 20);
    }
    free_scene(&s);
}

/* A ghost is a disc of 8 px, whose light adds 8^2 / 4 px^2 along either axis. */
static void ghosts_are_as_wide_along_both_axes(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"ghosts\": [{\"intensity\": 0.05, \"radius_px\": 8}]}}]}]}"));
    push(s.history, 0, s.target);
    push(s.history, 3000, s.target);
    query(&s, 0.01);
    const double variance = s.truth.background_e + s.truth.dark_e + 64;
    int count[2] = {0};
    double width[2][2] = {{INFINITY, 0}, {INFINITY, 0}}; /* variance of the image: least, most */
    for (int i = 0; i < s.count; i++) {
        const int kind = s.sources[i].kind;
        if (kind == BST_SOURCE_STAR || kind == BST_SOURCE_STAR_GHOST) {
            const int ghost = kind == BST_SOURCE_STAR_GHOST;
            bst_truth_item item;
            bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
            const double square = pow(item.snr / item.electrons, 2) * variance;
            const double of = 1 / (4 * BST_PI * square);
            width[ghost][0] = fmin(width[ghost][0], of);
            width[ghost][1] = fmax(width[ghost][1], of);
            count[ghost]++;
        }
    }
    assert_true(count[0] > 20 && count[1] > 0);
    const double sharp = 0.5 * (width[0][0] + width[0][1]);
    bst_assert_close(width[0][1] / width[0][0], 1, 1e-3);
    bst_assert_close(width[1][0], sharp + 16, 0.02);
    bst_assert_close(width[1][1], sharp + 16, 0.02);
    free_scene(&s);
}

/* The background of a window is that of its middle, whichever its sides: in a sky that grows along
 * x and, twice as fast, along y. */
static void backgrounds_are_those_of_the_middle(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"background\": {\"stray_e_per_s\": 200, \"gradient_e_per_s\": "
        "[80, 160]}}}]}]}"));
    push(s.history, 0, s.target);
    push(s.history, 3000, s.target);
    static const bst_window windows[] = {
        {0, 0, 1024, 1024}, {100, 300, 200, 40}, {180, 220, 40, 200}, {600, 60, 300, 100}};
    double found[4];
    for (int k = 0; k < 4; k++) {
        bst_field_options options = {.v_limit = 10, .margin_px = 5};
        bst_assert_ok(&s.ctx, bst_field_track(&s.ctx, s.field, s.history, 0, 3000, RATE, &s.track));
        bst_assert_ok(&s.ctx, bst_field_query(&s.ctx, s.field, &s.track, 0, 3000, RATE, windows[k],
                                              &options, &s.truth, &s.sources, &s.count));
        found[k] = s.truth.background_e;
    }
    bst_assert_close(found[1] / found[2], 1, 1e-6); /* both about (199.5, 319.5) */
    /* from the middle of the sensor: (-312, -192) and (238, -402) px; linear, so that differences
     * are as -312 - 2 * 192 and 238 - 2 * 402 */
    bst_assert_close((found[3] - found[0]) / (found[1] - found[0]),
                     (238.0 - 804.0) / (-312.0 - 384.0), 1e-4);
    assert_true(found[0] - found[1] > 10);
    free_scene(&s);
}

/* Each star that has its light in an oblong window is among the sources of the window's query. */
static void oblong_windows_have_their_stars(void **state) {
    (void)state;
    enum { MOST = 1000 };
    scene s = make_scene(GX5);
    push(s.history, 0, s.target);
    push(s.history, 3000, s.target);
    query(&s, 0.0);
    static struct {
        uint32_t id;
        double x, y;
    } stars[MOST];
    int count = 0, inside = 0;
    for (int i = 0; i < s.count; i++) {
        if (s.sources[i].kind == BST_SOURCE_STAR && count < MOST) {
            bst_truth_item item;
            bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
            stars[count].id = s.sources[i].id;
            stars[count].x = item.x_chief_px;
            stars[count++].y = item.y_chief_px;
        }
    }
    for (int k = 0; k < 32; k++) {
        const bst_window w = k % 2 ? (bst_window){0, 64 * (k / 2), 1024, 64}
                                   : (bst_window){64 * (k / 2), 0, 64, 1024};
        bst_field_options options = {.v_limit = 13, .margin_px = 5};
        bst_assert_ok(&s.ctx, bst_field_query(&s.ctx, s.field, &s.track, 0, 3000, RATE, w, &options,
                                              &s.truth, &s.sources, &s.count));
        for (int n = 0; n < count; n++) {
            if (stars[n].x > w.x0 - 0.5 && stars[n].x < w.x0 + w.width - 0.5 &&
                stars[n].y > w.y0 - 0.5 && stars[n].y < w.y0 + w.height - 0.5) {
                bool found = false;
                for (int i = 0; i < s.count; i++) {
                    found = found || (s.sources[i].kind == BST_SOURCE_STAR &&
                                      s.sources[i].id == stars[n].id);
                }
                assert_true(found);
                inside++;
            }
        }
    }
    assert_true(count < MOST && inside > 40); /* each in a column and in a row */
    free_scene(&s);
}

/* What is said to saturate: the peak of a Gaussian that is drawn over a length, with 15 % for the
 * place within the pixel. */
static void streaks_saturate_by_their_peaks(void **state) {
    (void)state;
    scene s = make_scene_in(test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"psf_fwhm_px\": 4, \"full_well_e\": 100}}]}]}"));
    const double sigma2 = 16 / (8 * log(2.0)) + 1.0 / 12;
    static const double ways[][2] = {{0, 0}, {5, 3}, {24, -18}, {100, 40}};
    int near = 0, flagged = 0;
    for (int k = 0; k < 4; k++) {
        s.history->written = 0;
        push(s.history, 0, turned(s.target, -0.5 * ways[k][0], -0.5 * ways[k][1], 0));
        push(s.history, 3000, turned(s.target, 0.5 * ways[k][0], 0.5 * ways[k][1], 0));
        query(&s, 0.0);
        const double length = hypot(ways[k][0], ways[k][1]), r = sqrt(8 * sigma2);
        const double peak = length > 0 ? erf(length / r) / (length * sqrt(2 * BST_PI * sigma2))
                                       : 1 / (2 * BST_PI * sigma2);
        for (int i = 0; i < s.count; i++) {
            bst_truth_item item;
            bst_field_truth_item(s.field, &s.track, &s.sources[i], full, 1, &s.truth, &item);
            const double ratio = (item.electrons * peak + s.truth.background_e) / 100;
            if (fabs(log(ratio)) > 0.15) {
                assert_int_equal((item.flags & BST_TRUTH_SATURATED) != 0, ratio > 1);
                flagged += ratio > 1;
                near += fabs(log(ratio)) < 1;
            }
        }
    }
    assert_true(flagged > 10 && near > 10);
    free_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sigma_points_have_the_moments_of_the_track),
        cmocka_unit_test(streaks_of_wide_wings_are_as_long_as_they_are),
        cmocka_unit_test(ghosts_are_as_wide_along_both_axes),
        cmocka_unit_test(backgrounds_are_those_of_the_middle),
        cmocka_unit_test(oblong_windows_have_their_stars),
        cmocka_unit_test(streaks_saturate_by_their_peaks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
