/* Images of shapes against closed forms, and against the flux of the same model. */
#include "sim/satellite/resolved_image.h"
#include "tests/satellite/satellite_support.h"

/* A view along -direction (body frame) from a range, with x of the image along `right`. */
static bst_resolved_view look_from(bst_vec3 direction, bst_vec3 right, double range_m,
                                   double scale_rad) {
    bst_quat q = bst_quat_look(bst_vec3_scale(direction, -1.0), right);
    return (bst_resolved_view){q, {0, 0, range_m}, scale_rad, 0.0, 0.0, NULL};
}

/* Light and cover (px^2) of an image. */
typedef struct sums {
    double light, cover;
} sums;

static sums sum_of(const bst_resolved_image *m) {
    sums s = {0};
    for (int j = 0; j < m->height; j++) {
        for (int i = 0; i < m->width; i++) {
            const bst_resolved_cell *c = &m->cells[j * m->width + i];
            s.light += (double)c->light;
            s.cover += (double)c->cover * m->cell_px * m->cell_px;
        }
    }
    return s;
}

/* Renders one pose with unit gains for sunlight. */
static sums render(bst_test_model *m, const bst_resolved_view *view, bst_vec3 sun, double cell_px) {
    bst_ctx ctx = {0};
    bst_resolved *r;
    bst_resolved_gain gain[BST_SATELLITE_MATERIALS_MAX];
    for (int i = 0; i < m->satellite->material_count; i++) {
        gain[i] = (bst_resolved_gain){.sun = 1.0};
    }
    bst_resolved_light light = {.sun = bst_vec3_unit(sun), .gain = gain};
    double low[2], high[2], total;
    assert_true(bst_resolved_box(m->pose, view, low, high));
    bst_assert_ok(&ctx, bst_resolved_create(&ctx, m->satellite, &r));
    bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r, low, high, cell_px));
    bst_assert_ok(&ctx, bst_resolved_add(&ctx, r, m->pose, view, &light, 1.0, &total));
    const bst_resolved_image *image = bst_resolved_image_of(r);
    sums s = sum_of(image);
    /* cells are floats */
    bst_assert_close((s.light - total) / total, 0.0, 1e-5);
    bst_resolved_free(r);
    return s;
}

static const char *const box =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}],"
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 1, 3], \"material\": "
    "\"m\"}]}";
static const char *const sphere =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}],"
    "\"parts\": [{\"name\": \"b\", \"kind\": \"sphere\", \"radius_m\": 1, \"material\": \"m\"}]}";
static const char *const bus =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}, {\"name\": \"p\", \"diffuse\": 0.2, "
    "\"specular\": 0.3, \"model\": \"phong\", \"exponent\": 30}],"
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 2, 3], \"material\": \"m\"},"
    "{\"name\": \"w\", \"kind\": \"plate\", \"size_m\": [6, 1.5, 0], \"position_m\": [5, 0, 0], "
    "\"rotation_deg\": [40, 0, 0], \"material\": \"p\"},"
    "{\"name\": \"v\", \"kind\": \"plate\", \"size_m\": [6, 1.5, 0], \"position_m\": [-5, 0, 0], "
    "\"rotation_deg\": [40, 0, 0], \"material\": \"p\"},"
    "{\"name\": \"c\", \"kind\": \"cylinder\", \"radius_m\": 0.7, \"length_m\": 1.2, "
    "\"position_m\": [0, 0, 2.3], \"material\": \"m\"},"
    "{\"name\": \"d\", \"kind\": \"dish\", \"radius_m\": 1, \"length_m\": 0.3, \"position_m\": [0, "
    "0, 4], \"material\": \"m\"},"
    "{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 0.6, \"position_m\": [0, 1.8, 0.5], "
    "\"material\": \"p\"}]}";

