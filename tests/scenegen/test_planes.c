/* Noise-free planes and the mask of sources, with a renderer of Gaussians in the place of the real
 * one: a window off the corner, binned or not, under a sky that differs between pixels. */
#include "scenegen/planes.h"

#include "boresight/vec.h"
#include "sim/world/scene/field.h"
#include "sim/world/scene/skylight.h"
#include "tests/test_support.h"

enum { SENSOR_X = 220, SENSOR_Y = 150, SOURCES = 7, STARS = 4 };
#define SIGMA 1.3

static bst_camera camera;
static struct { double x, y, light; } places[SOURCES];
static int rendered;

/* Part of a source's light in a pixel of the sensor. */
static double share_of(int source, int x, int y) {
    double root = SIGMA * sqrt(2.0), u = x - places[source].x, v = y - places[source].y;
    return 0.25 * (erf((u + 0.5) / root) - erf((u - 0.5) / root)) *
           (erf((v + 0.5) / root) - erf((v - 0.5) / root));
}

bst_status __wrap_bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *renderer,
                                                 const bst_render_request *q, float *image);
bst_status __wrap_bst_renderer_render_noise_free(bst_ctx *ctx, bst_renderer *renderer,
                                                 const bst_render_request *q, float *image) {
    (void)ctx;
    (void)renderer;
    rendered++;
    for (int j = 0; j < q->window.height; j++) {
        for (int i = 0; i < q->window.width; i++) {
            int x = q->window.x0 + i, y = q->window.y0 + j;
            double e =
                q->background_e + (q->background ? bst_skylight_at(q->background, x, y) : 0.0);
            for (int s = 0; s < q->count; s++) {
                int source = (int)q->sources[s].id;
                e += places[source].light * share_of(source, x, y);
            }
            image[j * q->window.width + i] = (float)e;
        }
    }
    return BST_OK;
}

double __wrap_bst_renderer_peak_e(const bst_renderer *renderer, int index);
double __wrap_bst_renderer_peak_e(const bst_renderer *renderer, int index) {
    (void)renderer;
    double x = places[index].x, y = places[index].y;
    return places[index].light * share_of(index, (int)lround(x), (int)lround(y));
}

bst_status __wrap_bst_renderer_flags(bst_ctx *ctx, bst_renderer *renderer, size_t pixels,
                                     uint8_t *out);
bst_status __wrap_bst_renderer_flags(bst_ctx *ctx, bst_renderer *renderer, size_t pixels,
                                     uint8_t *out) {
    (void)ctx;
    (void)renderer;
    memset(out, 2, pixels);
    return BST_OK;
}

