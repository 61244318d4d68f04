/* What the detector gets from the host, on a sensor that is no square and whose rows are longer in
 * memory than on the sensor, without a device. */
#include "boresight/vec.h"
#include "scenegen/detector/cosmic_rays.h"
#include "scenegen/detector/fixed_pattern_noise.h"
#include "scenegen/detector/readout_charge.h"
#include "scenegen/detector/vignetting.h"
#include "scenegen/kernels/scene_shared.h"
#include "tests/test_support.h"

enum { WIDTH = 90, HEIGHT = 60, STRIDE = 128 };

static const bst_rng_key KEY = {{21, 22}};

/* Charge of a read-out: of the pixels that a row passes, clocks and the amplifier's glow. */
static void charge_is_gathered_on_the_way_to_the_output(void **state) {
    (void)state;
    static float map[STRIDE * HEIGHT], dark[STRIDE * HEIGHT];
    bst_ctx ctx = {0};
    for (int pass = 0; pass < 4; pass++) {
        bool top = pass % 2, even = pass < 2;
        bst_camera c = {
            .width_px = WIDTH,
            .height_px = HEIGHT,
            .dark_current_e_per_s = 7.0,
            .detector = {.readout_s = 3.0,
                         .clock_induced_e = 1.5,
                         .glow = {.peak_e = 80.0, .scale_px = 30.0, .x_px = -4.0, .y_px = 10.0},
                         .output = {.top = top}}};
        if (!even) {
            c.detector.dsnu_rms = 0.4;
            c.detector.overscan = (bst_detector_edges_config){6, 3, 2, 5};
        }
        const bst_detector_edges_config *o = &c.detector.overscan;
        bst_assert_ok(&ctx, bst_readout_charge_map(&ctx, &c, KEY, NULL, STRIDE, map));
        if (!even) {
            bst_assert_ok(&ctx, bst_fixed_pattern_noise_dark(&ctx, &c, KEY, NULL, STRIDE, dark));
        }
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                double want = 1.5;
                for (int passed = top ? y + 1 : 0; passed < (top ? HEIGHT : y); passed++) {
                    double rate =
                        even ? bst_camera_dark_e_per_s(&c) : (double)dark[passed * STRIDE + x];
                    want += rate * 3.0 / HEIGHT;
                }
                bool row = y >= o->bottom && y < HEIGHT - o->top;
                want += row ? 80.0 * exp(-hypot(x + 4.0, y - 10.0) / 30.0) : 0.0;
                bool column = x >= o->left && x < WIDTH - o->right;
                bst_assert_close(map[y * STRIDE + x], column ? want : 0.0, 2e-5 * want);
            }
        }
    }
}

/* Response of pixels: normal about 1, some of them dead, columns that are dead from a row on, edges
 * without light. */
static void response_of_pixels(void **state) {
    (void)state;
    static float gain[STRIDE * HEIGHT];
    bst_ctx ctx = {0};
    bst_camera c = {
        .width_px = WIDTH,
        .height_px = HEIGHT,
        .detector = {.prnu_rms = 0.03, .shielded = {4, 0, 1, 2}, .overscan = {0, 7, 0, 3}}};
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_gain(&ctx, &c, KEY, NULL, STRIDE, gain));
    double sum = 0.0, square = 0.0, beside = 0.0, n = 0.0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            double v = (double)gain[y * STRIDE + x];
            if (x < 4 || x >= WIDTH - 7 || y < 1 || y >= HEIGHT - 3) {
                assert_true(v == 0.0);
                continue;
            }
            sum += v - 1.0;
            square += (v - 1.0) * (v - 1.0);
            beside += x > 4 ? (v - 1.0) * ((double)gain[y * STRIDE + x - 1] - 1.0) : 0.0;
            n += 1.0;
        }
    }
    /* four standard deviations of 4400 normal deviates */
    bst_assert_close(sum / n, 0.0, 4.0 * 0.03 / sqrt(n));
    bst_assert_close(sqrt(square / n), 0.03, 4.0 * 0.03 / sqrt(2.0 * n));
    bst_assert_close(beside / n, 0.0, 4.0 * 9e-4 / sqrt(n));

    c.detector = (bst_detector_config){.dead_fraction = 0.2};
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_gain(&ctx, &c, KEY, NULL, STRIDE, gain));
    double dead = 0.0;
    for (int i = 0; i < STRIDE * HEIGHT; i++) {
        dead += i % STRIDE < WIDTH && gain[i] == 0.0f;
        assert_true(i % STRIDE >= WIDTH || gain[i] == 0.0f || gain[i] == 1.0f);
    }
    bst_assert_close(dead, 0.2 * WIDTH * HEIGHT, 4.0 * sqrt(0.16 * WIDTH * HEIGHT));

    c.detector = (bst_detector_config){.bad_columns = 5};
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_gain(&ctx, &c, KEY, NULL, STRIDE, gain));
    int columns = 0, began = 0;
    for (int x = 0; x < WIDTH; x++) {
        bool bad = false;
        for (int y = 0; y < HEIGHT; y++) {
            bool here = gain[y * STRIDE + x] == 0.0f;
            assert_true(here || !bad); /* to the last row */
            began += here && !bad ? y : 0;
            bad = here;
        }
        columns += bad;
    }
    assert_true(columns >= 3 && columns <= 5); /* two may be one */
    assert_true(began > 0);
}

