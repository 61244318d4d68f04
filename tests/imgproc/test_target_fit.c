/* Centre of mass by a model on board, against outlines of the model's corners that are projected
 * here, without image processing and renderer. */
#include <unistd.h>

#include "boresight/rng.h"
#include "imgproc/extended/target_fit.h"
#include "tests/archive_support.h"
#include "tests/test_support.h"

static const double SCALE = 5e-4; /* rad per px */

static bst_camera a_camera(void) {
    return (bst_camera){.width_px = 512,
                        .height_px = 512,
                        .pixel_scale_arcsec = SCALE * 648000.0 / BST_PI,
                        .aperture_m = 0.01,
                        .throughput = 0.7,
                        .quantum_efficiency = 0.7,
                        .photon_flux_v0_per_s_m2 = 3.6e10,
                        .psf_fwhm_px = 2.5};
}

/* Reads a model of the given joints and parts of white paint. */
static bst_status read_model(bst_ctx *ctx, const char *joints, const char *parts,
                             bst_target_model **out) {
    char path[BST_TEST_PATH], named[BST_TEST_PATH + 8];
    bst_test_template(path, "target_model");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    (void)close(fd);
    snprintf(named, sizeof named, "%s.json", path);
    FILE *f = fopen(named, "w");
    assert_non_null(f);
    fprintf(f,
            "{\"materials\": [{\"name\": \"m\", \"library\": \"white_paint\"}], "
            "\"joints\": [%s], \"parts\": [%s]}",
            joints, parts);
    assert_int_equal(fclose(f), 0);
    bst_status status = bst_target_model_load(ctx, named, out);
    (void)remove(named);
    (void)remove(path);
    return status;
}

/* A sight along +z with the Sun behind, or beside by an angle towards +x. */
static bst_target_sight a_sight(double sun_rad) {
    return (bst_target_sight){.q_local_from_gcrf = BST_QUAT_IDENTITY,
                              .sun_local = {sin(sun_rad), 0.0, -cos(sun_rad)},
                              .scale_rad = SCALE,
                              .full_e = 1e5,
                              .least_e = 10.0,
                              .size_px = 100.0,
                              .model_sigma = 0.002};
}

/* The nearer face of a box is its outline. */
static void outline_of_a_box(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model *model;
    bst_assert_ok(&ctx, read_model(&ctx, "",
                                   "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 1, 1], "
                                   "\"material\": \"m\"}",
                                   &model));
    bst_target_sight sight = a_sight(0.0);
    bst_target_pose pose = {
        .q_body_from_gcrf = BST_QUAT_IDENTITY, .x_px = 3.0, .y_px = -2.0, .depth_m = 80.0};
    bst_target_outline o;
    assert_true(bst_target_model_predict(model, &sight, &pose, &o));
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double a = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS, c = cos(a), s = sin(a);
        double x = 80.0 * 3.0 * SCALE, y = -80.0 * 2.0 * SCALE; /* of the centre, m */
        double h = (c * x + s * y + fabs(c) + 0.5 * fabs(s)) / (79.5 * SCALE);
        bst_assert_close(o.support_px[k], h, 1e-9);
    }
    /* too dim to be seen; behind the camera */
    sight.least_e = 1e6;
    assert_false(bst_target_model_predict(model, &sight, &pose, &o));
    sight.least_e = 10.0;
    pose.depth_m = 0.5;
    assert_false(bst_target_model_predict(model, &sight, &pose, &o));
    bst_target_model_free(model);
}

