/* Image of a shape against a point: closed forms of squares and pairs of points under a Gaussian.
 */
#include "sim/world/scene/brightness.h"
#include "sim/world/scene/shape_light.h"
#include "sim/world/scene/shape_truth.h"
#include "sim/world/scene/source_body.h"
#include "tests/satellite/satellite_support.h"

/* An image of cells, all dark. */
static bst_resolved_image make_image(double cell_px, int x0, int y0, int width, int height) {
    bst_resolved_image m = {
        .cell_px = cell_px, .x0 = x0, .y0 = y0, .width = width, .height = height};
    m.cells = calloc((size_t)width * (size_t)height, sizeof *m.cells);
    assert_non_null(m.cells);
    return m;
}

/* Integral along an axis of the square of a line of length `a` under a Gaussian, of light 1. */
static double squared_line(double a, double sigma) {
    double u = 0.5 * a / sigma;
    return (a * erf(u) - 2.0 * sigma / sqrt(BST_PI) * (1.0 - exp(-u * u))) / (a * a);
}

static void squares(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    const double sigma = 0.9,
                 sides[][2] = {{0.5, 0.5}, {2.0, 1.0}, {6.0, 3.0}, {40.0, 40.0}, {300.0, 150.0}};
    for (int n = 0; n < 5; n++) {
        double cell = sides[n][0] / 256.0, a = sides[n][0], b = sides[n][1];
        int high = (int)(b / cell);
        bst_resolved_image m = make_image(cell, 40, -30, 256, high);
        for (int i = 0; i < 256 * high; i++) {
            m.cells[i].light = 3.0f;
        }
        bst_shape_light_figures f;
        bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, sigma, &f));
        bst_assert_close(f.light, 3.0 * 256 * high, 1e-9 * f.light);
        bst_assert_close(f.x_px, (40 + 128) * cell, 1e-9 * a);
        bst_assert_close(f.y_px, (-30 + 0.5 * high) * cell, 1e-9 * a);
        bst_assert_close(f.xx, a * a / 12.0, 1e-4 * a * a);
        bst_assert_close(f.xy, 0.0, 1e-9 * a * a);
        bst_assert_close(f.yy, b * b / 12.0, 1e-3 * b * b);
        double point = 1.0 / (4.0 * BST_PI * sigma * sigma), s = sigma * sqrt(8.0);
        double snr = sqrt(squared_line(a, sigma) * squared_line(b, sigma) / point);
        double peak = erf(a / s) * erf(b / s) / (a * b) / (2.0 * point);
        double output = erf(a / (s * sqrt(2.0))) * erf(b / (s * sqrt(2.0))) / (a * b) / point;
        /* the grid has a 64th of the image, or half a sigma */
        bst_assert_close(f.snr_ratio, snr, 0.03 * snr);
        bst_assert_close(f.peak_ratio, peak, 0.04 * peak);
        bst_assert_close(f.filter_ratio, output, 0.03 * output);
        free(m.cells);
    }
    bst_shape_light_free(&work);
}

/* Two points, 3 : 1, at a distance d along the diagonal. */
static void two_points(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    const double sigma = 1.1;
    for (int d = 0; d <= 8; d += 2) {
        bst_resolved_image m = make_image(0.5, -3, 5, 16, 16);
        m.cells[0] = (bst_resolved_cell){.light = 3.0f, .moment_x = 0.3f}; /* 0.1 cells */
        bst_resolved_cell *other = &m.cells[d * 17];
        other->light += 1.0f;
        other->moment_x += 0.1f;
        bst_shape_light_figures f;
        bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, sigma, &f));
        double apart = 0.5 * d * sqrt(2.0);
        bst_assert_close(f.x_px, 0.5 * (-3 + 0.6) + 0.25 * 0.5 * d, 1e-6);
        bst_assert_close(f.y_px, 0.5 * (5 + 0.5) + 0.25 * 0.5 * d, 1e-6);
        bst_assert_close(f.xx, 3.0 / 16.0 * 0.25 * d * d, 1e-6);
        bst_assert_close(f.xy, 3.0 / 16.0 * 0.25 * d * d, 1e-6);
        double cross = exp(-0.25 * apart * apart / (sigma * sigma));
        bst_assert_close(f.snr_ratio, sqrt((9.0 + 1.0 + 6.0 * cross) / 16.0), 0.02);
        if (d == 8) { /* apart: the brighter one alone */
            bst_assert_close(f.peak_ratio, 0.75, 0.02);
        }
        free(m.cells);
    }
    bst_shape_light_free(&work);
}

