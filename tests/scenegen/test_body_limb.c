/* Frames of bodies that the Earth's limb cuts, against integrals over what bst_astro_earth_occults
 * leaves in sight. */
#include "scenegen/part_mask.h"
#include "scenegen/renderer.h"
#include "sim/astro/bodies.h"
#include "sim/world/scene/body_limb.h"
#include "sim/world/scene/shape_truth.h"
#include "tests/satellite/satellite_support.h"
#include "tests/scenegen/device_fixture.h"
#include "tests/scenegen/scene_support.h"

enum { SIDE = 128 };

/* Far so that the limb is bent, and large so that this is seen: by 0.01 px. */
#define BEFORE_M 1e7 /* from the observer to the limb, and on to the body */
#define BEYOND_M 1e6
#define RANGE_M (BEFORE_M + BEYOND_M)
#define PX_RAD 1.35e-5
#define CENTRE 63.5

static const bst_vec3 pole = {0.36, 0.48, 0.8};

#define MATERIAL \
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 1}], \"parts\": [{\"name\": \"b\", "
static const char *const plate =
    MATERIAL "\"kind\": \"plate\", \"size_m\": [9000, 6000, 0], \"material\": \"m\"}]}";
static const char *const sphere =
    MATERIAL "\"kind\": \"sphere\", \"radius_m\": 4500, \"material\": \"m\"}]}";

/* A body of even radiance on the boresight, which is the z axis. */
typedef struct scene {
    bst_test_model model;
    bst_scene_source_body body;
    bst_scene_source source;
    bst_camera camera;
    bool round;
    double half[2]; /* of the body, px */
} scene;

/* Place of an observer from which the limb is `px` beyond the boresight, towards the outside: the
 * body's middle is hidden by that much if px is positive. */
static bst_vec3 observer_at(double px) {
    const double turn = 0.7;
    double low = 6.2e6, high = 6.5e6;
    for (int i = 0; i < 60; i++) {
        double rho = 0.5 * (low + high);
        bst_vec3 eye = {rho * cos(turn), rho * sin(turn), -BEFORE_M};
        bst_vec3 far = bst_vec3_axpy(eye, RANGE_M, (bst_vec3){0, 0, 1});
        *(bst_astro_earth_occults(eye, far, pole) ? &low : &high) = rho;
    }
    double rho = low - px * PX_RAD * BEFORE_M;
    return (bst_vec3){rho * cos(turn), rho * sin(turn), -BEFORE_M};
}

static void make_scene(scene *s, const char *text, bool round, double per_px_e) {
    *s = (scene){.model = bst_test_model_open(text), .camera = scene_camera(SIDE, SIDE)};
    s->camera.pixel_scale_arcsec = PX_RAD / BST_ARCSEC_RAD;
    s->round = round;
    s->body.satellite = s->model.satellite;
    s->body.times = 1;
    s->body.first_part = 1;
    s->body.q_body_from_gcrf[0] = (bst_quat){0, 1, 0, 0}; /* the front of the plate */
    s->body.sun_m = (bst_vec3){BST_AU_M, 0, 0};
    s->body.gain[0].emission = per_px_e / (PX_RAD * PX_RAD);
    s->body.limb = true;
    s->body.pole = pole;
    double tangent = 4500.0 / RANGE_M;
    s->half[0] = (round ? tan(asin(tangent)) : tangent) / PX_RAD;
    s->half[1] = round ? s->half[0] : 3000.0 / RANGE_M / PX_RAD;
    double area = round ? BST_PI * s->half[0] * s->half[0] : 4.0 * s->half[0] * s->half[1];
    s->source = (bst_scene_source){.kind = BST_SOURCE_OBJECT,
                                   .apparent_mid = {0, 0, 1},
                                   .electrons_per_s = per_px_e * area,
                                   .range_m = RANGE_M,
                                   .body = &s->body,
                                   .body_u = {0.0, 1.0}};
}