/* A plate that is half hidden and half in the shadow of another one is not seen. */
static void outline_with_a_shadow(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model *model;
    /* the second one is 1 m nearer, and the Sun 45 deg to the right: its shadow falls 1 m to the
     * left; both face -z, the observer */
    bst_assert_ok(&ctx,
                  read_model(&ctx, "",
                             "{\"name\": \"far\", \"kind\": \"plate\", \"size_m\": [2, 2, 1], "
                             "\"rotation_deg\": [180, 0, 0], \"material\": \"m\"}, "
                             "{\"name\": \"near\", \"kind\": \"plate\", \"size_m\": [1, 4, 1], "
                             "\"position_m\": [0.5, 0, -1], \"rotation_deg\": [180, 0, 0], "
                             "\"material\": \"m\"}",
                             &model));
    bst_target_sight sight = a_sight(0.25 * BST_PI);
    bst_target_pose pose = {.q_body_from_gcrf = BST_QUAT_IDENTITY, .depth_m = 1000.0};
    bst_target_outline o;
    assert_true(bst_target_model_predict(model, &sight, &pose, &o));
    /* rays are parallel: what they hide of the far plate is right to 1 m / 1000 */
    bst_assert_close(-o.support_px[BST_TARGET_DIRECTIONS / 2] * SCALE * 999.0, 0.0, 2e-3);
    bst_assert_close(o.support_px[0] * SCALE * 999.0, 1.0, 2e-3);
    bst_assert_close(o.support_px[BST_TARGET_DIRECTIONS / 4] * SCALE * 999.0, 2.0, 2e-3);
    /* with the Sun behind the observer the left half of the far plate is lit */
    sight = a_sight(0.0);
    assert_true(bst_target_model_predict(model, &sight, &pose, &o));
    bst_assert_close(o.support_px[BST_TARGET_DIRECTIONS / 2] * SCALE * 1000.0, 1.0, 2e-3);
    bst_target_model_free(model);
}

static void bad_models(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model *model;
    assert_int_not_equal(bst_target_model_load(&ctx, "no such file.json", &model), BST_OK);
    assert_null(model);
    const char *part =
        "{\"name\": \"b\", \"kind\": \"box\", \"joint\": \"j\", \"material\": \"m\"}";
    assert_int_equal(
        read_model(&ctx, "{\"name\": \"j\", \"follows\": \"spin\", \"axis\": [0, 1, 0]}", part,
                   &model),
        BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "joint \"j\""));
    assert_null(model);
    bst_assert_ok(&ctx, read_model(&ctx,
                                   "{\"name\": \"j\", \"follows\": \"sun\", \"axis\": [0, 1, 0], "
                                   "\"normal\": [0, 0, 1]}",
                                   part, &model));
    bst_target_model_free(model);
}

/* Corners of the parts of scenarios/satellites/inspection_client.json, by hand: half sizes and
 * places. The third one is an antenna on one side. */
static const double PARTS[5][6] = {{0.5, 0.5, 0.6, 0.0, 0.0, 0.0},
                                   {0.4, 0.4, 0.0, 0.0, 0.0, -0.601},
                                   {0.45, 0.25, 0.075, 0.0, 0.0, 0.7},
                                   {0.5, 0.8, 0.0, 0.0, -1.5, 0.0},
                                   {0.5, 0.8, 0.0, 0.0, 1.5, 0.0}};

/* Silhouette of the corners of all parts but `without`, with noise. The Sun is behind the camera:
 * what is visible is lit. Returns the largest extent of all parts, px. */
static double draw(bst_quat q_cam_from_body, bst_vec3 at_m, int without, double noise_px,
                   uint64_t seed, bst_silhouette *out) {
    bst_outline_point points[40], seen[40], hull[80];
    int count = 0, all = 0;
    for (int i = 0; i < 40; i++) {
        const double *p = PARTS[i / 8];
        bst_vec3 v = {p[3] + (i & 1 ? p[0] : -p[0]), p[4] + (i & 2 ? p[1] : -p[1]),
                      p[5] + (i & 4 ? p[2] : -p[2])};
        v = bst_vec3_add(bst_quat_rotate(q_cam_from_body, v), at_m);
        bst_outline_point px = {255.5 + v.x / (v.z * SCALE), 255.5 + v.y / (v.z * SCALE)};
        points[all++] = px;
        if (i / 8 != without) {
            double n[2];
            bst_rng_normal2((bst_rng_key){{1, 2}}, seed, (uint64_t)i, n);
            seen[count++] =
                (bst_outline_point){px.x_px + noise_px * n[0], px.y_px + noise_px * n[1]};
        }
    }
    double length, angle, width;
    bst_outline_make(points, all, hull, &out->outline);
    bst_outline_extent(&out->outline, &length, &angle, &width);
    *out = (bst_silhouette){.least_e = 10.0};
    bst_outline_make(seen, count, hull, &out->outline);
    (void)bst_outline_centroid(&out->outline, &out->centre_x_px, &out->centre_y_px);
    bst_outline_extent(&out->outline, &out->length_px, &out->angle_rad, &out->width_px);
    return length;
}