/* Two cells beside each other along x or y, with their light near their common edge or far from it:
 * the places within the cells decide how much of the two images is one. */
static void light_is_where_it_is_in_its_cell(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    const double sigma = 0.6;
    for (int k = 0; k < 4; k++) {
        const int along_y = k / 2, apart = k % 2;
        bst_resolved_image m = make_image(1.0, 3, -2, 8, 6);
        const float shift = apart ? 0.4f : -0.4f;
        bst_resolved_cell *two[2] = {&m.cells[2 * 8 + 3],
                                     &m.cells[along_y ? 3 * 8 + 3 : 2 * 8 + 4]};
        for (int i = 0; i < 2; i++) {
            const float off = i ? shift : -shift;
            *two[i] = (bst_resolved_cell){.light = 2.0f,
                                          .moment_x = along_y ? 0.0f : 2.0f * off,
                                          .moment_y = along_y ? 2.0f * off : 0.0f};
        }
        bst_shape_light_figures f;
        bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, sigma, &f));
        const double d = apart ? 1.8 : 0.2, cross = exp(-0.25 * d * d / (sigma * sigma));
        bst_assert_close(along_y ? f.yy : f.xx, 0.25 * d * d, 1e-6); /* floats */
        bst_assert_close(along_y ? f.xx : f.yy, 0.0, 1e-6);
        /* a grid of half a sigma */
        bst_assert_close(f.snr_ratio, sqrt(0.5 + 0.5 * cross), 0.02);
        free(m.cells);
    }
    bst_shape_light_free(&work);
}

static void no_light(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_shape_light work = {0};
    bst_resolved_image m = make_image(1.0, 0, 0, 4, 4);
    bst_shape_light_figures f;
    bst_assert_ok(&ctx, bst_shape_light_measure(&ctx, &work, &m, 1.0, &f));
    bst_assert_close(f.light, 0.0, 0);
    bst_assert_close(f.snr_ratio + f.filter_ratio + f.peak_ratio, 3.0, 0);
    free(m.cells);
    bst_shape_light_free(&work);
}

static const double box_m[3] = {1.5, 0.9, 2.2};

static const char *const box =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}], \"parts\": ["
    "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1.5, 0.9, 2.2], "
    "\"material\": \"m\"}]}";

/* A box in motion for three attitudes, of which the exposure is the part from 0.2 to 0.9. */
static bst_scene_source_body moving_body(const bst_satellite *satellite) {
    bst_scene_source_body body = {.satellite = satellite,
                                  .times = 3,
                                  .object_m = {{7e6, 1e5, -3e5}, {7.01e6, 3e5, -2e5}},
                                  .sun_m = {-0.2 * BST_AU_M, -0.9 * BST_AU_M, 0.3 * BST_AU_M},
                                  .seconds = {100.0, 104.0}};
    bst_quat start = bst_quat_unit((bst_quat){0.2, -0.4, 0.1, 0.9});
    for (int k = 0; k < 3; k++) { /* 0.1 rad and 0.3 rad about two axes */
        const bst_vec3 turn[3] = {{0, 0, 0}, {0.0, 0.1, 0.0}, {0.2, 0.1, -0.2}};
        body.q_body_from_gcrf[k] = bst_quat_mul(bst_quat_from_rotvec(turn[k]), start);
    }
    return body;
}