static const char *const flat =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}, {\"name\": \"p\", \"diffuse\": 0.2, "
    "\"specular\": 0.3, \"model\": \"phong\", \"exponent\": 30}],"
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 2, 3], \"material\": \"m\"},"
    "{\"name\": \"w\", \"kind\": \"plate\", \"size_m\": [6, 1.5, 0], \"position_m\": [5, 0, 0], "
    "\"rotation_deg\": [40, 0, 0], \"material\": \"p\"},"
    "{\"name\": \"v\", \"kind\": \"plate\", \"size_m\": [6, 1.5, 0], \"position_m\": [-5, 0, 0], "
    "\"rotation_deg\": [40, 0, 0], \"material\": \"p\"}]}";

/* From far the light is that of bst_satellite_flux_at: exactly for plane facets with all their
 * shadows; for curved surfaces to the error of both. */
static void test_agrees_with_flux(void **state) {
    (void)state;
    const char *const texts[] = {box, flat, sphere, bus};
    /* relative to the mean flux: floats of the cells; facets of spheres; curved surfaces with
     * shadows, of which the flux takes the lit fraction of all facets */
    const double tolerance[] = {2e-6, 2e-5, 2e-4, 2e-2};
    uint64_t seed = 5;
    for (int t = 0; t < 4; t++) {
        bst_test_model m = bst_test_model_open(texts[t]);
        double mean = 0.0, worst = 0.0;
        for (int n = 0; n < 4; n++) {
            bst_vec3 sun = bst_test_direction(&seed), eye = bst_test_direction(&seed);
            double flux = bst_test_flux(&m, sun, eye), range_m = 1e7;
            bst_resolved_view view =
                look_from(eye, (bst_vec3){0.3, 0.8, 0.4}, range_m, 0.05 / range_m);
            sums s = render(&m, &view, sun, 0.25);
            mean += 0.25 * flux;
            worst = fmax(worst, fabs(s.light * range_m * range_m - flux));
            if (t == 2) { /* a disc */
                bst_assert_close(s.cover * 0.05 * 0.05, BST_PI, 1e-3);
            }
        }
        assert_true(mean > 0.0);
        bst_assert_close(worst / mean, 0.0, tolerance[t]);
        bst_test_model_close(&m);
    }
}

/* Solid angle of a triangle (Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983)).
 */
static double triangle_sr(bst_vec3 a, bst_vec3 b, bst_vec3 c) {
    double la = bst_vec3_norm(a), lb = bst_vec3_norm(b), lc = bst_vec3_norm(c);
    double up = bst_vec3_dot(a, bst_vec3_cross(b, c));
    double down =
        la * lb * lc + bst_vec3_dot(a, b) * lc + bst_vec3_dot(a, c) * lb + bst_vec3_dot(b, c) * la;
    return fabs(2.0 * atan2(up, down));
}

/* From nearby the light of a diffuse face is its radiance times its solid angle, in perspective. */
static void test_perspective(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(box);
    bst_vec3 sun = bst_vec3_unit((bst_vec3){0.5, 0.4, 0.7}), eye = {3.2, 2.4, 4.0};
    double range_m = bst_vec3_norm(eye), expected = 0.0;
    bst_resolved_view view = look_from(eye, (bst_vec3){0, 1, 0}, range_m, 0.005);
    const bst_satellite *s = m.satellite;
    for (int f = 0; f < s->facet_count; f++) {
        const bst_facet *facet = &s->facets[f];
        bst_vec3 p[4];
        for (int i = 0; i < 4; i++) {
            p[i] = bst_vec3_sub(s->vertices[s->corner[facet->first + i]], eye);
        }
        double in = bst_vec3_dot(facet->normal, sun);
        if (in > 0.0 && bst_vec3_dot(facet->normal, p[0]) < 0.0) {
            expected +=
                0.5 / BST_PI * in * (triangle_sr(p[0], p[1], p[2]) + triangle_sr(p[0], p[2], p[3]));
        }
    }
    sums image = render(&m, &view, sun, 0.25);
    /* a cell's solid angle is that at its middle */
    bst_assert_close(image.light / expected, 1.0, 2e-5);
    bst_test_model_close(&m);
}

/* A chain of boxes, turned to each other, in front of a plate: facets of many cells and of parts of
 * one, with shadows of both lights. */
