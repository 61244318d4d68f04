/* Which tracks of a frame are scored: those whose apparent place is on a rolled frame that is not
 * square, seen by an observer that moves, and those near objects. */
#include <erfa.h>
#include <stdlib.h>

#include "sim/astro/bodies.h"
#include "sim/eval/frame_scores.h"
#include "tests/test_support.h"

enum { WIDTH = 900, HEIGHT = 500 };

/* The geometric direction whose apparent place is a pixel: aberration as ERFA has it, inverted by
 * fixed-point steps. */
static bst_vec3 direction_of(const bst_scored_frame *frame, double x_px, double y_px) {
    bst_vec3 apparent = bst_quat_rotate(bst_quat_conj(frame->q_cam_from_gcrf),
                                        bst_camera_unproject(frame->camera, x_px, y_px));
    bst_vec3 v = bst_vec3_scale(frame->light.velocity_mps, 1.0 / BST_LIGHT_SPEED_MPS), d = apparent;
    double beta[3] = {v.x, v.y, v.z}, moved[3];
    for (int i = 0; i < 6; i++) {
        double natural[3] = {d.x, d.y, d.z};
        eraAb(natural, beta, bst_vec3_norm(frame->light.sun_m) / BST_AU_M,
              sqrt(1.0 - bst_vec3_dot(v, v)), moved);
        d = bst_vec3_unit(
            bst_vec3_add(d, bst_vec3_sub(apparent, (bst_vec3){moved[0], moved[1], moved[2]})));
    }
    return d;
}

/* Whether a track alone in a frame is scored. */
static bool is_scored(const bst_scored_frame *frame, bst_vec3 direction, bst_track_status status,
                      bst_track_hidden hidden) {
    bst_ctx ctx = {0};
    bst_frame_scores *s;
    bst_tracks *tracks = calloc(1, sizeof *tracks + sizeof *tracks->items);
    assert_non_null(tracks);
    tracks->count = 1;
    tracks->items[0] =
        (bst_track){.id = 3, .status = (int)status, .hidden = hidden, .direction_gcrf = direction};
    bst_track_figures f;
    bst_assert_ok(&ctx, bst_frame_scores_create(&ctx, 5, 30 * BST_ARCSEC_RAD, &s));
    bst_assert_ok(&ctx, bst_frame_scores_add(&ctx, s, frame, tracks));
    free(tracks);
    bst_frame_scores_figures(s, &f);
    bst_frame_scores_free(s);
    return f.tracks > 0;
}

static void tracks_on_the_frame_are_scored(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = WIDTH,
                         .height_px = HEIGHT,
                         .pixel_scale_arcsec = 3.0,
                         .psf_fwhm_px = 2.0,
                         .rotation_deg = 25.0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_scored_frame frame = {
        .camera = &camera,
        .q_cam_from_gcrf = bst_quat_look(bst_vec3_from_radec(1.3, 0.6), (bst_vec3){0.2, 0.5, 1}),
        .light = {.velocity_mps = {11e3, -24e3, 14e3}, .sun_m = {-1.0e11, -0.8e11, -0.7e11}}};
    /* each edge is half a pixel beyond the last middle; 16 arcsec of aberration are five pixels */
    for (int edge = 0; edge < 4; edge++) {
        for (int k = 0; k < 6; k++) {
            double along = (k + 0.5) / 6.0, off = k % 2 ? 0.1 : -0.1;
            double x = edge == 0 ? -0.5 - off : edge == 1 ? WIDTH - 0.5 + off : along * WIDTH;
            double y = edge == 2 ? -0.5 - off : edge == 3 ? HEIGHT - 0.5 + off : along * HEIGHT;
            bst_vec3 d = direction_of(&frame, x, y);
            assert_int_equal(is_scored(&frame, d, BST_TRACK_CONFIRMED, BST_HIDDEN_NOT), k % 2 == 0);
        }
    }
    bst_vec3 middle = direction_of(&frame, 300, 200);
    assert_true(is_scored(&frame, middle, BST_TRACK_COASTING, BST_HIDDEN_NOT));
    assert_false(is_scored(&frame, middle, BST_TRACK_TENTATIVE, BST_HIDDEN_NOT));
    assert_false(is_scored(&frame, middle, BST_TRACK_CONFIRMED, BST_HIDDEN_EARTH));
    /* an object that is too faint to count, within 30 arcseconds or not */
    bst_scored_object faint = {.number = 2, .direction = direction_of(&frame, 309, 204)};
    frame.objects = &faint;
    frame.count = 1;
    assert_false(is_scored(&frame, middle, BST_TRACK_CONFIRMED, BST_HIDDEN_NOT));
    faint.direction = direction_of(&frame, 309.5, 204.5); /* 31.7 arcsec */
    assert_true(is_scored(&frame, middle, BST_TRACK_CONFIRMED, BST_HIDDEN_NOT));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(tracks_on_the_frame_are_scored)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
