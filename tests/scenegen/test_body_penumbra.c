/* Penumbrae of resolved images: quadratures of the Sun's disc, and frames of a plate's shadow on
 * another plate, against closed forms. */
#include "scenegen/renderer.h"
#include "scenegen/smear/body_penumbra.h"
#include "sim/world/scene/source_body.h"
#include "tests/satellite/satellite_support.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"

/* Light of the disc with limb darkening 1 - 0.6 (1 - mu) on one side of a line at x radii from its
 * centre, over that of all: with c^2 = 1 - x^2 a chord has 0.4 (2 c) + 0.6 (pi c^2 / 2) of 0.8 pi.
 */
static double disc_beside(double x) {
    x = fmin(fmax(x, -1.0), 1.0);
    double segment = 0.4 * (x * sqrt(1.0 - x * x) + asin(x));
    return 0.5 + (segment + 0.3 * BST_PI * (x - x * x * x / 3.0)) / (0.8 * BST_PI);
}

static double edge(double x) {
    return 0.5 * erfc(-x / sqrt(2.0));
}

/* Image of a penumbra at x, in PSF sigmas from its middle: integral over the edges that the chords
 * of the disc make. */
static double penumbra(double x, double half_width) {
    enum { PARTS = 400 };
    double sum = 0.0;
    for (int i = 0; i < PARTS; i++) {
        double from = 2.0 * i / PARTS - 1.0, to = 2.0 * (i + 1.0) / PARTS - 1.0;
        double weight = disc_beside(to) - disc_beside(from);
        sum += weight * edge(x - half_width * 0.5 * (from + to));
    }
    return sum;
}

/* Each quadrature has the mean and the second moment of the disc, and its error at a border of any
 * direction is within the bound. */
static void test_quadratures(void **state) {
    (void)state;
    static bst_body_times t;
    const double widths[] = {0.3, 0.7, 1.2, 2.0, 3.0, 5.0, 7.0};
    for (int rule = 0; rule < BST_BODY_SUN_RULES; rule++) {
        t = (bst_body_times){.u = {0.5}, .weight = {1.0}, .count = 1};
        assert_int_equal(bst_body_penumbra_expand(&t, rule), rule);
        assert_int_equal(t.count, bst_body_sun_points(rule));
        double sum = 0.0, x = 0.0, y = 0.0, rr = 0.0;
        for (int k = 0; k < t.count; k++) {
            const double *at = t.shadow_at[k];
            sum += t.weight[k];
            x += t.weight[k] * at[0];
            y += t.weight[k] * at[1];
            rr += t.weight[k] * (at[0] * at[0] + at[1] * at[1]);
        }
        bst_assert_close(sum, 1.0, 1e-10);
        bst_assert_close(hypot(x, y), 0.0, 1e-12);
        bst_assert_close(rr, rule == 0 ? 0.0 : 0.45, 1e-9);
        for (int n = 0; n < 7 * 9; n++) {
            double width = widths[n / 9], angle = BST_PI * (n % 9) / 8.5, worst = 0.0;
            for (double at = -width - 3.0; at < width + 3.0; at += 0.4) {
                double image = 0.0;
                for (int k = 0; k < t.count; k++) {
                    double across = t.shadow_at[k][0] * cos(angle) + t.shadow_at[k][1] * sin(angle);
                    image += t.weight[k] * edge(at - width * across);
                }
                worst = fmax(worst, fabs(image - penumbra(at, width)));
            }
            /* 3e-6: the integral's own error */
            assert_true(worst <= bst_body_sun_error(rule, width) + 3e-6);
        }
    }
}

/* Poses of a body that turns leave less room: the finest quadrature that fits. */
static void test_room(void **state) {
    (void)state;
    static bst_body_times t;
    t = (bst_body_times){.count = BST_BODY_POSES_MAX / 16};
    for (int k = 0; k < t.count; k++) {
        t.u[k] = (k + 0.5) / t.count;
        t.weight[k] = 1.0 / t.count;
    }
    int rule = bst_body_penumbra_expand(&t, BST_BODY_SUN_RULES - 1);
    assert_int_equal(bst_body_sun_points(rule), 16);
    assert_int_equal(t.count, BST_BODY_POSES_MAX);
    bst_assert_close(t.u[17], 1.5 * 16 / BST_BODY_POSES_MAX, 1e-12);
}

enum { SIDE = 128 };