static const char *const chain =
    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}, {\"name\": \"p\", \"diffuse\": 0.2, "
    "\"specular\": 0.3, \"model\": \"phong\", \"exponent\": 30}],"
    "\"parts\": [{\"name\": \"a\", \"kind\": \"box\", \"size_m\": [2, 2, 3], \"material\": \"m\"},"
    "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [0.2, 0.3, 4], \"position_m\": [1.5, 0.4, "
    "1.2], \"rotation_deg\": [20, 30, 10], \"material\": \"p\"},"
    "{\"name\": \"c\", \"kind\": \"box\", \"size_m\": [0.02, 0.05, 3], \"position_m\": [-0.3, 1.3, "
    "0.4], \"rotation_deg\": [-30, 10, 70], \"material\": \"m\"},"
    "{\"name\": \"w\", \"kind\": \"plate\", \"size_m\": [6, 5, 0], \"position_m\": [0, -3, 0], "
    "\"rotation_deg\": [75, 10, 0], \"material\": \"p\"}]}";

/* The light of a pose as sums over edges is that of bst_resolved_add, with its moments, also in
 * parts: of poses, and of a box that the body is partly outside of. */
static void compare_light(const bst_earthlight *earth) {
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(chain);
    bst_resolved *r[3];
    bst_resolved_gain gain[2] = {{.sun = 1.0, .earth = 1.0, .emission = 0.03},
                                 {.sun = 1.0, .earth = 2.0, .emission = 0.05}};
    bst_resolved_light light = {
        .sun = bst_vec3_unit((bst_vec3){0.7, 0.9, 0.4}), .earthlight = earth, .gain = gain};
    bst_resolved_view view = look_from((bst_vec3){0.2, 0.7, 0.9}, (bst_vec3){1, 0, 0}, 40.0, 0.004);
    double low[2], high[2], brightest = 0.0, worst = 0.0;
    assert_true(bst_resolved_may_add_light(m.satellite));
    assert_true(bst_resolved_box(m.pose, &view, low, high));
    low[0] = 0.6 * low[0] + 0.4 * high[0];
    high[1] = 0.3 * low[1] + 0.7 * high[1];
    for (int n = 0; n < 3; n++) {
        bst_assert_ok(&ctx, bst_resolved_create(&ctx, m.satellite, &r[n]));
        bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r[n], low, high, 1.0));
        if (n == 0) {
            bst_assert_ok(&ctx, bst_resolved_add(&ctx, r[n], m.pose, &view, &light, 1.0, NULL));
            continue;
        }
        bst_assert_ok(&ctx, bst_resolved_begin_light(&ctx, r[n], false));
        bst_assert_ok(&ctx, bst_resolved_add_light(&ctx, r[n], m.pose, &view, &light, 0.5));
    }
    bst_resolved_settle_light(r[1]);
    bst_resolved_settle_light(r[2]);
    bst_resolved_join_light(r[1], r[2], NULL);
    bst_resolved_end_light(r[1], view.scale_rad);
    const bst_resolved_image *one = bst_resolved_image_of(r[0]), *sum = bst_resolved_image_of(r[1]);
    for (int i = 0; i < one->width * one->height; i++) {
        const bst_resolved_cell *c = &one->cells[i], *d = &sum->cells[i];
        brightest = fmax(brightest, (double)c->light);
        worst = fmax(worst, fabs((double)c->light - (double)d->light));
        worst = fmax(worst, fabs((double)c->moment_x - (double)d->moment_x));
        worst = fmax(worst, fabs((double)c->moment_y - (double)d->moment_y));
    }
    assert_true(brightest > 0.0);
    /* light of polygons that cover a cell to 1e-7 is not cut */
    bst_assert_close(worst / brightest, 0.0, 2e-6);
    for (int n = 0; n < 3; n++) {
        bst_resolved_free(r[n]);
    }
    bst_test_model_close(&m);
}

static void test_light(void **state) {
    (void)state;
    bst_earthlight earth = {.count = 2,
                            .direction = {bst_vec3_unit((bst_vec3){-0.6, 0.5, 0.7}),
                                          bst_vec3_unit((bst_vec3){-0.5, 0.5, 0.9})},
                            .irradiance = {0.3, 0.2},
                            .centre = bst_vec3_unit((bst_vec3){-0.55, 0.5, 0.8})};
    compare_light(&earth);
    compare_light(NULL); /* sunlight and emission of a facet are even over it */
}