/* Sets the observer's path: the limb moves between two places in the exposure. */
static void set_limb(scene *s, double from_px, double to_px) {
    for (int k = 0; k < BST_PATH_NODES; k++) {
        s->body.eye.place[k] = observer_at(from_px + 0.25 * k * (to_px - from_px));
    }
    for (int k = 0; k < 2; k++) {
        s->body.object_m[k] = bst_vec3_axpy(s->body.eye.place[4 * k], RANGE_M, (bst_vec3){0, 0, 1});
    }
}

/* Integral of the error function. */
static double integral_of_erf(double t) {
    return fabs(t) > 6.0 ? fabs(t) : t * erf(t) + exp(-t * t) / sqrt(BST_PI);
}

static bool hidden(bst_vec3 eye, double x, double y) {
    bst_vec3 d = bst_vec3_unit((bst_vec3){x * PX_RAD, y * PX_RAD, 1.0});
    return bst_astro_earth_occults(eye, bst_vec3_axpy(eye, RANGE_M, d), pole);
}

/* Adds what is in sight from an observer: rows of some `step` px, which end at
 * the body and the limb. */
static void add_expected(const scene *s, bst_vec3 eye, double step, double value, double *image) {
    double sigma = bst_camera_psf_sigma_px(&s->camera) * sqrt(2.0);
    int rows = (int)ceil(2.0 * s->half[1] / step);
    for (int n = 0; n < rows; n++) {
        /* uniform in the angle: smooth where a chord vanishes as a square root */
        double turn = BST_PI * ((n + 0.5) / rows - 0.5), line[SIDE];
        double y = s->half[1] * sin(turn), height = s->half[1] * cos(turn) * BST_PI / rows;
        double half = s->half[0];
        half = s->round ? sqrt(fmax(half * half - y * y, 0.0)) : half;
        double ends[2] = {-half, half};
        bool dark[2] = {hidden(eye, ends[0], y), hidden(eye, ends[1], y)};
        if (dark[0] && dark[1]) {
            continue;
        }
        for (int k = 0; k < 2; k++) {
            double in = ends[1 - k], out = ends[k];
            for (int i = 0; i < 20 && dark[k]; i++) {
                double middle = 0.5 * (in + out);
                *(hidden(eye, middle, y) ? &out : &in) = middle;
            }
            ends[k] = dark[k] ? in : ends[k];
        }
        for (int i = 0; i < SIDE; i++) {
            double x = i - CENTRE;
            line[i] = 0.0;
            for (int k = 0; k < 2; k++) {
                double at = ends[k] - x;
                line[i] +=
                    (k ? 0.5 : -0.5) *
                    (integral_of_erf((at + 0.5) / sigma) - integral_of_erf((at - 0.5) / sigma)) *
                    sigma;
            }
        }
        for (int j = (int)(y + CENTRE - 9.0); j < y + CENTRE + 9.0; j++) { /* 10 sigma */
            double down = j - CENTRE - y;
            double part = 0.5 * height * (erf((down + 0.5) / sigma) - erf((down - 0.5) / sigma));
            for (int i = 0; i < SIDE && part > 1e-12; i++) {
                image[j * SIDE + i] += value * part * line[i];
            }
        }
    }
}

/* Draws the scene. Returned: largest error in sigma of its pixel. */
static double compare(fixture *f, const scene *s, const double *expected, double *predicted) {
    static float image[SIDE * SIDE];
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    scene_track track = scene_track_make(&s->camera, &still);
    bst_renderer *r;
    bst_render_stats stats;
    bst_assert_ok(&f->ctx, bst_renderer_create(&f->ctx, f->device, &s->camera, NULL, &r));
    bst_render_request q = {
        .window = {0, 0, SIDE, SIDE}, .track = &track.track, .sources = &s->source, .count = 1};
    bst_assert_ok(&f->ctx, bst_renderer_render_noise_free(&f->ctx, r, &q, image));
    bst_renderer_get_stats(r, &stats);
    bst_renderer_free(r);
    scene_track_free(&track);
    double worst = 0.0, read2 = s->camera.read_noise_e * s->camera.read_noise_e;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double error = fabs((double)image[i] - expected[i]) / sqrt(expected[i] + read2);
        worst = fmax(worst, error);
    }
    *predicted = stats.predicted_sigma;
    return worst;
}

