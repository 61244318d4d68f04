/* The renderer's vignetting against the reference image's. */
#include "scenegen/reference.h"
#include "scenegen/renderer.h"
#include "tests/scenegen/scene_support.h"
#include "tests/test_support.h"

enum { W = 200, H = 150, STARS = 150 };

static void renderer_and_reference_agree(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    const bst_optics_vignetting cases[] = {
        {.model = BST_VIGNETTING_POLYNOMIAL, .coefficients = {-0.5, 0.3, -0.1}},
        {.model = BST_VIGNETTING_COS4, .limit_px = 90.0},
        {.limit_px = 60.0},
    };
    for (int n = 0; n < 4; n++) {
        bst_camera camera = scene_camera(W, H);
        camera.pixel_scale_arcsec = 600.0; /* 16 degrees from the boresight to the corner's pixel */
        camera.boresight_offset_px[0] = 11.0;
        camera.optics.vignetting = cases[n % 3];
        camera.optics.psf = n == 3 ? BST_PSF_MOFFAT : BST_PSF_GAUSSIAN;
        const scene_motion motion = {.x_px = 12.0, .y_px = 5.0, .duration_s = 1.0, .samples = 2};
        scene_track track = scene_track_make(&camera, &motion);
        bst_scene_source *stars = scene_stars(&camera, STARS, 30000.0, 4.0, 5);
        bst_window window = {20, 10, 170, 130};
        static float fast[W * H];
        static double slow[W * H];
        memset(slow, 0, sizeof slow);
        bst_renderer *renderer;
        bst_assert_ok(&ctx, bst_renderer_create(&ctx, device, &camera, NULL, &renderer));
        bst_render_request request = {.window = window,
                                      .track = &track.track,
                                      .sources = stars,
                                      .count = STARS,
                                      .background_e = 20.0};
        bst_assert_ok(&ctx, bst_renderer_render_noise_free(&ctx, renderer, &request, fast));
        bst_assert_ok(&ctx, bst_reference_render(&ctx, &camera, window, &track.track, stars, STARS,
                                                 1e-9, slow));
        double worst = 0.0, most = 0.0, least = 1e9;
        for (int p = 0; p < window.width * window.height; p++) {
            double sigma = sqrt(slow[p] + 20.0 + 64.0);
            worst = fmax(worst, fabs((double)fast[p] - 20.0 - slow[p]) / sigma);
            most = fmax(most, slow[p]);
            least = fmin(least, slow[p]);
        }
        /* the renderer's own aim is 0.02 per source; crowded pixels hold several */
        assert_true(worst < 0.05);
        assert_true(most > 200.0);
        assert_true(n == 0 || n == 3 || least == 0.0); /* nothing beyond the limit */
        bst_renderer_free(renderer);
        scene_track_free(&track);
        free(stars);
    }
    bst_device_close(device);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(renderer_and_reference_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