/* Second moments are those of cells of a sixteenth of the side. */
static void test_second_moments(void **state) {
    (void)state;
    enum { FINE = 16 };
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(chain);
    bst_resolved *r[2];
    bst_resolved_gain gain[2] = {{.sun = 1.0}, {.sun = 1.0}};
    bst_resolved_light light = {.sun = bst_vec3_unit((bst_vec3){0.7, 0.9, 0.4}), .gain = gain};
    bst_resolved_view view =
        look_from((bst_vec3){0.2, 0.7, 0.9}, (bst_vec3){1, 0, 0}, 4000.0, 1e-4);
    const double low[2] = {-24.0, -24.0}, high[2] = {24.0, 24.0};
    double brightest = 0.0, worst = 0.0;
    for (int n = 0; n < 2; n++) {
        bst_assert_ok(&ctx, bst_resolved_create(&ctx, m.satellite, &r[n]));
        bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r[n], low, high, n == 0 ? 1.0 : 1.0 / FINE));
        bst_assert_ok(&ctx, bst_resolved_begin_light(&ctx, r[n], false));
        bst_assert_ok(&ctx, bst_resolved_add_light(&ctx, r[n], m.pose, &view, &light, 1.0));
        bst_resolved_end_light(r[n], view.scale_rad);
    }
    const bst_resolved_image *one = bst_resolved_image_of(r[0]),
                             *fine = bst_resolved_image_of(r[1]);
    for (int i = 0; i < one->width * one->height; i++) {
        double xx = 0.0, xy = 0.0, yy = 0.0;
        for (int k = 0; k < FINE * FINE; k++) {
            int column = FINE * (i % one->width) + k % FINE,
                row = FINE * (i / one->width) + k / FINE;
            const bst_resolved_cell *c = &fine->cells[row * fine->width + column];
            double x = (k % FINE + 0.5) / FINE - 0.5, y = (k / FINE + 0.5) / FINE - 0.5;
            double even = (double)c->light / (12.0 * FINE * FINE);
            double dx = (double)c->moment_x / FINE, dy = (double)c->moment_y / FINE;
            xx += (double)c->light * x * x + 2.0 * x * dx + even;
            xy += (double)c->light * x * y + x * dy + y * dx;
            yy += (double)c->light * y * y + 2.0 * y * dy + even;
        }
        const bst_resolved_second *s = &one->second[i];
        brightest = fmax(brightest, (double)one->cells[i].light);
        worst = fmax(worst, fabs((double)s->xx - xx));
        worst = fmax(worst, fmax(fabs((double)s->xy - xy), fabs((double)s->yy - yy)));
    }
    assert_true(brightest > 0.0);
    /* the light of fine cells with a border is not even: 1 / 12 of 16 of 256 cells' areas */
    bst_assert_close(worst / brightest, 0.0, 3e-4);
    bst_resolved_free(r[0]);
    bst_resolved_free(r[1]);
    bst_test_model_close(&m);
}

/* Light of a pixel behind a Gaussian PSF. */
static double blurred(const bst_resolved_image *m, double x, double y, double sigma_px) {
    double sum = 0.0, reach = 6.0 * sigma_px;
    for (int j = 0; j < m->height; j++) {
        double dy = (m->y0 + j + 0.5) * m->cell_px - y;
        for (int i = 0; i < m->width && fabs(dy) < reach; i++) {
            const bst_resolved_cell *c = &m->cells[j * m->width + i];
            double dx = (m->x0 + i + 0.5) * m->cell_px - x, light = (double)c->light;
            if (light > 0.0 && fabs(dx) < reach) {
                double u = dx + (double)c->moment_x / light * m->cell_px;
                double v = dy + (double)c->moment_y / light * m->cell_px;
                sum += light * exp(-0.5 * (u * u + v * v) / (sigma_px * sigma_px));
            }
        }
    }
    return sum;
}

/* Behind a PSF, borders of curved surfaces are as right as asked: spheres of 1 to 8 px, a cylinder
 * and a dish, in shadows of one another. */
