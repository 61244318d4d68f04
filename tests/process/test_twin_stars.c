/* Stars of a twin: which of the catalogue are on the frame, those that the residual shows, and the
 * catalogue that is written. Linked with wraps of catalogue and finder. */
#include "sim/catalogue/star_import.h"
#include "sim/process/twin/twin_internal.h"
#include "tests/process/frame_by_sums.h"
#include "tests/test_support.h"

static struct {
    bst_star stars[8];
    int count;
    bst_vec3 centre;
    double radius;
    bst_detection detections[4];
    int found;
    bst_star_path path;
    bst_star_values written[16];
    size_t written_count;
    bst_star_patch patch;
} script;

#define WRAP(type, name, arguments) \
    type __wrap_##name arguments;   \
    type __wrap_##name arguments

WRAP(bst_status, bst_stars_open, (bst_ctx * ctx, const char *name, bst_stars **out)) {
    (void)ctx;
    (void)name;
    *out = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_stars_query_seen,
     (bst_ctx * ctx, const bst_stars *stars, const bst_star_query *query, bst_star *out,
      int capacity, int *count)) {
    (void)ctx;
    (void)stars;
    bst_assert_close(query->v_limit, 30.0, 0.0);
    bst_assert_close(query->epoch.julian_year, 2024.5, 0.0);
    script.centre = query->centre;
    script.radius = query->radius_rad;
    *count = script.count;
    for (int i = 0; i < script.count && i < capacity; i++) {
        out[i] = script.stars[i];
    }
    return BST_OK;
}

WRAP(double, bst_stars_complete_to, (const bst_stars *stars, bst_vec3 centre, double radius_rad)) {
    (void)stars;
    (void)centre;
    (void)radius_rad;
    return 11.0;
}

WRAP(bst_status, bst_streak_finder_create,
     (bst_ctx * ctx, const float *pixels, int width, int height,
      const bst_common_streak_options *options, bst_streak_finder **out)) {
    (void)ctx;
    (void)pixels;
    assert_int_equal(width, BST_TEST_NX);
    assert_int_equal(height, BST_TEST_NY);
    bst_assert_close(options->least_snr, 6.0, 0.0);
    bst_assert_close(options->psf_sigma_px, 1.1, 0.0);
    assert_true(options->known_path);
    *out = NULL;
    return BST_OK;
}

WRAP(bst_status, bst_streak_finder_follow,
     (bst_ctx * ctx, bst_streak_finder *finder, const bst_star_path *path, double least_snr,
      double least_inside, bst_common_streak *out)) {
    (void)ctx;
    (void)finder;
    bst_assert_close(least_snr, 6.0, 0.0);
    bst_assert_close(least_inside, 0.05, 0.0);
    script.path = *path;
    *out = (bst_common_streak){.items = script.detections, .count = script.found};
    return BST_OK;
}

WRAP(bst_status, bst_star_write,
     (bst_ctx * ctx, bst_star_values *stars, size_t count, const bst_star_patch *patch,
      const char *path)) {
    (void)ctx;
    (void)path;
    memcpy(script.written, stars, count * sizeof *stars);
    script.written_count = count;
    script.patch = *patch;
    return BST_OK;
}

static bst_twin_star model_stars[BST_TWIN_STARS];
static bst_process_frame frame;

/* A twin of a frame with a path of some 8 px; light without aberration. */
static bst_twin make(int count) {
    memset(model_stars, 0, sizeof model_stars);
    memset(&script, 0, sizeof script);
    bst_twin t = {.frame = &frame,
                  .model = bst_test_twin_model(model_stars, count),
                  .julian_year = 2024.5,
                  .light = {.sun_m = {1.5e11, 0.0, 0.0}}};
    frame = (bst_process_frame){.values = {.exposure_s = 4.0},
                                .q_middle = bst_twin_path_attitude(&t.model.path, 0.5)};
    t.length_px = bst_twin_path_length_px(&t.model);
    t.process.zero_point_mag = 18.0;
    return t;
}

/* Direction of a pixel at half the exposure, and of the light before it is bent by the Sun. */
static bst_vec3 direction_of(const bst_twin *t, double x, double y) {
    bst_vec3 v = bst_quat_rotate(bst_quat_conj(bst_twin_path_attitude(&t->model.path, 0.5)),
                                 bst_camera_unproject(&t->model.camera, x, y));
    return bst_light_catalogue_star(&t->light, v);
}

/* Mean place of a star's image, and share of the time on the frame, by steps. */
static double mean_of(const bst_twin *t, bst_vec3 apparent, double *x_mean, double *y_mean) {
    enum { STEPS = 2000 };
    double inside = 0.0;
    *x_mean = *y_mean = 0.0;
    for (int i = 0; i < STEPS; i++) {
        double x, y;
        bst_quat q = bst_twin_path_attitude(&t->model.path, (i + 0.5) / STEPS);
        assert_true(bst_camera_project(&t->model.camera, bst_quat_rotate(q, apparent), &x, &y));
        *x_mean += x / STEPS;
        *y_mean += y / STEPS;
        inside += x > -0.5 && x < BST_TEST_NX - 0.5 && y > -0.5 && y < BST_TEST_NY - 0.5;
    }
    return inside / STEPS;
}