#define RANGE_M 1e6 /* perspective is negligible */
#define PX_PER_M 20.0
#define HEIGHT_M 3.0
#define EDGE_M -1.8
#define PER_PX_E 1e4
#define PLATES                                                                                \
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"parts\": [{\"name\": \"low\", "   \
    "\"kind\": \"plate\", \"size_m\": [5, 5, 0], \"material\": \"m\"}, {\"name\": \"high\", " \
    "\"kind\": \"plate\", \"size_m\": [6, 12, 0], \"position_m\": [-4.8, 0, 3], "             \
    "\"material\": \"m\"}"

/* The shadow of the edge at EDGE_M is cast by HEIGHT_M times the tangent of the incidence, and a
 * point of the disc that is off by an angle casts it elsewhere: its closed form, under the PSF and
 * the pixel. A model with a sphere is drawn in the other way. */
static void test_plate_over_plate(void **state) {
    fixture *f = *state;
    static float image[SIDE * SIDE];
    bst_camera camera = scene_camera(SIDE, SIDE);
    camera.pixel_scale_arcsec = 1.0 / (RANGE_M * PX_PER_M) / BST_ARCSEC_RAD;
    double sigma_px = bst_camera_psf_sigma_px(&camera), s = sigma_px * sqrt(2.0);
    static const char *const texts[] = {
        PLATES "]}", PLATES
        ", {\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 0.05, "
        "\"position_m\": [2, 2.3, 0.1], \"material\": \"m\"}]}"};
    const double au[] = {3.0, 1.0, 0.3, 0.12, 1.0}, in = atan(0.75);
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    scene_track track = scene_track_make(&camera, &still);
    bst_renderer_options options = bst_renderer_default_options();
    options.penumbrae = true;
    for (int n = 0; n < 5; n++) {
        bst_test_model model = bst_test_model_open(texts[n / 4]);
        double a = bst_camera_scale_rad(&camera), radius = BST_SUN_RADIUS_M / (au[n] * BST_AU_M);
        bst_scene_source_body body = {.satellite = model.satellite, .times = 1};
        body.q_body_from_gcrf[0] = bst_quat_from_rotvec((bst_vec3){-BST_PI, 0.0, 0.0});
        body.object_m[0] = body.object_m[1] = (bst_vec3){7e6, 0, 0};
        body.sun_m =
            bst_vec3_axpy(body.object_m[0], au[n] * BST_AU_M, (bst_vec3){-sin(in), 0.0, -cos(in)});
        body.gain[0].sun = BST_PI * PER_PX_E / (a * a);
        const double place[2] = {63.2, 64.45};
        bst_scene_source source = {
            .kind = BST_SOURCE_OBJECT,
            .apparent_mid = bst_camera_unproject(&camera, place[0], place[1]),
            .range_m = RANGE_M,
            .body = &body,
            .body_u = {0.0, 1.0},
            .electrons_per_s = 2e7};
        bst_renderer *r;
        bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &camera, &options, &r));
        bst_render_request q = {
            .window = {0, 0, SIDE, SIDE}, .track = &track.track, .sources = &source, .count = 1};
        bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
        bst_render_stats stats;
        bst_renderer_get_stats(r, &stats);
        bst_renderer_free(r);
        bst_test_model_close(&model);

        double worst = 0.0, sharp = 0.0, light = PER_PX_E * cos(in);
        for (int x = 40; x < 104; x++) { /* beside the upper plate, and the end of the lower one */
            enum { PARTS = 4000 };
            double expected = 0.0, without = 0.0;
            for (int i = 0; i < PARTS; i++) {
                double u = (x - 8.0) + 16.0 * (i + 0.5) / PARTS, from = (u - place[0]) / PX_PER_M;
                double off = tan(atan((from - EDGE_M) / HEIGHT_M) - in) / radius;
                double seen = 0.5 * (erf((x + 0.5 - u) / s) - erf((x - 0.5 - u) / s));
                expected += light * 16.0 / PARTS * seen * disc_beside(off);
                without += off > 0.0 ? light * 16.0 / PARTS * seen : 0.0;
            }
            double noise = sqrt(expected + camera.read_noise_e * camera.read_noise_e);
            for (int y = 55; y < 75; y++) {
                worst = fmax(worst, fabs((double)image[y * SIDE + x] - expected) / noise);
            }
            sharp = fmax(sharp, fabs(without - expected) / noise);
        }
        printf("%g au: %.4f sigma, predicted %.4f; without penumbra %.3f\n", au[n], worst,
               stats.predicted_sigma, sharp);
        assert_true(worst <= 0.05); /* the limit of the issue for images */
        assert_true(worst <= stats.predicted_sigma);
        assert_true(sharp > 2.0 * worst);
    }
    scene_track_free(&track);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_quadratures),
                                       cmocka_unit_test(test_room),
                                       cmocka_unit_test(test_plate_over_plate)};
    return cmocka_run_group_tests(tests, open_device, close_device);
}