static void test_allowed_limb(void **state) {
    (void)state;
    const double sigma_px = 0.85;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(bus);
    bst_resolved_gain gain[2] = {{.sun = 1.0}, {.sun = 1.0}};
    bst_resolved_light light = {.sun = bst_vec3_unit((bst_vec3){0.7, 0.9, 0.4}), .gain = gain};
    for (int scale = 0; scale < 3; scale++) {
        bst_resolved *r[2];
        const double range_m = 40.0, px_per_m[] = {1.7, 5.0, 13.0};
        bst_resolved_view view = look_from((bst_vec3){0.2, 0.7, 0.9}, (bst_vec3){1, 0, 0}, range_m,
                                           1.0 / (range_m * px_per_m[scale]));
        double low[2], high[2], total[2], brightest = 0.0, worst = 0.0;
        assert_true(bst_resolved_box(m.pose, &view, low, high));
        for (int n = 0; n < 2; n++) {
            view.limb_px = n == 0 ? 0.0 : BST_RESOLVED_CURVED_PX;
            bst_assert_ok(&ctx, bst_resolved_create(&ctx, m.satellite, &r[n]));
            bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r[n], low, high, 0.25));
            bst_assert_ok(&ctx,
                          bst_resolved_add(&ctx, r[n], m.pose, &view, &light, 1.0, &total[n]));
        }
        double step = (high[0] - low[0]) / 40.0;
        for (double y = low[1] - 1.0; y < high[1] + 1.0; y += step) {
            for (double x = low[0] - 1.0; x < high[0] + 1.0; x += step) {
                double right = blurred(bst_resolved_image_of(r[0]), x, y, sigma_px);
                double coarse = blurred(bst_resolved_image_of(r[1]), x, y, sigma_px);
                brightest = fmax(brightest, right);
                worst = fmax(worst, fabs(coarse - right));
            }
        }
        /* a border that is moved by 1 px changes a pixel by 0.4 / sigma_px of the light */
        bst_assert_close(worst / brightest, 0.0, 0.4 / sigma_px * BST_RESOLVED_CURVED_PX);
        /* it is finer where that is asked for */
        assert_true(worst > 0.0);
        bst_assert_close(total[1] / total[0], 1.0, 1e-4);
        assert_true(brightest > 0.0);
        bst_resolved_free(r[0]);
        bst_resolved_free(r[1]);
    }
    bst_test_model_close(&m);
}

/* Round borders of facets with so many sides that few parts of each are left say what they reach.
 */
static void test_reached_border(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_test_model m = bst_test_model_open(
        "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"c\", "
        "\"kind\": \"cylinder\", \"radius_m\": 1, \"length_m\": 1, \"segments\": 96, "
        "\"material\": \"m\"}]}");
    bst_resolved *r;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    bst_resolved_light light = {.sun = {0, 0, 1}, .gain = gain};
    bst_resolved_view view = look_from((bst_vec3){0, 0, 1}, (bst_vec3){1, 0, 0}, 1e4, 1e-6);
    double low[2], high[2];
    view.limb_px = view.curved_px = 1e-6;
    assert_true(bst_resolved_box(m.pose, &view, low, high));
    bst_assert_ok(&ctx, bst_resolved_create(&ctx, m.satellite, &r));
    bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r, low, high, 1.0));
    bst_assert_ok(&ctx, bst_resolved_add(&ctx, r, m.pose, &view, &light, 1.0, NULL));
    /* 16 parts for each of 96 sides: 1,536 corners of a circle of 100 px; 0.01 by the places of the
     * model's corners */
    double step = 2.0 * BST_PI / 1536.0;
    bst_assert_close(bst_resolved_image_of(r)->reached_px[1] / (100.0 * step * step / 12.0), 1.0,
                     0.01);
    bst_resolved_free(r);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_agrees_with_flux),
                                       cmocka_unit_test(test_perspective),
                                       cmocka_unit_test(test_light),
                                       cmocka_unit_test(test_second_moments),
                                       cmocka_unit_test(test_allowed_limb),
                                       cmocka_unit_test(test_reached_border)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