/* Attitude between two that are given, place and time, Sun and Earth from the body. */
static void a_body_during_the_exposure(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(box);
    bst_scene_source_body body = moving_body(m.satellite);
    const bst_scene_source source = {.kind = BST_SOURCE_OBJECT,
                                     .apparent_mid = {0.0, 0.6, 0.8},
                                     .range_m = 300.0,
                                     .body = &body,
                                     .body_u = {0.2, 0.9}};
    for (int k = 0; k < 3; k++) {
        double u = 0.5 * k, v = 0.2 + 0.7 * u;
        bst_source_body_state s;
        bst_source_body_at(&source, u, &s, NULL);
        int first = v < 0.5 ? 0 : 1;
        const bst_quat *q = &body.q_body_from_gcrf[first];
        bst_vec3 turn = bst_quat_to_rotvec(bst_quat_mul(q[1], bst_quat_conj(q[0])));
        bst_quat want =
            bst_quat_mul(bst_quat_from_rotvec(bst_vec3_scale(turn, 2.0 * v - first)), q[0]);
        bst_quat off = bst_quat_mul(s.q_body_from_gcrf, bst_quat_conj(want));
        bst_assert_close(bst_vec3_norm(bst_quat_to_rotvec(off)), 0.0, 1e-7);
        bst_vec3 object = {7e6 + 1e4 * v, 1e5 + 2e5 * v, -3e5 + 1e5 * v};
        bst_vec3 to_sun = bst_vec3_sub(body.sun_m, object);
        bst_assert_close(s.sun_radius_rad, 6.957e8 / bst_vec3_norm(to_sun), 1e-12);
        bst_vec3 sun = bst_quat_rotate(bst_quat_conj(want), s.aim.sun);
        bst_assert_close(bst_vec3_angle(sun, to_sun), 0.0, 1e-7);
        bst_vec3 earth = bst_quat_rotate(bst_quat_conj(want), s.aim.earth);
        bst_assert_close(bst_vec3_angle(earth, bst_vec3_scale(object, -1.0)), 0.0, 1e-7);
        bst_vec3 eye = bst_quat_rotate(bst_quat_conj(want), s.aim.target);
        bst_assert_close(bst_vec3_angle(eye, (bst_vec3){0.0, -0.6, -0.8}), 0.0, 1e-7);
        bst_assert_close(s.aim.seconds, 100.0 + 4.0 * v, 1e-12);
        bst_assert_close(s.range_m, 300.0, 0.0);
        assert_false(s.earth);
    }
    bst_test_model_close(&m);
}

/* Light of materials: the Sun's at its distance from the object, the Earth's at the Sun's distance
 * from the Earth. */
static void light_of_materials(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(box);
    bst_scene_source_body body = moving_body(m.satellite);
    const bst_camera camera = {.aperture_m = 0.2,
                               .throughput = 0.6,
                               .quantum_efficiency = 0.8,
                               .photon_flux_v0_per_s_m2 = 3.6e10};
    const bst_brightness_config brightness = {.earthshine = true, .temperature_k = 300.0};
    const bst_scene_lighting lighting = {.object_m = {0.3 * BST_AU_M, 0.4 * BST_AU_M, 0.0},
                                         .sun_m = {-0.5 * BST_AU_M, 0.4 * BST_AU_M, 0.9 * BST_AU_M},
                                         .sunlit_fraction = 0.7};
    bst_source_body_set_gain(&camera, &brightness, &lighting, &body);
    /* by the definition of a magnitude, pupil of 0.2 m */
    double at_1_au = pow(10.0, 0.4 * 26.74) * 3.6e10 * BST_PI * 0.01 * 0.6 * 0.8;
    double colour = m.satellite->materials[0].colour[BST_SUNLIGHT_V];
    bst_assert_close(body.gain[0].sun / (0.7 * at_1_au * colour), 1.0 / (0.8 * 0.8 + 0.81), 1e-9);
    bst_assert_close(body.gain[0].earth / (at_1_au * colour), 1.0 / (0.25 + 0.16 + 0.81), 1e-9);
    bst_test_model_close(&m);
}

/* Box, extent, and moments of the light of a box in perspective, by its eight corners and its faces
 * in the Sun. */
