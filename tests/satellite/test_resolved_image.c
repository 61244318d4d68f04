/* Images of shapes against closed forms, and against the flux of the same model. */
#include "sim/satellite/polygon_coverage.h"
#include "sim/satellite/resolved_image.h"
#include "tests/satellite/satellite_support.h"

/* A view along -direction (body frame) from a range, with x of the image along `right`. */
static bst_resolved_view look_from(bst_vec3 direction, bst_vec3 right, double range_m,
                                   double scale_rad) {
    bst_quat q = bst_quat_look(bst_vec3_scale(direction, -1.0), right);
    return (bst_resolved_view){q, {0, 0, range_m}, scale_rad};
}

/* Light, centroid (px) and cover (px^2) of an image. */
typedef struct sums {
    double light, x, y, cover;
} sums;

static sums sum_of(const bst_resolved_image *m) {
    sums s = {0};
    for (int j = 0; j < m->height; j++) {
        for (int i = 0; i < m->width; i++) {
            const bst_resolved_cell *c = &m->cells[j * m->width + i];
            s.light += (double)c->light;
            s.x += m->cell_px * ((double)c->light * (m->x0 + i + 0.5) + (double)c->moment_x);
            s.y += m->cell_px * ((double)c->light * (m->y0 + j + 0.5) + (double)c->moment_y);
            s.cover += (double)c->cover * m->cell_px * m->cell_px;
        }
    }
    s.x /= s.light;
    s.y /= s.light;
    return s;
}

/* Renders one pose with unit gains for sunlight. */
static sums render(bst_test_model *m, const bst_resolved_view *view, bst_vec3 sun, double cell_px,
                   const char *dump) {
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
    assert_float_equal(s.light / total, 1.0, 1e-5);
    if (dump) {
        FILE *f = fopen(dump, "wb");
        fprintf(f, "%d %d\n", image->width, image->height);
        fwrite(image->cells, sizeof *image->cells, (size_t)(image->width * image->height), f);
        fclose(f);
    }
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

/* From far the light is that of bst_satellite_flux_at, with all shadows. */
static void test_agrees_with_flux(void **state) {
    (void)state;
    const char *const texts[] = {box, sphere, bus, flat};
    uint64_t seed = 5;
    for (int t = 0; t < 4; t++) {
        bst_test_model m = bst_test_model_open(texts[t]);
        for (int n = 0; n < 6; n++) {
            bst_vec3 sun = bst_test_direction(&seed), eye = bst_test_direction(&seed);
            double flux = bst_test_flux(&m, sun, eye), range_m = 1e7;
            bst_resolved_view view =
                look_from(eye, (bst_vec3){0.3, 0.8, 0.4}, range_m, 0.05 / range_m);
            char name[64];
            snprintf(name, sizeof name, "/tmp/resolved_%d_%d.bin", t, n);
            sums s = render(&m, &view, sun, 0.25, name);
            printf("%d %d: flux %.6f image %.6f ratio-1 %.2e cover %.4f\n", t, n, flux,
                   s.light * range_m * range_m, s.light * range_m * range_m / flux - 1.0,
                   s.cover * 0.0025);
        }
        bst_test_model_close(&m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_agrees_with_flux)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
