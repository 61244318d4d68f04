/* What the onboard side knows otherwise than it is, against its effect by theory. */
#include "sim/onboard/knowledge.h"

#include "sim/onboard/knowledge_internal.h"
#include "sim/optics/psf.h"
#include "tests/archive_support.h"
#include "tests/world/world_support.h"

#define GX5 "{\"name\": \"GX5\", " TEST_GX5 "}"
#define CUE ", \"cue\": {\"object\": \"GX5\"}"

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_knowledge *knowledge;
    bst_knowledge_view *kview;
    bst_world_view *view;
} scene;

/* knowledge: what stands in the block. */
static scene make(const char *knowledge) {
    char sensor[1000];
    snprintf(sensor, sizeof sensor, CUE ", \"knowledge\": {%s}", knowledge);
    scene s = {.world = test_world_with(GX5, sensor)};
    bst_assert_ok(&s.ctx, bst_knowledge_create(&s.ctx, s.world, 0, 0, &s.knowledge));
    bst_assert_ok(&s.ctx, bst_knowledge_view_create(&s.ctx, s.knowledge, &s.kview));
    bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &s.view));
    return s;
}

static void drop(scene *s) {
    bst_world_view_free(s->view);
    bst_knowledge_view_free(s->kview);
    bst_knowledge_free(s->knowledge);
    bst_world_free(s->world);
}

static bst_onboard_cue cue_at(scene *s, double seconds) {
    bst_onboard_cue cue;
    bst_assert_ok(&s->ctx, bst_knowledge_cue_at(&s->ctx, s->kview, seconds, &cue));
    return cue;
}

static bst_world_state believed(scene *s, double seconds) {
    bst_world_state state;
    bst_bodies bodies;
    bst_assert_ok(&s->ctx, bst_world_view_nav(&s->ctx, s->view, 0, 0, seconds, &state, &bodies));
    return state;
}

static bst_world_state truth(scene *s, double seconds) {
    bst_world_state state;
    bst_assert_ok(&s->ctx, bst_world_view_observer_state(&s->ctx, s->view, 0, seconds, &state));
    return state;
}

static void the_truth_by_default(void **state) {
    (void)state;
    scene s = make("");
    assert_ptr_equal(bst_knowledge_stars(s.knowledge), bst_world_stars(s.world));
    assert_memory_equal(bst_knowledge_camera(s.knowledge), bst_world_camera(s.world, 0, 0),
                        sizeof(bst_camera));
    bst_world_state a = believed(&s, 77), b = truth(&s, 77);
    assert_memory_equal(&a, &b, sizeof a);
    /* between whole seconds the velocity is interpolated: differences of places 0.1 s apart, 1e-3
     * m of rounding; a tenth of a second is 0.8 m/s */
    for (double t = 59.37; t < 64.0; t += 1.37) {
        bst_vec3 way = bst_vec3_sub(truth(&s, t + 0.05).position_m, truth(&s, t - 0.05).position_m);
        a = believed(&s, t);
        bst_vec3 off = bst_vec3_sub(a.velocity_mps, bst_vec3_scale(way, 10.0));
        bst_assert_close(bst_vec3_norm(off), 0.0, 0.05);
    }
    double oversampling;
    assert_string_equal(bst_knowledge_psf_file(s.knowledge, &oversampling), "");
    drop(&s);
}

/* 10 km of position move the cue by the parallax: the part across the line of sight over the
 * range. */
static void an_orbit_error_moves_the_cue_by_the_parallax(void **state) {
    (void)state;
    scene right = make("");
    static const char *const blocks[3] = {"\"orbit\": {\"position_rtn_m\": [10000, 0, 0]}",
                                          "\"orbit\": {\"position_rtn_m\": [0, 10000, 0]}",
                                          "\"orbit\": {\"position_rtn_m\": [0, 0, 10000]}"};
    for (int i = 0; i < 3; i++) {
        scene s = make(blocks[i]);
        bst_world_state eye = truth(&s, 60), own = believed(&s, 60);
        bst_vec3 off = bst_vec3_sub(own.position_m, eye.position_m);
        bst_assert_close(bst_vec3_norm(off), 10000, 1e-6); /* rounding of 7e6 m */
        bst_vec3 r = bst_vec3_unit(eye.position_m);
        bst_vec3 n = bst_vec3_unit(bst_vec3_cross(eye.position_m, eye.velocity_mps));
        const bst_vec3 axis[3] = {r, bst_vec3_cross(n, r), n};
        bst_assert_close(bst_vec3_dot(off, axis[i]), 10000, 1e-6);
        bst_assert_close(test_distance(own.velocity_mps, eye.velocity_mps), 0, 1e-9);
        bst_world_sight sight;
        bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, s.view, 0, 0, 60, &sight));
        bst_vec3 d = sight.geometric;
        double across = bst_vec3_norm(bst_vec3_axpy(off, -bst_vec3_dot(off, d), d));
        double angle =
            bst_vec3_angle(cue_at(&s, 60).direction_gcrf, cue_at(&right, 60).direction_gcrf);
        /* first order: (10 km / 4e7 m)^2 = 6e-8 rad of 2.5e-4 */
        bst_assert_close(angle, across / sight.range_m, 1e-7);
        assert_true(angle > 5e-6);
        drop(&s);
    }
    /* growing along the track: 2 m/s for 100 s */
    scene s = make("\"orbit\": {\"along_track_drift_mps\": 2}");
    bst_assert_close(test_distance(believed(&s, 100).position_m, truth(&s, 100).position_m), 200,
                     1e-6);
    bst_assert_close(test_distance(believed(&s, 0).position_m, truth(&s, 0).position_m), 0, 1e-6);
    drop(&s);
    drop(&right);
}