/* Codes of a square-root law and their expansion: the law and the middle of equal ones. */
static void codes_of_a_square_root_law(void **state) {
    (void)state;
    static uint16_t codes[65536];
    bst_ctx ctx = {0};
    bst_camera c = {.bits = 12,
                    .detector.quantisation = {.model = BST_QUANTISE_SQUARE_ROOT, .bits = 7}};
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_codes(&ctx, &c, codes));
    for (int dn = 0; dn < 4096; dn++) {
        assert_int_equal(codes[dn], lround(127.0 * sqrt(dn / 4095.0)));
    }
    c.detector.quantisation.expand = true;
    bst_assert_ok(&ctx, bst_fixed_pattern_noise_codes(&ctx, &c, codes));
    for (int dn = 0; dn < 4096; dn += 7) {
        long code = lround(127.0 * sqrt(dn / 4095.0));
        int first = dn, last = dn;
        while (first > 0 && lround(127.0 * sqrt((first - 1) / 4095.0)) == code) {
            first--;
        }
        while (last < 4095 && lround(127.0 * sqrt((last + 1) / 4095.0)) == code) {
            last++;
        }
        assert_int_equal(codes[dn], (first + last) / 2);
    }
}

/* Parameters of the shading, by the light that they give at some places. */
static void shading_by_its_parameters(void **state) {
    (void)state;
    bst_camera c = {.width_px = 640,
                    .height_px = 400,
                    .pixel_scale_arcsec = 90.0,
                    .boresight_offset_px = {30.0, -50.0}};
    bst_optics_vignetting *v = &c.optics.vignetting;
    assert_int_equal(bst_vignetting_params(&c).law, BST_SHADE_NONE);
    static const double places[][2] = {{0.0, 0.0}, {600.0, 50.0}, {349.5, 149.5}, {20.0, 390.0}};
    for (int model = 0; model < 2; model++) {
        v->model = model ? BST_VIGNETTING_POLYNOMIAL : BST_VIGNETTING_COS4;
        const double a[3] = {-0.3, -0.15, 0.05};
        memcpy(v->coefficients, a, sizeof a);
        const bst_kernel_vignetting_params p = bst_vignetting_params(&c);
        assert_int_equal(p.law, model ? BST_SHADE_POLYNOMIAL : BST_SHADE_COS4);
        assert_true(p.limit2 > 1e29f);
        bst_assert_close(p.centre_x, 319.5 + 30.0, 1e-4);
        bst_assert_close(p.centre_y, 199.5 - 50.0, 1e-4);
        for (int i = 0; i < 4; i++) {
            double dx = places[i][0] - 349.5, dy = places[i][1] - 149.5, r2 = dx * dx + dy * dy;
            double tangent2 = r2 * pow(90.0 * BST_PI / 648000.0, 2.0);
            double u2 = r2 / (320.0 * 320.0 + 200.0 * 200.0); /* 1 at the corners */
            double want = model ? 1.0 + a[0] * u2 + a[1] * u2 * u2 + a[2] * u2 * u2 * u2
                                : pow(1.0 + tangent2, -2.0);
            double v1 = (double)p.v1 * r2, found;
            found = model ? 1.0 + v1 + (double)p.v2 * r2 * r2 + (double)p.v3 * r2 * r2 * r2
                          : 1.0 / ((1.0 + v1) * (1.0 + v1));
            bst_assert_close(found, want, 1e-5); /* single precision */
        }
    }
    v->model = BST_VIGNETTING_NONE;
    v->limit_px = 150.0;
    const bst_kernel_vignetting_params p = bst_vignetting_params(&c);
    assert_int_equal(p.law, BST_SHADE_POLYNOMIAL);
    bst_assert_close(p.limit2, 150.0 * 150.0, 1e-3);
    bst_assert_close(p.v1, 0.0, 0.0);
}