static void outline_and_light_of_a_box(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(box);
    bst_scene_source_body body = moving_body(m.satellite);
    body.gain[0].sun = 1e6;
    const bst_camera camera = {
        .width_px = 640, .height_px = 400, .pixel_scale_arcsec = 40.0, .psf_fwhm_px = 2.0};
    bst_truth *truth = calloc(1, sizeof *truth + 2 * sizeof truth->items[0]);
    assert_non_null(truth);
    bst_quat q = bst_quat_unit((bst_quat){0.3, 0.1, -0.5, 0.8});
    bst_vec3 look = bst_quat_rotate(bst_quat_conj(q), bst_camera_unproject(&camera, 420.3, 130.8));
    const bst_scene_source sources[2] = {{.kind = BST_SOURCE_OBJECT,
                                          .apparent_mid = look,
                                          .range_m = 500.0,
                                          .body = &body,
                                          .body_u = {0.2, 0.9}},
                                         {.kind = BST_SOURCE_STAR, .apparent_mid = look}};
    const int source_of[2] = {1, 0};
    truth->q_cam_from_gcrf_mid = q;
    truth->count = 2;
    truth->items[1] = (bst_truth_item){.x_centroid_px = 420.0, .y_centroid_px = 131.0, .snr = 50.0};
    bst_shape_truth work = {.capacity = 0};
    bst_assert_ok(&ctx, bst_shape_truth_fill(&ctx, &work, &camera, sources, source_of, truth));
    assert_int_equal(truth->shape_count, 1);
    const bst_truth_shape *s = &truth->shapes[0];
    assert_int_equal(s->item, 1);
    bst_assert_close(s->x_px, 420.3, 1e-6);
    bst_assert_close(s->y_px, 130.8, 1e-6);
    bst_source_body_state at;
    bst_source_body_at(&sources[0], 0.5, &at, NULL);
    bst_quat back = bst_quat_conj(at.q_body_from_gcrf);
    double px[8][2], low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9}, largest = 0.0;
    for (int i = 0; i < 8; i++) {
        bst_vec3 corner = {box_m[0] * (i % 2 - 0.5), box_m[1] * (i / 2 % 2 - 0.5),
                           box_m[2] * ((double)(i / 4) - 0.5)};
        bst_vec3 from_eye =
            bst_vec3_add(bst_vec3_scale(look, 500.0), bst_quat_rotate(back, corner));
        assert_true(
            bst_camera_project(&camera, bst_quat_rotate(q, from_eye), &px[i][0], &px[i][1]));
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], px[i][a]);
            high[a] = fmax(high[a], px[i][a]);
        }
        for (int k = 0; k < i; k++) {
            largest = fmax(largest, hypot(px[i][0] - px[k][0], px[i][1] - px[k][1]));
        }
    }
    bst_assert_close(s->x0_px, low[0], 1e-9);
    bst_assert_close(s->y0_px, low[1], 1e-9);
    bst_assert_close(s->x1_px, high[0], 1e-9);
    bst_assert_close(s->y1_px, high[1], 1e-9);
    bst_assert_close(s->size_px, largest, 1e-9);
    /* light of each face by the cosines towards Sun and eye and its distance; the face in the image
     * is a parallelogram of edges a, b with second moments (a a' + b b') / 12 */
    double light = 0.0, sum[2] = {0.0, 0.0}, square[3] = {0.0, 0.0, 0.0};
    enum { CELLS = 14 };
    static double dots[6 * CELLS * CELLS][3]; /* of the lit faces: px and light */
    int count = 0;
    bst_vec3 sight = bst_quat_rotate(q, look);
    double scale = 1.0 / (500.0 * bst_camera_scale_rad(&camera));
    for (int f = 0; f < 6; f++) {
        int axis = f / 2;
        double n[3] = {0.0, 0.0, 0.0}, side = f % 2 ? 1.0 : -1.0;
        n[axis] = side;
        bst_vec3 normal = {n[0], n[1], n[2]};
        bst_vec3 to_eye =
            bst_vec3_axpy(bst_vec3_scale(at.aim.target, 500.0), -0.5 * box_m[axis], normal);
        double in = bst_vec3_dot(normal, at.aim.sun), out = bst_vec3_dot(normal, to_eye);
        out /= pow(bst_vec3_norm(to_eye), 3.0);
        if (in <= 0.0 || out <= 0.0) {
            continue;
        }
        double w = in * out * box_m[(axis + 1) % 3] * box_m[(axis + 2) % 3], e[3][2];
        for (int k = 0; k < 3; k++) { /* the box's edges in the image */
            double unit[3] = {0.0, 0.0, 0.0};
            unit[k] = box_m[k];
            bst_vec3 edge =
                bst_quat_rotate(q, bst_quat_rotate(back, (bst_vec3){unit[0], unit[1], unit[2]}));
            e[k][0] = scale * (edge.x - edge.z * sight.x / sight.z);
            e[k][1] = scale * (edge.y - edge.z * sight.y / sight.z);
        }
        const double *a = e[(axis + 1) % 3], *b = e[(axis + 2) % 3];
        double c[2] = {0.5 * side * e[axis][0], 0.5 * side * e[axis][1]};
        light += w;
        sum[0] += w * c[0];
        sum[1] += w * c[1];
        square[0] += w * (c[0] * c[0] + (a[0] * a[0] + b[0] * b[0]) / 12.0);
        square[1] += w * (c[0] * c[1] + (a[0] * a[1] + b[0] * b[1]) / 12.0);
        square[2] += w * (c[1] * c[1] + (a[1] * a[1] + b[1] * b[1]) / 12.0);
        for (int k = 0; k < CELLS * CELLS; k++, count++) {
            double u = (k % CELLS + 0.5) / CELLS - 0.5, v = ((k / CELLS) + 0.5) / CELLS - 0.5;
            dots[count][0] = c[0] + u * a[0] + v * b[0];
            dots[count][1] = c[1] + u * a[1] + v * b[1];
            dots[count][2] = w;
        }
    }
    assert_true(light > 0.0);
    double x = sum[0] / light, y = sum[1] / light;
    /* perspective: 1.4 m at 500 m, 0.3 % of 14 px */
    bst_assert_close(s->x_light_px - s->x_px, x, 0.05);
    bst_assert_close(s->y_light_px - s->y_px, y, 0.05);
    assert_true(fabs(x) > 0.3 && fabs(y) > 0.3 && fabs(fabs(x) - fabs(y)) > 0.2);
    bst_assert_close(s->light_xx_px2, square[0] / light - x * x, 0.03 * square[0] / light);
    bst_assert_close(s->light_xy_px2, square[1] / light - x * y, 0.03 * square[0] / light);
    bst_assert_close(s->light_yy_px2, square[2] / light - y * y, 0.03 * square[2] / light);
    bst_assert_close(truth->items[1].x_centroid_px, 420.0 + s->x_light_px - s->x_px, 1e-9);
    bst_assert_close(truth->items[1].y_centroid_px, 131.0 + s->y_light_px - s->y_px, 1e-9);
    assert_true(s->snr_ratio < 0.7);
    /* root of the sum of its squared light, of a point's: Gaussians of the PSF and the pixel that
     * overlap in pairs */
    double sigma2 = pow(bst_camera_psf_sigma_px(&camera), 2.0) + 1.0 / 12.0, pairs = 0.0, all = 0.0;
    for (int i = 0; i < count; i++) {
        all += dots[i][2];
        for (int k = 0; k < count; k++) {
            double dx = dots[i][0] - dots[k][0], dy = dots[i][1] - dots[k][1];
            pairs += dots[i][2] * dots[k][2] * exp(-(dx * dx + dy * dy) / (4.0 * sigma2));
        }
    }
    /* its grid is of half a sigma */
    bst_assert_close(s->snr_ratio / (sqrt(pairs) / all), 1.0, 0.03);
    bst_assert_close(truth->items[1].snr, 50.0 * s->snr_ratio, 1e-9);
    bst_shape_truth_free(&work);
    free(truth);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(squares),
                                       cmocka_unit_test(two_points),
                                       cmocka_unit_test(light_is_where_it_is_in_its_cell),
                                       cmocka_unit_test(no_light),
                                       cmocka_unit_test(a_body_during_the_exposure),
                                       cmocka_unit_test(light_of_materials),
                                       cmocka_unit_test(outline_and_light_of_a_box)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