/* A clock that is 1 s ahead gives the cue of 1 s later: shifted by the rate times 1 s. */
static void a_clock_offset_shifts_the_cue_by_its_rate(void **state) {
    (void)state;
    scene right = make(""), s = make("\"clock_offset_s\": 1");
    bst_onboard_cue now = cue_at(&right, 60), later = cue_at(&right, 61), wrong = cue_at(&s, 60);
    bst_assert_close(test_distance(wrong.direction_gcrf, later.direction_gcrf), 0, 1e-15);
    double angle = bst_vec3_angle(wrong.direction_gcrf, now.direction_gcrf);
    /* the rate changes by 1e-7 rad/s^2: half of it in a second */
    bst_assert_close(angle, bst_vec3_norm(now.rate_gcrf_radps), 2e-7);
    assert_true(angle > 1e-5);
    bst_world_state a = believed(&s, 60), b = truth(&s, 61);
    assert_memory_equal(&a, &b, sizeof a);
    drop(&s);
    drop(&right);
}

/* The offset that is set is taken from the clock: an estimate that is right gives the cue of a
 * right clock, and one within a third of its sigma of that in use changes nothing. */
static void an_estimated_clock_offset_corrects_the_cue(void **state) {
    (void)state;
    scene right = make(""), s = make("\"clock_offset_s\": 1");
    bst_onboard_cue wrong = cue_at(&s, 60);
    assert_true(bst_knowledge_view_set_clock(s.kview, 1.0, 0.1));
    bst_onboard_cue now = cue_at(&s, 60), expected = cue_at(&right, 60);
    assert_true(test_distance(wrong.direction_gcrf, expected.direction_gcrf) > 1e-5);
    bst_assert_close(test_distance(now.direction_gcrf, expected.direction_gcrf), 0, 1e-15);
    bst_assert_close(test_distance(now.rate_gcrf_radps, expected.rate_gcrf_radps), 0, 1e-15);
    assert_false(bst_knowledge_view_set_clock(s.kview, 1.03, 0.1));
    bst_assert_close(bst_knowledge_view_clock_s(s.kview), 1.0, 0.0);
    assert_true(bst_knowledge_view_set_clock(s.kview, 1.04, 0.1));
    bst_onboard_line line;
    bst_world_sight sight;
    bst_assert_ok(&s.ctx, bst_knowledge_line_at(&s.ctx, s.kview, 0, 60, &line));
    bst_assert_ok(&s.ctx, bst_knowledge_sight_at(&s.ctx, s.kview, 0, 60, &sight));
    bst_assert_close(test_distance(line.direction, sight.geometric), 0, 1e-15);
    bst_vec3 between = bst_vec3_sub(line.object.position_m, line.eye.position_m);
    bst_assert_close(bst_vec3_norm(between), sight.range_m, 1e-6);
    /* without an estimate nothing is corrected */
    assert_true(bst_knowledge_view_set_clock(s.kview, 1.04, 0.0));
    assert_false(bst_knowledge_view_set_clock(s.kview, 1.04, 0.0));
    assert_true(bst_knowledge_view_clock_s(s.kview) == 0.0);
    now = cue_at(&s, 60);
    bst_assert_close(test_distance(now.direction_gcrf, wrong.direction_gcrf), 0, 1e-15);
    drop(&s);
    drop(&right);
}

