/* The scene of `boresight pd` as it is opened: noise, grid of cells, brightness of the points and
 * shape of targets, against sums over pixels. Linked with wraps of device and renderer. */
#include "boresight/vec.h"
#include "sim/analysis/pd/pd.h"
#include "sim/app/app.h"
#include "tests/test_support.h"

bst_status __wrap_bst_device_open(bst_ctx *ctx, const char *name, int threads, bst_device **out);
bst_status __wrap_bst_device_open(bst_ctx *ctx, const char *name, int threads, bst_device **out) {
    (void)ctx;
    (void)name;
    (void)threads;
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                                      const bst_renderer_options *options, bst_renderer **out);
bst_status __wrap_bst_renderer_create(bst_ctx *ctx, bst_device *device, const bst_camera *camera,
                                      const bst_renderer_options *options, bst_renderer **out) {
    (void)ctx;
    (void)device;
    (void)camera;
    (void)options;
    *out = NULL;
    return BST_OK;
}

/* Sums of squares and cubes of the pixels of a Gaussian along (dx, dy). */
static void powers_of(double x, double y, double dx, double dy, double sigma, double out[2]) {
    enum { PARTS = 80, HALF = 22 };
    double root = sigma * sqrt(2.0);
    int parts = dx == 0.0 && dy == 0.0 ? 1 : PARTS;
    static double column[PARTS][2 * HALF + 1], row[PARTS][2 * HALF + 1];
    for (int n = 0; n < parts; n++) {
        double t = (n + 0.5) / parts - 0.5;
        for (int i = -HALF; i <= HALF; i++) {
            double u = i - x - t * dx, v = i - y - t * dy;
            column[n][i + HALF] = 0.5 * (erf((u + 0.5) / root) - erf((u - 0.5) / root));
            row[n][i + HALF] = 0.5 * (erf((v + 0.5) / root) - erf((v - 0.5) / root)) / parts;
        }
    }
    out[0] = out[1] = 0.0;
    for (int k = 0; k < (2 * HALF + 1) * (2 * HALF + 1); k++) {
        double light = 0.0;
        for (int n = 0; n < parts; n++) {
            light += column[n][k % (2 * HALF + 1)] * row[n][k / (2 * HALF + 1)];
        }
        out[0] += light * light;
        out[1] += light * light * light;
    }
}

/* The same, mean over four places in the pixel; of the cube over the square's power 3/2. */
static void means_of(double dx, double dy, double sigma, double *square, double *own) {
    *square = *own = 0.0;
    for (int p = 0; p < 4; p++) {
        double powers[2];
        powers_of(0.125 + 0.5 * (p % 2), 0.125 + 0.5 * (p / 2), dx, dy, sigma, powers);
        *square += 0.25 * powers[0];
        *own += 0.25 * powers[1] / pow(powers[0], 1.5);
    }
}

typedef struct opened {
    bst_json *json;
    bst_scenario scenario;
    bst_pd_scene scene;
} opened;

static bst_status open_with(opened *o, const bst_pd_options *options, bst_ctx *ctx) {
    static const char *const sets[] = {"/world/star_catalogue=embedded",
                                       "/observers/0/sensors/0/camera/width_px=700",
                                       "/observers/0/sensors/0/camera/height_px=400",
                                       "/observers/0/sensors/0/camera/psf_fwhm_px=1", /* narrow */
                                       "/observers/0/sensors/0/exposure/exposure_s=0.4",
                                       "/observers/0/sensors/0/camera/detector/em_gain=20"};
    BST_TRY(bst_json_load(ctx, "scenarios/neossat_geo_track.json", &o->json));
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        BST_TRY(bst_json_set(ctx, o->json, sets[i]));
    }
    BST_TRY(bst_scenario_read(ctx, o->json, bst_registry_shipped(), &o->scenario));
    return bst_pd_scene_open(ctx, &o->scenario, options, &o->scene);
}

static void close_opened(opened *o) {
    bst_pd_scene_close(&o->scene);
    bst_scenario_free(&o->scenario);
    bst_json_free(o->json);
}