static void stars_of_the_catalogue(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin t = make(0);
    /* noise of a streak: of the pixels under a Gaussian along the path */
    double area = 4.0 * BST_PI * 1.1 * 1.1 + 2.0 * sqrt(BST_PI) * 1.1 * t.length_px;
    double least = 2.0 * 5.0 * sqrt(area), faint = 18.0 - 2.5 * log10(least / 4.0);
    const struct {
        double x, y, v;
    } given[] = {{20.0, 15.0, 9.0},          {43.0, 20.0, 8.0},          {30.0, -9.0, 7.0},
                 {10.0, 36.5, faint - 0.02}, {25.0, 25.0, faint + 0.02}, {22.0, -6.5, 6.9}};
    script.count = 6;
    for (int i = 0; i < 6; i++) {
        script.stars[i] = (bst_star){.icrs = direction_of(&t, given[i].x, given[i].y),
                                     .v_mag = (float)given[i].v,
                                     .b_minus_v = 0.4F,
                                     .id = (uint32_t)i + 10};
    }
    bst_assert_ok(&ctx, bst_twin_add_catalogue(&ctx, &t));
    /* about the boresight, with the path and 20 px more than the frame */
    double scale = bst_camera_scale_rad(&t.model.camera);
    bst_assert_close(
        script.radius,
        bst_camera_half_diagonal_rad(&t.model.camera) + 1e-3 + (t.length_px + 20.0) * scale, 1e-9);
    bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(frame.q_middle), (bst_vec3){0, 0, 1});
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(script.centre, ahead)), 0.0, 1e-12);
    /* the brighter first, of which the first ends beside the frame; one is outside, one too faint
     */
    assert_int_equal(t.model.count, 4);
    assert_int_equal(t.catalogue_stars, 4);
    static const int order[] = {5, 1, 0, 3};
    for (int i = 0; i < 4; i++) {
        const bst_twin_star *s = &t.model.stars[i];
        double x, y, e = 4.0 * pow(10.0, 0.4 * (18.0 - (double)(float)given[order[i]].v));
        assert_int_equal(s->id, order[i] + 10);
        bst_assert_close(s->flux_e, e, 1e-9 * e);
        bst_assert_close(s->expected_e, e, 1e-9 * e);
        bst_assert_close(s->b_minus_v, 0.4, 1e-7);
        bst_assert_close(s->inside, mean_of(&t, s->apparent, &x, &y), 6e-3);
        assert_false(s->found);
    }
    assert_true(t.model.stars[0].inside == 0.0);
    assert_true(t.model.stars[1].inside < 0.9); /* at the edge */
}

static void stars_of_the_residual(void **state) {
    (void)state;
    static float data[BST_TEST_PIXELS];
    bst_ctx ctx = {0};
    bst_twin t = make(2);
    int added;
    t.model.data_e = data;
    double x, y;
    mean_of(&t, t.model.stars[1].apparent, &x, &y);
    script.detections[0] = (bst_detection){.x_px = 20.0, .y_px = 30.0, .flux_e = 900.0};
    /* beside a star of 3500: what its fit left, and another that is as bright as an eighth */
    script.detections[1] = (bst_detection){.x_px = x + 1.8, .y_px = y - 2.2, .flux_e = 340.0};
    script.detections[2] = (bst_detection){.x_px = x - 1.8, .y_px = y + 2.2, .flux_e = 440.0};
    script.detections[3] = (bst_detection){.x_px = 20.0, .y_px = 60.0, .flux_e = 900.0};
    script.found = 4;
    bst_assert_ok(&ctx, bst_twin_add_found(&ctx, &t, 6.0, &added));
    assert_int_equal(added, 2);
    assert_int_equal(t.model.count, 4);
    for (int i = 0; i < 2; i++) {
        const bst_twin_star *s = &t.model.stars[2 + i];
        const bst_detection *d = &script.detections[2 * i];
        double inside = mean_of(&t, s->apparent, &x, &y);
        bst_assert_close(x, d->x_px, 1e-3); /* the mean of its image is where it was found */
        bst_assert_close(y, d->y_px, 1e-3);
        bst_assert_close(s->inside, inside, 6e-3);
        bst_assert_close(s->flux_e, d->flux_e, 0.0);
        assert_true(s->found && isnan(s->v_mag) && isnan(s->expected_e));
    }
    /* the filter has the path of a star at the frame's middle */
    bst_vec3 v = bst_quat_rotate(bst_quat_conj(bst_twin_path_attitude(&t.model.path, 0.5)),
                                 bst_camera_unproject(&t.model.camera, 22.0, 18.5));
    double ends[2][2];
    mean_of(&t, v, &x, &y);
    for (int k = 0; k < 2; k++) {
        assert_true(bst_camera_project(&t.model.camera,
                                       bst_quat_rotate(bst_twin_path_attitude(&t.model.path, k), v),
                                       &ends[k][0], &ends[k][1]));
    }
    for (int k = 0; k < 2; k++) { /* in the order of time */
        const double *e = ends[k];
        bst_assert_close(script.path.ends[k][0], e[0] - x, 0.05);
        bst_assert_close(script.path.ends[k][1], e[1] - y, 0.05);
    }
}