/* The spacecraft starts with +z where the onboard side reckons the cue, its errors in it. */
static void the_start_follows_what_is_believed(void **state) {
    (void)state;
    static const char *const blocks[] = {
        "", "\"clock_offset_s\": 2", "\"orbit\": {\"position_rtn_m\": [0, 10000, 300]}",
        "\"clock_offset_s\": -1, \"orbit\": {\"along_track_drift_mps\": 5000}",
        "\"orbit\": {\"velocity_rtn_mps\": [0, 1000, 0]}"};
    const bool moves[] = {false, true, true, true, false};
    bst_vec3 right = {0};
    for (int i = 0; i < 5; i++) {
        scene s = make(blocks[i]);
        bst_quat q = bst_world_body_attitude(s.world, 0, 0);
        bst_vec3 z = bst_quat_rotate(bst_quat_conj(q), (bst_vec3){0, 0, 1});
        bst_assert_close(test_distance(z, cue_at(&s, 0).direction_gcrf), 0, 1e-14); /* rounding */
        right = i == 0 ? z : right;
        assert_true(moves[i] == (test_distance(z, right) > 1e-5));
        drop(&s);
    }
}

/* 1 km/s across the line of sight is 1000 / 299792458 rad = 0.688 arcsec of aberration. */
static void a_velocity_error_is_aberration(void **state) {
    (void)state;
    scene s = make("\"orbit\": {\"velocity_rtn_mps\": [0, 0, 1000]}");
    bst_world_state own, eye = truth(&s, 60);
    bst_bodies bodies;
    bst_assert_ok(&s.ctx, bst_world_view_nav(&s.ctx, s.view, 0, 0, 60, &own, &bodies));
    bst_assert_close(test_distance(own.velocity_mps, eye.velocity_mps), 1000, 1e-9);
    bst_assert_close(test_distance(own.position_m, eye.position_m), 0, 1e-9);
    bst_light wrong = bst_light_at(&bodies, own.position_m, own.velocity_mps);
    bst_light right = bst_light_at(&bodies, eye.position_m, eye.velocity_mps);
    bst_vec3 across = bst_vec3_unit(eye.position_m); /* at right angles to N */
    double angle =
        bst_vec3_angle(bst_light_aberrate(&wrong, across), bst_light_aberrate(&right, across));
    /* v/c of 1e-4 of it, from the velocity that both have */
    bst_assert_close(angle / BST_ARCSEC_RAD, 0.688, 1e-3);
    drop(&s);
}

/* A PSF that is no Gaussian is known as the Gaussian of its noise-equivalent area. */
static void the_onboard_psf_is_a_gaussian(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = test_world(
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
        "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"optics\": {\"psf\": \"diffraction\", \"q\": 2}}}, "
        "{\"name\": \"b\", \"cue\": {\"object\": \"GX5\"}, \"camera\": {\"pixel_scale_arcsec\": 3, "
        "\"aperture_m\": 0.15, \"optics\": {\"diffusion_px\": 0.5}}, "
        "\"knowledge\": {\"camera\": {\"psf_fwhm_px\": 3}}}]}]}");
    for (int sensor = 0; sensor < 2; sensor++) {
        bst_knowledge *knowledge;
        bst_assert_ok(&ctx, bst_knowledge_create(&ctx, world, 0, sensor, &knowledge));
        const bst_camera *known = bst_knowledge_camera(knowledge);
        assert_int_equal(known->optics.psf, BST_PSF_GAUSSIAN);
        assert_true(known->optics.diffusion_px == 0.0 && !known->psf);
        double want =
            sensor ? 3.0
                   : bst_psf_equivalent_fwhm_px(bst_world_camera(world, 0, 0)->psf, 511.5, 511.5);
        bst_assert_close(known->psf_fwhm_px, want, 1e-12);
        assert_true(sensor || (want > 2.0 && want < 2.6)); /* 1.03 Q at half maximum, and wings */
        bst_knowledge_free(knowledge);
    }
    bst_world_free(world);
}