static void points_by_snr(void **state) {
    (void)state;
    static const double lengths[] = {0.0, 13.0};
    for (int n = 0; n < 2; n++) {
        bst_ctx ctx = {0};
        opened o = {0};
        const bst_pd_options options = {.low = 3.0,
                                        .high = 9.0,
                                        .step = 1.5,
                                        .trials = 100,
                                        .streak_px = lengths[n],
                                        .background_e = n ? 70.0 : -1.0,
                                        .min_separation_px = 40.0};
        bst_assert_ok(&ctx, open_with(&o, &options, &ctx));
        const bst_pd_scene *s = &o.scene;
        const bst_camera *c = &s->camera;
        double sky = n ? 70.0 : 0.4 * bst_camera_background_e_per_s(c);
        double dark = bst_camera_dark_e(c, 0.4);
        /* a register of gain 20 doubles the variance of charge, less a twentieth */
        double noise = sqrt(1.95 * (sky + dark) + c->read_noise_e * c->read_noise_e);
        bst_assert_close(s->sky_e, sky, 1e-12);
        bst_assert_close(s->dark_e, dark, 1e-12);
        bst_assert_close(s->noise_e, noise, 1e-9);
        bst_assert_close(s->sigma_px, bst_camera_psf_sigma_px(c), 1e-9);
        bst_assert_close(s->min_separation_px, 40.0 + lengths[n], 1e-12);
        bst_assert_close(s->cell_px, 80.0 + lengths[n], 1e-12);
        assert_int_equal(s->columns, n ? 7 : 8);
        assert_int_equal(s->rows, n ? 4 : 5);
        assert_int_equal(bst_pd_scene_room(s), n ? 28 : 40);
        double square, own, powers[2];
        means_of(0.8 * lengths[n], 0.6 * lengths[n], s->sigma_px, &square, &own);
        bst_assert_close(s->own_light, own / noise, 2e-4 * own / noise); /* parts of the path */
        powers_of(0.25, 0.25, 0.6 * lengths[n], 0.8 * lengths[n], s->sigma_px, powers);
        if (n) { /* from a table over places and angles */
            means_of(0.6 * lengths[n], 0.8 * lengths[n], s->sigma_px, powers, &own);
            for (int a = 0; a <= 90; a += 18) {
                double angle = a * BST_PI / 180.0;
                means_of(lengths[n] * cos(angle), lengths[n] * sin(angle), s->sigma_px, &square,
                         &own);
                bst_assert_close(s->sharpness[a / 2], square, 2e-4 * square);
            }
        } else {
            assert_null(s->sharpness);
        }
        assert_int_equal(s->points, 5);
        for (int i = 0; i < 5; i++) {
            double snr = 3.0 + 1.5 * i, flux = snr * noise / sqrt(powers[0]);
            bst_assert_close(s->snr[i], snr, 1e-12);
            bst_assert_close(s->flux_e[i], flux, 3e-4 * flux);
            bst_assert_close(bst_camera_electrons_per_s(c, s->v_mag[i]) * 0.4, s->flux_e[i],
                             1e-6 * flux);
        }
        close_opened(&o);
    }
}

static void points_by_magnitude(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    opened o = {0};
    const bst_pd_options options = {.low = 11.0,
                                    .high = 13.0,
                                    .step = 1.0,
                                    .by_magnitude = true,
                                    .trials = 100,
                                    .jitter_px = 0.7,
                                    .background_e = -1.0,
                                    .stack = 4,
                                    .rates_px = 2.5,
                                    .cell_px = 90.0,
                                    .min_separation_px = 30.0};
    bst_assert_ok(&ctx, open_with(&o, &options, &ctx));
    const bst_pd_scene *s = &o.scene;
    bst_assert_close(s->min_separation_px, 30.0 + 3.0 * 2.5, 1e-12);
    assert_int_equal(s->columns, 7);
    assert_int_equal(s->rows, 4);
    const bst_camera *plain = bst_world_camera(s->world, s->observer, s->sensor);
    bst_assert_close(s->sigma_px, hypot(bst_camera_psf_sigma_px(plain), 0.7), 1e-6);
    double powers[2];
    powers_of(0.25, 0.25, 0.0, 0.0, s->sigma_px, powers);
    for (int i = 0; i < 3; i++) {
        double flux = 0.4 * bst_camera_electrons_per_s(&s->camera, 11.0 + i);
        bst_assert_close(s->v_mag[i], 11.0 + i, 0.0);
        bst_assert_close(s->flux_e[i], flux, 1e-9 * flux);
        bst_assert_close(s->snr[i], flux * sqrt(powers[0]) / s->noise_e, 1e-4 * s->snr[i]);
    }
    close_opened(&o);
    const bst_pd_options tight = {.low = 3.0,
                                  .high = 4.0,
                                  .step = 1.0,
                                  .background_e = -1.0,
                                  .cell_px = 31.0,
                                  .min_separation_px = 30.0};
    o = (opened){0};
    assert_int_equal(open_with(&o, &tight, &ctx), BST_ERR_ARGUMENT);
    assert_non_null(strstr(ctx.message, "--cell 31: at least 32 px"));
    close_opened(&o);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_by_snr),
        cmocka_unit_test(points_by_magnitude),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
