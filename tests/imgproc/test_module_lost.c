/* What the module makes of a frame whose attitude is unknown: the size of the field for which it
 * builds patterns, of frames that lie and stand, and what it hands to the solver. Linked with wraps
 * that keep it. */
#include <stdlib.h>

#include "imgproc/module_internal.h"
#include "tests/test_support.h"

static bst_ctx step_ctx;
static bst_star_patterns_options patterns;
static bst_lost_in_space_options options;
static bst_lost_in_space_frame solved;
static int built;
static double asked_snr;

bst_ctx *__wrap_bst_step_ctx(struct bst_step *step);
bst_ctx *__wrap_bst_step_ctx(struct bst_step *step) {
    (void)step;
    return &step_ctx;
}

void __wrap_bst_step_event(struct bst_step *step, const char *kind, const char *format, ...);
void __wrap_bst_step_event(struct bst_step *step, const char *kind, const char *format, ...) {
    (void)step;
    (void)format;
    fail_msg("event %s", kind);
}

double __wrap_bst_imgproc_v_limit(const bst_imgproc *ip, double snr);
double __wrap_bst_imgproc_v_limit(const bst_imgproc *ip, double snr) {
    (void)ip;
    asked_snr = snr;
    return 15.0 - snr;
}

bst_status __wrap_bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                           const bst_star_patterns_options *o,
                                           bst_star_patterns **out);
bst_status __wrap_bst_star_patterns_create(bst_ctx *ctx, const bst_stars *stars,
                                           const bst_star_patterns_options *o,
                                           bst_star_patterns **out) {
    (void)ctx;
    (void)stars;
    patterns = *o;
    built++;
    *out = NULL;
    return BST_OK;
}

bst_status __wrap_bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera,
                                           const bst_stars *stars, const bst_star_patterns *p,
                                           double julian_year, int max_detections,
                                           bst_lost_in_space **out);
bst_status __wrap_bst_lost_in_space_create(bst_ctx *ctx, const bst_camera *camera,
                                           const bst_stars *stars, const bst_star_patterns *p,
                                           double julian_year, int max_detections,
                                           bst_lost_in_space **out) {
    (void)ctx;
    (void)camera;
    (void)stars;
    (void)p;
    bst_assert_close(julian_year, 2031.25, 0.0);
    assert_int_equal(max_detections, 77);
    *out = (void *)&patterns; /* any but NULL */
    return BST_OK;
}

bst_status __wrap_bst_lost_in_space_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                                          const bst_lost_in_space_options *o,
                                          const bst_lost_in_space_frame *frame,
                                          bst_lost_in_space_result *out);
bst_status __wrap_bst_lost_in_space_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                                          const bst_lost_in_space_options *o,
                                          const bst_lost_in_space_frame *frame,
                                          bst_lost_in_space_result *out) {
    (void)ctx;
    (void)lost;
    options = *o;
    solved = *frame;
    *out = (bst_lost_in_space_result){.solved = false};
    return BST_OK;
}

static void fields_that_are_not_square(void **state) {
    (void)state;
    static const int sides[3][2] = {{900, 500}, {500, 900}, {640, 641}};
    for (int n = 0; n < 3; n++) {
        bst_ctx ctx = {0};
        const bst_imgproc_config config = {
            .attitude = 1, .capacity = 77, .lost_scale_tolerance = 0.03};
        bst_imgproc_state *m = calloc(1, sizeof *m);
        bst_detections *d = calloc(1, sizeof *d + sizeof d->items[0]);
        assert_true(m && d);
        m->config = &config;
        m->camera = (bst_camera){.width_px = sides[n][0],
                                 .height_px = sides[n][1],
                                 .pixel_scale_arcsec = 40.0,
                                 .aperture_m = 0.1};
        bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &m->camera));
        bst_imgproc_lost_open(m, NULL, 2031.25);
        const bst_frame_message message = {.window = {3, 5, 200, 100}, .binning = 1};
        const bst_imgproc_exposure e = {.message = &message};
        const bst_imgproc_lane lane = {.ip = NULL};
        bst_quat q = BST_QUAT_IDENTITY;
        d->count = 1;
        d->threshold_snr = n == 1 ? 9.5 : 5.0;
        built = 0;
        for (int frame = 1; frame <= 2; frame++) {
            bst_assert_ok(&step_ctx, bst_imgproc_lost_identify(m, NULL, &lane, &e, d, &q));
            assert_int_equal(built, 1); /* once for all frames */
            assert_int_equal(m->lost.frames_without_stars, frame);
        }
        /* gnomonic: the shorter side through the middle */
        const double half = 0.5 * fmin(sides[n][0], sides[n][1]) * 40.0 * BST_ARCSEC_RAD;
        bst_assert_close(patterns.field_rad, 2.0 * atan(half), 1e-12);
        bst_assert_close(asked_snr, n == 1 ? 9.5 : 8.0, 0.0);
        bst_assert_close(patterns.v_limit, 15.0 - asked_snr, 0.0);
        bst_assert_close(options.scale_tolerance, 0.03, 0.0);
        assert_true(solved.items == d->items && solved.count == 1 && solved.light == &e.light);
        assert_int_equal(solved.window.y0, 5);
        assert_true(m->lost.lost && !m->lost.known);
        free(d);
        free(m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(fields_that_are_not_square)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