static void the_camera_may_be_known_wrongly(void **state) {
    (void)state;
    scene s = make(
        "\"camera\": {\"scale_error_ppm\": 100, \"rotation_error_deg\": 0.5, "
        "\"override_distortion\": true, \"distortion\": {\"k1\": 50}, \"psf_fwhm_px\": 2.4}");
    const bst_camera *known = bst_knowledge_camera(s.knowledge);
    const bst_camera *real = bst_world_camera(s.world, 0, 0);
    bst_assert_close(known->pixel_scale_arcsec, 3.0003, 1e-12);
    bst_assert_close(known->rotation_deg, 0.5, 0);
    bst_assert_close(known->distortion.k1, 50, 0);
    bst_assert_close(known->psf_fwhm_px, 2.4, 0);
    assert_true(known->geometry.general && !real->geometry.general);
    /* a star at the edge is expected 512 px * 100 ppm nearer, less the rotation's and k1's part */
    bst_camera scale_only = *real;
    scale_only.pixel_scale_arcsec = known->pixel_scale_arcsec;
    double x = 0, y = 0;
    assert_true(bst_camera_project(&scale_only, bst_camera_unproject(real, 1023.5, 511.5), &x, &y));
    bst_assert_close(1023.5 - x, 512 * 100e-6, 1e-5); /* second order in 1e-4 */
    drop(&s);
    /* a fold is refused on board too */
    bst_ctx ctx = {0};
    bst_world *world =
        test_world_with(GX5, CUE
                        ", \"knowledge\": {\"camera\": {\"override_distortion\": true, "
                        "\"distortion\": {\"k1\": -5000}}}");
    bst_knowledge *knowledge;
    assert_int_equal(bst_knowledge_create(&ctx, world, 0, 0, &knowledge), BST_ERR_CONFIG);
    assert_non_null(
        strstr(ctx.message, "/observers/0/sensors/0/knowledge/camera: the image folds "));
    bst_world_free(world);
}

enum { ROOM = 60000 };
static bst_star all[ROOM], known[ROOM];

static int query(scene *s, const bst_stars *stars, bst_vec3 centre, double radius, bst_star *out) {
    int n = 0;
    bst_assert_ok(&s->ctx,
                  bst_stars_query(&s->ctx, stars, centre, radius, 7.0, 2022.46, out, ROOM, &n));
    assert_true(n < ROOM);
    return n;
}

static void stars_are_dropped_and_displaced(void **state) {
    (void)state;
    scene s = make(
        "\"stars\": {\"missing_fraction\": 0.3, \"position_error_fraction\": 0.2, "
        "\"position_error_sigma_arcsec\": 20, \"seed\": \"0x7\"}");
    const bst_stars *own = bst_knowledge_stars(s.knowledge), *real = bst_world_stars(s.world);
    assert_ptr_not_equal(own, real);
    bst_vec3 pole = {0, 0, 1};
    int n = query(&s, real, pole, BST_PI, all), m = query(&s, own, pole, BST_PI, known);
    /* binomial: 4 sigma */
    bst_assert_close(m, 0.7 * n, 4 * sqrt(n * 0.3 * 0.7));
    int moved = 0, at = 0;
    double sum2 = 0;
    for (int i = 0; i < m; i++) {
        while (all[at].id != known[i].id) {
            at++; /* the same order */
            assert_true(at < n);
        }
        double off = bst_vec3_angle(all[at].icrs, known[i].icrs) / BST_ARCSEC_RAD;
        if (off > 1e-6) {
            moved++;
            sum2 += off * off;
        }
        bst_star one;
        bst_assert_ok(&s.ctx, bst_stars_find(&s.ctx, own, known[i].id, 2022.46, &one));
        bst_assert_close(test_distance(one.icrs, known[i].icrs), 0, 1e-15);
    }
    bst_assert_close(moved, 0.2 * m, 4 * sqrt(m * 0.2 * 0.8));
    /* RMS of two axes; the mean of that many squares of 2 degrees of freedom, 4 sigma */
    bst_assert_close(sum2 / moved, 2 * 20 * 20, 4 * 800 / sqrt(moved));
    /* a small cone finds what a large one does, displaced stars at its rim included */
    bst_vec3 centre = bst_vec3_from_radec(1.4, -0.1);
    int small = query(&s, own, centre, 0.1, all), inside = 0;
    m = query(&s, own, pole, BST_PI, known);
    for (int i = 0; i < m; i++) {
        inside += bst_vec3_norm(bst_vec3_sub(known[i].icrs, centre)) <= 2 * sin(0.05);
    }
    assert_int_equal(small, inside);
    /* dropped stars are not found either */
    n = query(&s, real, centre, 0.3, all);
    m = query(&s, own, centre, 0.3, known);
    int missing = 0;
    for (int i = 0; i < n; i++) {
        bst_star one;
        missing += bst_stars_find(&s.ctx, own, all[i].id, 2022.46, &one) != BST_OK;
    }
    assert_true(missing > 0.15 * n && missing < 0.45 * n);
    scene again = make("\"stars\": {\"missing_fraction\": 0.3, \"seed\": \"0x8\"}");
    assert_true(query(&again, bst_knowledge_stars(again.knowledge), pole, BST_PI, all) > 0);
    assert_true(all[0].id != known[0].id || all[1].id != known[1].id || all[2].id != known[2].id);
    drop(&again);
    drop(&s);
}