/* Facets and curved surfaces with the limb at rest, and with one that moves by 10 px, and by 40 px,
 * which blurs the limb and not the borders of the plate. */
static void test_cut(void **state) {
    fixture *f = *state;
    static double expected[SIDE * SIDE];
    const double limb[][2] = {{3.3, 3.3}, {-14.0, -14.0}, {-3.0, 7.0}, {-30.0, 10.0}};
    const double bright[] = {1.5e3, 4e4};
    for (int n = 0; n < 11; n++) {
        scene s;
        int moves = n == 10 ? 3 : n / 4, times = moves == 3 ? 800 : moves == 2 ? 128 : 1;
        double per_px_e = bright[n == 8 || n == 10 || (moves < 2 && n / 2 % 2)], predicted;
        make_scene(&s, n % 2 ? sphere : plate, n % 2, per_px_e);
        set_limb(&s, limb[moves][0], limb[moves][1]);
        memset(expected, 0, sizeof expected);
        for (int k = 0; k < times; k++) {
            bst_vec3 eye = bst_scene_source_place(&s.body.eye, (k + 0.5) / times);
            add_expected(&s, eye, times > 1 ? 0.16 : 0.05, per_px_e / times, expected);
        }
        double worst = compare(f, &s, expected, &predicted);
        assert_true(worst <= (n == 10 ? 0.1 : 0.05));
        assert_true(worst <= predicted);
        bst_test_model_close(&s.model);
    }
}

/* Nothing is cut of a body that is before the Earth or clear of the limb, and nothing is left of
 * one behind. */
static void test_kinds(void **state) {
    fixture *f = *state;
    static double dark[SIDE * SIDE];
    const bst_body_limb_view view = {{0, 0, 0, 1}, PX_RAD};
    const double limb[][2] = {{-60.0, -60.0}, {-60.0, 20.0}, {2.0, 2.0}, {60.0, 50.0}};
    const bst_body_limb_kind kind[] = {BST_BODY_LIMB_FAR, BST_BODY_LIMB_CUTS, BST_BODY_LIMB_CUTS,
                                       BST_BODY_LIMB_HIDES};
    bst_resolved_hidden region;
    double predicted;
    scene s;
    make_scene(&s, plate, false, 1e4);
    for (int n = 0; n < 4; n++) {
        set_limb(&s, limb[n][0], limb[n][1]);
        assert_int_equal(bst_body_limb_during(&s.source), kind[n]);
        /* the observer moves on a straight line, in a plane that is not that of the sky */
        double behind = 0.5 * (limb[n][0] + limb[n][1]) * PX_RAD;
        bst_assert_close(bst_body_limb_behind(&s.source, 0.5), behind, 3e-3 * fabs(behind));
    }
    assert_true(compare(f, &s, dark, &predicted) == 0.0);
    for (int k = 0; k < 2; k++) {
        s.body.object_m[k].z -= 2.0 * BEYOND_M;
    }
    assert_int_equal(bst_body_limb_during(&s.source), BST_BODY_LIMB_FAR);
    assert_false(bst_body_limb_hidden(&s.source, 0.5, &view, &region));
    bst_test_model_close(&s.model);
}

/* Visible share, box, extent and centre of light of the truth, and the mask of parts, against
 * points of the plate that are in sight. The plate is turned in the image. */