static const bst_star_values *written(uint32_t id) {
    for (size_t i = 0; i < script.written_count; i++) {
        if (script.written[i].id == id) {
            return &script.written[i];
        }
    }
    return NULL;
}

static void catalogue_of_the_twin(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_twin t = make(3);
    const bst_twin_camera c = {.rate_v0 = 2e7};
    for (int i = 0; i < 3; i++) {
        t.model.stars[i].icrs = direction_of(&t, 10.0 * i, 5.0);
        t.model.stars[i].id = (uint32_t)i + 50;
        t.model.stars[i].b_minus_v = i == 0 ? 0.85 : NAN;
        t.model.stars[i].flux_e = i == 1 ? 0.0 : 8e5;
    }
    t.model.stars[2].found = true;
    script.count = 3;
    for (int i = 0; i < 3; i++) { /* the second is fitted, though it has no light: it stays out */
        script.stars[i] = (bst_star){.icrs = direction_of(&t, 3.0, 4.0 + i),
                                     .v_mag = 7.25F,
                                     .b_minus_v = -0.17F,
                                     .id = i == 1 ? 51 : (uint32_t)i + 70};
    }
    /* beside the found star of 5 mag: one that is as bright is that star, a fainter one is not */
    double x, y;
    bst_quat q = bst_twin_path_attitude(&t.model.path, 0.5);
    assert_true(
        bst_camera_project(&t.model.camera, bst_quat_rotate(q, t.model.stars[2].apparent), &x, &y));
    script.count = 6;
    for (int i = 3; i < 6; i++) {
        script.stars[i] = (bst_star){.icrs = direction_of(&t, x + (i == 5 ? 3.0 : 1.2), y - 1.0),
                                     .v_mag = i == 4 ? 6.0F : 5.4F,
                                     .b_minus_v = NAN,
                                     .id = (uint32_t)i + 70};
    }
    bst_assert_ok(&ctx, bst_twin_write_stars(&ctx, &t, &c, "out"));
    assert_null(written(73));
    assert_non_null(written(74));
    assert_non_null(written(75));
    assert_int_equal(script.written_count, 6);
    /* 2e5 e- a second: 5 mag; BT-VT = 1, V = VT - 0.09 */
    const bst_star_values *s = written(50);
    assert_non_null(s);
    double ra, dec;
    bst_vec3_to_radec(t.model.stars[0].icrs, &ra, &dec);
    bst_assert_close(s->ra_rad, ra, 1e-12);
    bst_assert_close(s->dec_rad, dec, 1e-12);
    assert_true(s->has_colour);
    assert_int_equal(s->colour_mmag, 1000);
    assert_int_equal(s->vt_mmag, 5090);
    s = written(bst_star_id_make(1, 0x3FFF - 2, 3)); /* the found one */
    assert_non_null(s);
    bst_vec3_to_radec(bst_light_catalogue_star(&t.light, t.model.stars[2].apparent), &ra, &dec);
    bst_assert_close(s->ra_rad, ra, 1e-12);
    bst_assert_close(s->dec_rad, dec, 1e-12);
    assert_false(s->has_colour);
    assert_int_equal(s->vt_mmag, 5063); /* 0.7 of the usual colour */
    assert_null(written(51));
    s = written(72);
    assert_non_null(s);
    assert_int_equal(s->colour_mmag, -200);
    assert_int_equal(s->vt_mmag, 7232);
    /* 3 degrees, which is more than three fields of half a degree */
    bst_assert_close(script.patch.radius_deg, 3.0, 1e-9);
    bst_vec3 ahead = bst_quat_rotate(bst_quat_conj(frame.q_middle), (bst_vec3){0, 0, 1});
    bst_vec3_to_radec(ahead, &ra, &dec);
    bst_assert_close(fmod(script.patch.ra_deg - ra * 180.0 / BST_PI, 360.0), 0.0, 1e-9);
    bst_assert_close(script.patch.dec_deg, dec * 180.0 / BST_PI, 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_of_the_catalogue),
        cmocka_unit_test(stars_of_the_residual),
        cmocka_unit_test(catalogue_of_the_twin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