static bst_status archive_view(void *view, bst_archive *archive) {
    bst_knowledge_view_archive(view, archive);
    return BST_OK;
}

/* That the scenario's cue has changed is known until the view is asked, also if the state is saved
 * before that. */
static void a_changed_cue_is_saved(void **state) {
    (void)state;
    scene s = make("");
    s.kview->cue_changed = true;
    bst_knowledge_view *other;
    bst_assert_ok(&s.ctx, bst_knowledge_view_create(&s.ctx, s.knowledge, &other));
    test_saved saved = test_save(archive_view, s.kview);
    bst_assert_ok(&s.ctx, test_restore(&s.ctx, archive_view, other, saved));
    free(saved.bytes);
    assert_true(bst_knowledge_view_task(s.kview, NULL));
    assert_true(bst_knowledge_view_task(other, NULL));
    assert_false(bst_knowledge_view_task(other, NULL));
    bst_knowledge_view_free(other);
    drop(&s);
}

/* A view that has a task, restored into a new one: the same cue to the bit. */
static void a_view_is_saved_and_restored(void **state) {
    (void)state;
    for (int tasked = 0; tasked < 3; tasked++) { /* no task, an object's, that of the own cue */
        scene s = make("");
        bst_knowledge_view *other;
        bst_assert_ok(&s.ctx, bst_knowledge_view_create(&s.ctx, s.knowledge, &other));
        /* of the restored view before: nothing must be left of it */
        const bst_task old = {.id = 9, .object = 0, .sigma_rad = 0.5};
        assert_true(bst_knowledge_view_task(other, &old));
        const bst_task task = {.id = 3,
                               .object = tasked == 1 ? 0 : -1,
                               .sigma_rad = 1e-3,
                               .rate_sigma_radps = 1e-6,
                               .v_mag = 12.5,
                               .v_mag_sigma = 0.3};
        if (tasked > 0) {
            assert_true(bst_knowledge_view_task(s.kview, &task));
        }
        (void)cue_at(&s, 3.3);
        test_saved saved = test_save(archive_view, s.kview);
        bst_assert_ok(&s.ctx, test_restore(&s.ctx, archive_view, other, saved));
        bst_vec3 seen[2]; /* of the second that was asked for last */
        for (int i = 0; i < 2; i++) {
            bool valid;
            bst_assert_ok(&s.ctx, bst_knowledge_cue_direction_at(&s.ctx, i ? other : s.kview, 3.9,
                                                                 &valid, &seen[i]));
        }
        assert_memory_equal(&seen[0], &seen[1], sizeof *seen);
        for (int k = 0; k < 40; k++) {
            bst_onboard_cue was = cue_at(&s, 3.3 + 0.4 * k), is;
            bst_assert_ok(&s.ctx, bst_knowledge_cue_at(&s.ctx, other, 3.3 + 0.4 * k, &is));
            assert_memory_equal(&was.direction_gcrf, &is.direction_gcrf, sizeof(bst_vec3));
            assert_memory_equal(&was.rate_gcrf_radps, &is.rate_gcrf_radps, sizeof(bst_vec3));
            assert_true(was.sigma_rad == is.sigma_rad && was.v_mag == is.v_mag);
            assert_true(was.rate_sigma_radps == is.rate_sigma_radps);
        }
        /* the same task is no new one */
        assert_int_equal(bst_knowledge_view_task(other, &task), tasked == 0);
        test_restore_damaged(archive_view, other, saved, 1);
        /* an object that the catalogue lacks */
        const int64_t beyond = bst_knowledge_object_count(s.knowledge);
        memcpy(saved.bytes + 16 + 2, &beyond, sizeof beyond); /* after the head and its name */
        assert_int_equal(test_restore(&s.ctx, archive_view, other, saved), BST_ERR_FORMAT);
        free(saved.bytes);
        bst_knowledge_view_free(other);
        drop(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_truth_by_default),
        cmocka_unit_test(an_orbit_error_moves_the_cue_by_the_parallax),
        cmocka_unit_test(a_clock_offset_shifts_the_cue_by_its_rate),
        cmocka_unit_test(an_estimated_clock_offset_corrects_the_cue),
        cmocka_unit_test(the_start_follows_what_is_believed),
        cmocka_unit_test(a_velocity_error_is_aberration),
        cmocka_unit_test(the_onboard_psf_is_a_gaussian),
        cmocka_unit_test(the_camera_may_be_known_wrongly),
        cmocka_unit_test(stars_are_dropped_and_displaced),
        cmocka_unit_test(a_changed_cue_is_saved),
        cmocka_unit_test(a_view_is_saved_and_restored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