static void check_truth(fixture *f, double turn) {
    enum { ACROSS = 1000 };
    const double c = cos(turn), n_turn = sin(turn);
    scene s;
    make_scene(&s, plate, false, 1e4);
    s.body.q_body_from_gcrf[0] =
        bst_quat_mul(s.body.q_body_from_gcrf[0], bst_quat_from_rotvec((bst_vec3){0.0, 0.0, -turn}));
    set_limb(&s, 3.3, 3.3);
    bst_truth *truth = calloc(1, sizeof *truth + sizeof truth->items[0]);
    assert_non_null(truth);
    truth->q_cam_from_gcrf_mid = (bst_quat){0, 0, 0, 1};
    truth->count = 1;
    truth->items[0] = (bst_truth_item){.electrons = 1e6, .snr = 100.0};
    const int source_of[] = {0};
    bst_shape_truth work = {.capacity = 0};
    bst_assert_ok(&f->ctx,
                  bst_shape_truth_fill(&f->ctx, &work, &s.camera, &s.source, source_of, truth));
    const bst_truth_shape *t = &truth->shapes[0];
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, sum[3] = {0.0};
    double across[2][2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
    for (int n = 0; n < ACROSS * ACROSS; n++) {
        double u = s.half[0] * (2.0 * (n % ACROSS + 0.5) / ACROSS - 1.0);
        double v = s.half[1] * (2.0 * ((double)(n / ACROSS) + 0.5) / ACROSS - 1.0);
        double at[2] = {c * u - n_turn * v, n_turn * u + c * v};
        if (hidden(s.body.eye.place[2], at[0], at[1])) {
            continue;
        }
        sum[2] += 1.0;
        for (int k = 0; k < 2; k++) {
            double diagonal = (at[0] + (k ? 1.0 : -1.0) * at[1]) / sqrt(2.0);
            sum[k] += at[k];
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
            across[k][0] = fmin(across[k][0], diagonal);
            across[k][1] = fmax(across[k][1], diagonal);
        }
    }
    const double share = sum[2] / ACROSS / ACROSS, step = 2.0 * s.half[0] / ACROSS;
    assert_true(share > 0.3 && share < 0.7);
    bst_assert_close(t->visible, share, 1e-3);
    bst_assert_close(truth->items[0].electrons, 1e6 * share, 1e3);
    bst_assert_close(t->x0_px, CENTRE + low[0], step);
    bst_assert_close(t->y0_px, CENTRE + low[1], step);
    bst_assert_close(t->x1_px, CENTRE + high[0], step);
    bst_assert_close(t->y1_px, CENTRE + high[1], step);
    bst_assert_close(t->x_light_px, CENTRE + sum[0] / sum[2], 0.02);
    bst_assert_close(t->y_light_px, CENTRE + sum[1] / sum[2], 0.02);
    for (int k = 0; k < 2; k++) { /* the extent is one that is at least as long as others */
        assert_true(t->size_px > across[k][1] - across[k][0] - step);
        assert_true(t->size_px > high[k] - low[k] - step);
    }
    assert_true(t->size_px < hypot(high[0] - low[0], high[1] - low[1]) + step);
    static int32_t mask[SIDE * SIDE];
    bst_part_mask parts = {0};
    const scene_motion still = {.duration_s = 1.0, .samples = 2};
    scene_track track = scene_track_make(&s.camera, &still);
    bst_render_request q = {
        .window = {0, 0, SIDE, SIDE}, .track = &track.track, .sources = &s.source, .count = 1};
    bst_assert_ok(&f->ctx, bst_part_mask_draw(&f->ctx, &parts, &s.camera, &q, mask));
    for (int i = 0; i < SIDE * SIDE; i++) {
        double x = i % SIDE - CENTRE, y = (double)(i / SIDE) - CENTRE, near = 0.0;
        double u = fabs(c * x + n_turn * y), v = fabs(c * y - n_turn * x),
               edge = turn == 0.0 ? 0.0 : 1.0;
        bool in = u < s.half[0] - edge && v < s.half[1] - edge;
        for (int k = 0; k < 4 && in; k++) { /* pixels at the limb are of either */
            near += hidden(s.body.eye.place[2], x + (k & 1 ? 0.5 : -0.5), y + (k & 2 ? 0.5 : -0.5));
        }
        if (in && (near == 0.0 || near == 4.0)) {
            assert_true((mask[i] != mask[0]) == (near == 0.0));
        }
    }
    scene_track_free(&track);
    bst_part_mask_free(&parts);
    bst_shape_truth_free(&work);
    bst_test_model_close(&s.model);
    free(truth);
}

static void test_truth(void **state) {
    const double turns[] = {0.0, 0.4};
    for (int n = 0; n < 2; n++) {
        check_truth(*state, turns[n]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_kinds), cmocka_unit_test(test_truth),
                                       cmocka_unit_test(test_cut)};
    return cmocka_run_group_tests(tests, open_device, close_device);
}