static void check(int binning, bool uneven, double threshold) {
    static const double at[SOURCES][3] = {
        {60.3, 40.8, 9000},  {63.9, 43.1, 3000}, {150.2, 95.7, 40000}, {36.4, 100.2, 2000},
        {90.5, 60.25, 1500}, {151.4, 40.1, 35},  {100.0, 118.6, 60000}};
    bst_ctx ctx = {0};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    double time_s[2] = {0.0, 1.0};
    const bst_los_track track = {2, time_s, q};
    float sky[4 * 3];
    for (int i = 0; i < 12; i++) {
        sky[i] = (float)(5.0 + 30.0 * (i % 4) + 4.0 * (i / 4));
    }
    const bst_skylight_map map = {
        .step_px = 70, .x0_px = 0, .y0_px = 0, .columns = 4, .rows = 3, .e = sky, .least_e = 5.0};
    camera = (bst_camera){.width_px = SENSOR_X,
                          .height_px = SENSOR_Y,
                          .pixel_scale_arcsec = 5.0,
                          .psf_fwhm_px = 2.3548200450309493 * SIGMA,
                          .read_noise_e = 6.0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_scene_source sources[SOURCES];
    int item_source[SOURCES] = {2, 0, 1, 3, 4, 5, 6}; /* of the truth */
    for (int i = 0; i < SOURCES; i++) {
        places[i].x = at[i][0];
        places[i].y = at[i][1];
        places[i].light = at[i][2];
        sources[i] =
            (bst_scene_source){.kind = i < STARS ? BST_SOURCE_STAR : BST_SOURCE_OBJECT,
                               .id = (uint32_t)i,
                               .apparent_mid = bst_camera_unproject(&camera, at[i][0], at[i][1])};
    }
    const bst_render_request request = {.window = {30, 20, 150, 101},
                                        .track = &track,
                                        .sources = sources,
                                        .count = SOURCES,
                                        .background_e = 12.0,
                                        .background = uneven ? &map : NULL,
                                        .binning = binning,
                                        .exposure_id = 9};
    bst_plane_maker *m;
    bst_planes p;
    uint32_t all = 1u << BST_PLANE_STARS | 1u << BST_PLANE_TARGETS | 1u << BST_PLANE_BACKGROUND |
                   1u << BST_PLANE_SEGMENTATION | 1u << BST_PLANE_SATURATION;
    bst_assert_ok(&ctx, bst_plane_maker_create(&ctx, all, SENSOR_X, SENSOR_Y, threshold, &m));
    bst_assert_ok(&ctx, bst_plane_maker_render(&ctx, m, (bst_renderer *)&camera, &camera, &request,
                                               item_source, SOURCES, &p));
    assert_int_equal(p.exposure_id, 9);
    assert_int_equal(p.width, 150 / binning);
    assert_int_equal(p.height, 101 / binning);
    assert_null(p.parts);
    bool seen[SOURCES + 1] = {false};
    for (int j = 0; j < p.height; j++) {
        for (int i = 0; i < p.width; i++) {
            double light[SOURCES] = {0.0}, background = 0.0, stars = 0.0, targets = 0.0;
            for (int k = 0; k < binning * binning; k++) {
                int x = 30 + i * binning + k % binning, y = 20 + j * binning + k / binning;
                background += 12.0 + (uneven ? bst_skylight_at(&map, x, y) : 0.0);
                for (int s = 0; s < SOURCES; s++) {
                    light[s] += places[s].light * share_of(s, x, y);
                }
            }
            int best = 0, owner = 0;
            for (int n = 0; n < SOURCES; n++) {
                int s = item_source[n];
                *(s < STARS ? &stars : &targets) += light[s];
                best = light[s] > light[item_source[best]] ? n : best;
            }
            double limit =
                threshold * sqrt((uneven ? background : binning * binning * 12.0) + 36.0);
            owner = light[item_source[best]] > limit ? best + 1 : 0;
            int k = j * p.width + i;
            bst_assert_close(p.electrons[BST_PLANE_BACKGROUND][k], background, 1e-4 * background);
            bst_assert_close(p.electrons[BST_PLANE_STARS][k], stars, 0.01); /* floats of 1e4 */
            bst_assert_close(p.electrons[BST_PLANE_TARGETS][k], targets, 0.01);
            assert_int_equal(p.saturation[k], 2);
            bool near = fabs(light[item_source[best]] - limit) < 0.02; /* floats */
            if (!near && p.segmentation[k] != owner) {
                fail_msg("pixel %d, %d is of %d, not of %d", i, j, p.segmentation[k], owner);
            }
            seen[p.segmentation[k]] = true;
        }
    }
    /* the faint one is nowhere above the threshold */
    for (int n = 0; n < SOURCES; n++) {
        assert_int_equal(seen[n + 1], item_source[n] != 5);
    }
    bst_plane_maker_free(m);
}

static void planes_and_mask_of_gaussians(void **state) {
    (void)state;
    rendered = 0;
    check(1, false, 3.0);
    check(1, true, 3.0);
    check(2, false, 2.5);
    check(3, true, 2.0);
    /* sources beside each other are drawn one by one, those apart together */
    assert_true(rendered < 4 * (3 + SOURCES));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(planes_and_mask_of_gaussians)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