/* Tracks of charged particles: those of the same draws, cut into many short pieces. */
static void tracks_of_charge(void **state) {
    (void)state;
    enum { PIECES = 4000 };
    static double want[WIDTH * HEIGHT];
    bst_ctx ctx = {0};
    const bst_detector_cosmic_ray_config c = {.rate_per_cm2_s = 400.0,
                                              .e_per_um = 80.0,
                                              .depth_um = 12.0,
                                              .pixel_pitch_um = 9.0,
                                              .straggling = 0.2};
    const bst_detector_edges_config edges = {3, 5, 2, 4};
    bst_cosmic_rays *h;
    bst_assert_ok(&ctx, bst_cosmic_rays_create(&ctx, &c, WIDTH, HEIGHT, STRIDE, &h));
    bst_cosmic_rays_set_overscan(h, &edges);
    double reach = ceil(20.0 * 12.0 / 9.0), wide = WIDTH + 2.0 * reach, high = HEIGHT + 2.0 * reach;
    double arrival = 0.0, expected = 400.0 * 81e-8 * wide * high * 2.5, total = 0.0, most = 0.0;
    for (uint64_t i = 0; i < 10000; i++) {
        double u[6];
        for (uint64_t k = 0; k < 6; k++) {
            u[k] = k < 5 ? bst_rng_uniform(KEY, 9, 8 * i + k) : bst_rng_normal(KEY, 9, 8 * i + 5);
        }
        arrival -= log(u[0]);
        if (arrival > expected) {
            break;
        }
        /* flux falls on the surface: the cosine's density is 2 mu */
        double slant = acos(sqrt(u[1])), turn = 2.0 * BST_PI * u[2];
        double length_um = 12.0 / cos(slant), across = 12.0 * tan(slant) / 9.0;
        double e = 80.0 * length_um * fmax(1.0 - 0.2 * log(u[5] * u[5]), 0.0);
        for (int n = 0; n < PIECES; n++) {
            double t = (n + 0.5) / PIECES;
            int x = (int)floor(wide * u[3] - reach + t * across * cos(turn)),
                y = (int)floor(high * u[4] - reach + t * across * sin(turn));
            if (x >= 3 && x < WIDTH - 5 && y >= 2 && y < HEIGHT - 4) {
                want[y * WIDTH + x] += e / PIECES;
                total += e / PIECES;
                most = fmax(most, e);
            }
        }
    }
    assert_true(total > 0.0);
    const bst_cosmic_rays_pixel *pixels;
    bst_cosmic_rays_summary summary;
    bst_assert_ok(&ctx, bst_cosmic_rays_draw(&ctx, h, KEY, 9, 2.5, &pixels, &summary));
    bst_assert_close(summary.electrons, total, 1e-3 * total);
    for (int i = 0; i < summary.pixels; i++) {
        assert_true(i == 0 || pixels[i].index > pixels[i - 1].index);
        int x = pixels[i].index % STRIDE, y = pixels[i].index / STRIDE;
        assert_true(x < WIDTH && y < HEIGHT);
        /* a piece at either border of the pixel */
        bst_assert_close(pixels[i].electrons, want[y * WIDTH + x], 3.0 * most / PIECES);
        want[y * WIDTH + x] = 0.0;
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        bst_assert_close(want[i], 0.0, 3.0 * most / PIECES);
    }
    bst_cosmic_rays_free(h);
}

/* Maps are the same bits whichever thread draws their rows. */
static void threads_draw_the_same_maps(void **state) {
    (void)state;
    static float maps[2][2][STRIDE * HEIGHT];
    bst_ctx ctx = {0};
    bst_camera c = {.width_px = WIDTH,
                    .height_px = HEIGHT,
                    .dark_current_e_per_s = 7.0,
                    .detector = {.prnu_rms = 0.03,
                                 .dead_fraction = 0.01,
                                 .bad_columns = 2,
                                 .dsnu_rms = 0.4,
                                 .hot_fraction = 0.02,
                                 .hot_median_e_per_s = 90.0,
                                 .hot_spread_dex = 0.5,
                                 .readout_s = 3.0}};
    bst_parallel *pool;
    bst_assert_ok(&ctx, bst_parallel_create(&ctx, 3, &pool));
    for (int k = 0; k < 2; k++) {
        bst_parallel *own = k ? pool : NULL;
        bst_assert_ok(&ctx, bst_fixed_pattern_noise_gain(&ctx, &c, KEY, own, STRIDE, maps[k][0]));
        bst_assert_ok(&ctx, bst_readout_charge_map(&ctx, &c, KEY, own, STRIDE, maps[k][1]));
    }
    assert_memory_equal(maps[0], maps[1], sizeof maps[0]);
    bst_parallel_free(pool);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(charge_is_gathered_on_the_way_to_the_output),
        cmocka_unit_test(response_of_pixels),
        cmocka_unit_test(threads_draw_the_same_maps),
        cmocka_unit_test(codes_of_a_square_root_law),
        cmocka_unit_test(shading_by_its_parameters),
        cmocka_unit_test(tracks_of_charge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