/* A frame of the tumbling target: its silhouette, a detection at the outline's centroid, and the
 * true place. */
typedef struct tumbling_frame {
    bst_silhouette silhouette;
    bst_detection detection;
    double x_px, y_px, size_px, range_m;
} tumbling_frame;

static void make_frame(int frame, int without, tumbling_frame *out) {
    /* about an axis that is none of the body's: 4.5 deg a frame */
    bst_vec3 turn = bst_vec3_scale((bst_vec3){0.6, 0.64, 0.48}, -0.0785 * frame);
    bst_quat q =
        bst_quat_mul(bst_quat_from_rotvec(turn), bst_quat_from_rotvec((bst_vec3){0.4, -1.0, 0.7}));
    double depth = 70.0 - 0.4 * frame;
    bst_vec3 at = {0.01 * frame, -0.3, depth};
    *out = (tumbling_frame){.x_px = 255.5 + at.x / (depth * SCALE),
                            .y_px = 255.5 + at.y / (depth * SCALE),
                            .range_m = bst_vec3_norm(at)};
    out->size_px = draw(q, at, without, 0.15, (uint64_t)frame + 1, &out->silhouette);
    double sigma = 0.03 * out->size_px;
    out->detection = (bst_detection){.x_px = out->silhouette.centre_x_px,
                                     .y_px = out->silhouette.centre_y_px,
                                     .cov_xx = sigma * sigma,
                                     .cov_yy = sigma * sigma};
}

static void measure(bst_target_model_fit *fit, int frame, const tumbling_frame *f,
                    bst_detection *d) {
    const bst_camera camera = a_camera();
    const bst_extended_config config = {.enabled = true, .target_model_sigma = 0.002};
    const bst_extended_view view = {
        .camera = &camera, .binning = 1.0, .sun_known = true, .sun_cam = {0.0, 0.0, -1.0}};
    const bst_target_fit_frame now = {&view, BST_QUAT_IDENTITY, 3.0 * frame, 1e-3};
    *d = f->detection;
    bst_target_fit_measure(fit, &config, &now, &f->silhouette, d);
}

/* Square of the error in the detection's standard deviations, over its mean of 2. */
static double normalised(const tumbling_frame *f, const bst_detection *d) {
    double dx = d->x_px - f->x_px, dy = d->y_px - f->y_px;
    double determinant = d->cov_xx * d->cov_yy - d->cov_xy * d->cov_xy;
    return 0.5 * (d->cov_yy * dx * dx - 2.0 * d->cov_xy * dx * dy + d->cov_xx * dy * dy) /
           determinant;
}

/* The target tumbles; from frame 40 to 42 one of its panels is dark. */
static void follows_a_tumbling_target(void **state) {
    (void)state;
    enum { FRAMES = 60, DARK = 40, BRIGHT = 43 };
    bst_ctx ctx = {0};
    bst_target_model_fit fit = {0};
    bst_assert_ok(&ctx, bst_target_model_load(&ctx, "scenarios/satellites/inspection_client.json",
                                              &fit.model));
    double squares = 0.0, before = 0.0, deviations = 0.0, ranges = 0.0;
    int count = 0;
    for (int i = 0; i < FRAMES; i++) {
        tumbling_frame f;
        bst_detection d;
        bool dark = i >= DARK && i < BRIGHT;
        make_frame(i, dark ? 3 : -1, &f);
        measure(&fit, i, &f, &d);
        double error = hypot(d.x_px - f.x_px, d.y_px - f.y_px) / f.size_px;
        if (dark) {
            /* without a model a panel's third of the outline is gone */
            assert_true(error < 0.03);
        } else if (i >= 10) {
            double old = hypot(f.detection.x_px - f.x_px, f.detection.y_px - f.y_px) / f.size_px;
            double range = (d.extent.range_m - f.range_m) / d.extent.range_sigma_m;
            squares += error * error;
            before += old * old;
            deviations += normalised(&f, &d);
            ranges += range * range;
            count++;
        }
    }
    double rms = sqrt(squares / count);
    /* noise of 0.15 px at 80 to 150 px; the antenna moves the outline's centroid by more */
    assert_true(rms < 0.004);
    assert_true(sqrt(before / count) > 3.0 * rms);
    /* stated errors are those found, and rather larger */
    assert_in_range((int)(1000.0 * deviations / count), 30, 1500);
    assert_in_range((int)(1000.0 * ranges / count), 30, 2000);
    bst_target_model_free(fit.model);
}

static bst_status archive_fit(void *self, bst_archive *archive) {
    bst_target_fit_archive(self, archive);
    return BST_OK;
}

/* A restored state goes on like the first. */
static void continues_after_a_restore(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model_fit fit[2] = {{0}};
    for (int i = 0; i < 2; i++) {
        bst_assert_ok(&ctx,
                      bst_target_model_load(&ctx, "scenarios/satellites/inspection_client.json",
                                            &fit[i].model));
    }
    bst_detection d[2];
    tumbling_frame f;
    for (int i = 0; i < 6; i++) {
        make_frame(i, -1, &f);
        measure(&fit[0], i, &f, &d[0]);
    }
    test_saved saved = test_save(archive_fit, &fit[0]);
    bst_assert_ok(&ctx, test_restore(&ctx, archive_fit, &fit[1], saved));
    free(saved.bytes);
    make_frame(6, -1, &f);
    for (int i = 0; i < 2; i++) {
        measure(&fit[i], 6, &f, &d[i]);
    }
    assert_true(d[0].x_px != f.detection.x_px);
    assert_memory_equal(&d[0], &d[1], sizeof d[0]);
    for (int i = 0; i < 2; i++) {
        bst_target_model_free(fit[i].model);
    }
}

/* What is not fitted keeps the outline's place: a target at the edge, what is no part of the model.
 */
static void falls_back_to_the_outline(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_target_model_fit fit = {0};
    bst_assert_ok(&ctx, bst_target_model_load(&ctx, "scenarios/satellites/inspection_client.json",
                                              &fit.model));
    for (int i = 0; i < 12; i++) {
        tumbling_frame f;
        bst_detection d;
        make_frame(i, -1, &f);
        f.silhouette.edge = true;
        measure(&fit, i, &f, &d);
        assert_memory_equal(&d, &f.detection, sizeof d);
    }
    assert_int_equal(fit.bank.count, 0);
    for (int i = 0; i < 9; i++) {
        tumbling_frame f;
        bst_detection d;
        make_frame(i, -1, &f);
        if (i == 8) { /* a glint alone: a triangle that no part explains */
            bst_outline_point points[3] = {{250.0, 250.0}, {256.0, 251.0}, {252.0, 259.0}}, hull[6];
            bst_outline_make(points, 3, hull, &f.silhouette.outline);
            f.silhouette.length_px = 9.0;
        }
        measure(&fit, i, &f, &d);
        if (i == 8) { /* what the model has beyond it makes the place uncertain */
            assert_true(d.x_px == f.detection.x_px && d.y_px == f.detection.y_px);
            bst_assert_close(d.cov_xx, f.detection.cov_xx + 0.25 * 81.0, 1e-9);
        }
    }
    bst_target_model_free(fit.model);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(outline_of_a_box),
                                       cmocka_unit_test(outline_with_a_shadow),
                                       cmocka_unit_test(bad_models),
                                       cmocka_unit_test(follows_a_tumbling_target),
                                       cmocka_unit_test(continues_after_a_restore),
                                       cmocka_unit_test(falls_back_to_the_outline)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
