/* What the wings of a bright star pretend to be, and what they leave alone. */
#include "imgproc/detect/psf_wings.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/wing_labels.h"
#include "sim/optics/psf_image.h"
#include "tests/test_support.h"

enum { MOST = 16 };

static const double NOISE_E = 9.0, STAR_E = 1e7, STAR_PX = 500.0;

typedef struct fixture {
    bst_psf *psf;
    bst_psf_wings *wings;
    double image[(2 * BST_WINGS_REACH_PX + 1) * (2 * BST_WINGS_REACH_PX + 1)];
    double area_px2;
    bst_detections *found;
} fixture;

/* Vanes along the axes. */
static int setup(void **state) {
    bst_ctx ctx = {0};
    fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    bst_camera camera = {.width_px = 1000,
                         .height_px = 1000,
                         .pixel_scale_arcsec = 3.0,
                         .aperture_m = 0.15,
                         .psf_fwhm_px = 2.0,
                         .optics = {.psf = BST_PSF_DIFFRACTION,
                                    .q = 1.6,
                                    .band_nm = {450.0, 850.0},
                                    .wavelengths = 8,
                                    .central_obstruction = 0.35,
                                    .spiders = {.count = 4, .width_m = 0.003}}};
    bst_assert_ok(&ctx, bst_psf_create(&ctx, &camera, &f->psf));
    bst_assert_ok(&ctx, bst_psf_wings_create(&ctx, f->psf, 1000.0, 1000.0, 0.0, &f->wings));
    bst_assert_ok(&ctx, bst_psf_image(&ctx, f->psf, 0, 0.0, 1, BST_WINGS_REACH_PX, f->image));
    double square = 0.0;
    for (size_t i = 0; i < sizeof f->image / sizeof f->image[0]; i++) {
        square += f->image[i] * f->image[i];
    }
    f->area_px2 = 1.0 / square;
    f->found = calloc(1, sizeof *f->found + MOST * sizeof f->found->items[0]);
    assert_non_null(f->found);
    f->found->noise_e = NOISE_E;
    f->found->background_e = 3.0;
    f->found->threshold_snr = 5.0;
    *state = f;
    return 0;
}

static int teardown(void **state) {
    fixture *f = *state;
    bst_psf_wings_free(f->wings);
    bst_psf_free(f->psf);
    free(f->found);
    free(f);
    return 0;
}

static double light(const fixture *f, int dx, int dy) {
    int side = 2 * BST_WINGS_REACH_PX + 1;
    return STAR_E * f->image[(dy + BST_WINGS_REACH_PX) * side + dx + BST_WINGS_REACH_PX];
}

static void add(fixture *f, double dx, double dy, double flux_e) {
    double snr = flux_e / (NOISE_E * sqrt(f->area_px2));
    f->found->items[f->found->count++] =
        (bst_detection){.x_px = STAR_PX + dx, .y_px = STAR_PX + dy, .flux_e = flux_e, .snr = snr};
}

static void even_ground(const void *user, double x_px, double y_px, bst_psf_wings_ground *out) {
    (void)x_px;
    (void)y_px;
    *out = (bst_psf_wings_ground){*(const double *)user, NOISE_E};
}

static void spikes_are_artefacts_and_targets_beside_them_are_not(void **state) {
    fixture *f = *state;
    double level_e = 3.0;
    f->found->count = 0;
    bst_psf_wings_begin(f->wings, 0.0, 0.0);
    bst_psf_wings_add(f->wings, STAR_PX, STAR_PX, STAR_E);
    /* what a matched filter makes of a spike: the light of its area */
    for (int k = 0; k < 4; k++) {
        int along = 30 + 30 * k;
        add(f, along, 0.0, f->area_px2 * light(f, along, 0));
        assert_true(f->found->items[k].snr > 5.0);
    }
    /* a target that outshines its piece of spike, and faint ones off the spikes */
    add(f, 90.0, 0.0, 4.0 * f->area_px2 * light(f, 90, 0) + 60.0 * NOISE_E);
    add(f, 60.0, 60.0, 8.0 * NOISE_E * sqrt(f->area_px2));
    add(f, -70.0, 120.0, 6.0 * NOISE_E * sqrt(f->area_px2));
    add(f, 300.0, 0.0, 6.0 * NOISE_E * sqrt(f->area_px2));
    /* the star itself, with a stated flux below the true one, and a piece of its core */
    add(f, 0.4, 0.2, 0.4 * STAR_E);
    add(f, 7.0, 2.0, 0.003 * STAR_E);
    /* what was labelled before stays */
    add(f, 60.0, 0.0, f->area_px2 * light(f, 60, 0));
    f->found->items[10].label = BST_LABEL_STAR;
    bst_psf_wings_label(f->wings, even_ground, &level_e, 1, f->found);
    const int want[11] = {1, 1, 1, 1, 0, 0, 0, 0, 0, 1, 0};
    for (int i = 0; i < f->found->count; i++) {
        if ((f->found->items[i].label == BST_LABEL_ARTEFACT) != want[i]) {
            fail_msg("detection %d of SNR %g at (%g, %g) from the star: label %d", i,
                     f->found->items[i].snr, f->found->items[i].x_px - STAR_PX,
                     f->found->items[i].y_px - STAR_PX, (int)f->found->items[i].label);
        }
    }
}

/* Light that the background holds cannot be a source: beside the core, where wings are smooth. */
static void what_the_background_holds_is_no_wing(void **state) {
    fixture *f = *state;
    double level_e = 3.0, held_e = 3.0 + light(f, 20, 20);
    double flux_e = 1.2 * f->area_px2 * light(f, 20, 20) + 8.0 * NOISE_E * sqrt(f->area_px2);
    bst_psf_wings_begin(f->wings, 0.0, 0.0);
    bst_psf_wings_add(f->wings, STAR_PX, STAR_PX, STAR_E);
    for (int held = 0; held < 2; held++) {
        f->found->count = 0;
        add(f, 20.0, 20.0, flux_e);
        bst_psf_wings_label(f->wings, even_ground, held ? &held_e : &level_e, 1, f->found);
        bool artefact = f->found->items[0].label == BST_LABEL_ARTEFACT;
        assert_int_equal(artefact, !held);
    }
}

/* While the camera follows something else a spike along the motion keeps its light, one across it
 * is spread over the path. */
static void spikes_move_with_their_star(void **state) {
    fixture *f = *state;
    double level_e = 3.0;
    bst_psf_wings_begin(f->wings, 0.0, 40.0);
    bst_psf_wings_add(f->wings, STAR_PX, STAR_PX, STAR_E);
    f->found->count = 0;
    double snr_spread = f->area_px2 * light(f, 60, 0) / 40.0;
    add(f, 60.0, 15.0, snr_spread + 4.0 * NOISE_E * sqrt(f->area_px2));
    add(f, 60.0, 60.0, 8.0 * NOISE_E * sqrt(f->area_px2));
    bst_psf_wings_label(f->wings, even_ground, &level_e, 1, f->found);
    assert_int_equal(f->found->items[0].label, BST_LABEL_ARTEFACT);
    assert_int_equal(f->found->items[1].label, BST_LABEL_UNKNOWN);
    assert_true(bst_psf_wings_holds(f->wings, STAR_PX + 3.0, STAR_PX, 4.0));
    assert_false(bst_psf_wings_holds(f->wings, STAR_PX + 5.0, STAR_PX, 4.0));
}

static void faint_stars_have_no_wings(void **state) {
    fixture *f = *state;
    double bright_e = bst_psf_wings_bright_e(f->wings, NOISE_E, 5.0);
    /* a star whose rings reach the noise is one of many thousand electrons, far below STAR_E */
    assert_true(bright_e > 5e3 && bright_e < 1e6);
    double level_e = 3.0;
    bst_psf_wings_begin(f->wings, 0.0, 0.0);
    bst_psf_wings_add(f->wings, STAR_PX, STAR_PX, 0.3 * bright_e);
    f->found->count = 0;
    for (int k = 0; k < 8; k++) {
        add(f, 9.0 + k, 3.0 * k, 5.5 * NOISE_E * sqrt(f->area_px2));
    }
    bst_psf_wings_label(f->wings, even_ground, &level_e, 1, f->found);
    for (int k = 0; k < 8; k++) {
        assert_int_equal(f->found->items[k].label, BST_LABEL_UNKNOWN);
    }
}

static void places_are_near_by_both_axes(void **state) {
    fixture *f = *state;
    bst_psf_wings_begin(f->wings, 0.0, 0.0);
    bst_psf_wings_add(f->wings, 300.0, 700.0, STAR_E);
    bst_psf_wings_add(f->wings, 40.0, 90.0, STAR_E);
    assert_true(bst_psf_wings_holds(f->wings, 303.0, 704.0, 5.0)); /* exactly 5 px */
    assert_false(bst_psf_wings_holds(f->wings, 303.0, 704.0, 4.9));
    assert_true(bst_psf_wings_holds(f->wings, 300.0, 696.0, 4.5));
    assert_false(bst_psf_wings_holds(f->wings, 300.0, 690.0, 4.5));
    assert_false(bst_psf_wings_holds(f->wings, 300.0, 300.0, 4.5));
    assert_true(bst_psf_wings_holds(f->wings, 41.0, 91.0, 1.5));
}

/* Light that is a tenth of a detection's does not matter, four times that of binned pixels does. */
static void binned_pixels_hold_more_light(void **state) {
    fixture *f = *state;
    double level_e = 3.0, noise_e = NOISE_E * sqrt(f->area_px2);
    double share = light(f, 0, 40) / STAR_E;
    for (int binning = 1; binning <= 2; binning++) {
        bst_psf_wings_begin(f->wings, 0.0, 0.0);
        bst_psf_wings_add(f->wings, STAR_PX, STAR_PX, noise_e / f->area_px2 / share);
        f->found->count = 0;
        add(f, 0.0, 40.0, 10.0 * noise_e);
        bst_psf_wings_label(f->wings, even_ground, &level_e, binning, f->found);
        assert_int_equal(f->found->items[0].label,
                         binning == 1 ? BST_LABEL_UNKNOWN : BST_LABEL_ARTEFACT);
    }
    bst_assert_close(f->found->items[0].label_probability, 0.9, 1e-12);
}

/* Light of a star's wings within a pixel of a place. */
static double brightest(const fixture *f, double flux_e, double dx, double dy) {
    double most = 0.0;
    for (int v = -1; v <= 1; v++) {
        for (int u = -1; u <= 1; u++) {
            most = fmax(most, light(f, (int)lround(dx) + u, (int)lround(dy) + v));
        }
    }
    return flux_e / STAR_E * most;
}

/* The flux up to which a detection of this area and place is an artefact, by bisection. */
static double limit_e(fixture *f, double x, double y, double area, int binning,
                      bst_psf_wings_ground here, bst_psf_wings_ground_fn ground) {
    double low = 1.0, high = 1e7;
    while (high / low > 1.0 + 1e-9) {
        double flux = sqrt(low * high);
        f->found->count = 1;
        f->found->items[0] = (bst_detection){
            .x_px = x, .y_px = y, .flux_e = flux, .snr = flux / (here.noise_e * sqrt(area))};
        bst_psf_wings_label(f->wings, ground, &here, binning, f->found);
        *(f->found->items[0].label == BST_LABEL_ARTEFACT ? &low : &high) = flux;
    }
    return low;
}

static void ground_as_given(const void *user, double x_px, double y_px, bst_psf_wings_ground *out) {
    (void)x_px;
    (void)y_px;
    *out = *(const bst_psf_wings_ground *)user;
}

/* The law of the header, term by term: light above the background with its doubt, noise with the
 * light, the lower one of the frame's noise and the place's, a quarter that matters. */
static void the_limit_is_as_stated(void **state) {
    fixture *f = *state;
    const double places[4][2] = {{-31.0, 0.0}, {2.0, 47.0}, {22.0, -13.0}, {-17.0, -60.0}};
    const bst_psf_wings_ground grounds[3] = {{3.0, NOISE_E}, {5.5, 0.7 * NOISE_E}, {1.0, 14.0}};
    for (int k = 0; k < 4 * 3; k++) {
        double dx = places[k / 3][0], dy = places[k / 3][1], area = 11.0 + 4.0 * k;
        bst_psf_wings_ground here = grounds[k % 3];
        int b = 1 + k % 2;
        bst_psf_wings_begin(f->wings, 0.0, 0.0);
        bst_psf_wings_add(f->wings, STAR_PX, STAR_PX + 3.0, STAR_E);
        double wing = b * b * brightest(f, STAR_E, dx, dy);
        double noise_e = fmin(here.noise_e, NOISE_E);
        double own = 1.5 * area * fmax(wing - fmax(here.level_e - 3.0, 0.0), 0.0);
        double with = sqrt(area * (noise_e * noise_e + wing)), without = sqrt(area) * noise_e;
        double want = fmin(4.0 * (own + 5.0 * (with - without)), own + 5.0 * with);
        /* the local peak is in single precision */
        double got = limit_e(f, STAR_PX + dx, STAR_PX + 3.0 + dy, area, b, here, ground_as_given);
        bst_assert_close(got / want, 1.0, 1e-6);
    }
}

/* A frame by stars: those of the catalogue that are bright enough, on the window and beside it, as
 * bright as in the exposure and spread by its motion; and saturated sources without an entry. */
static void stars_of_the_catalogue_and_saturated_ones_have_wings(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    bst_stars *stars = NULL;
    bst_assert_ok(&ctx, bst_stars_open(&ctx, "embedded", &stars));
    const bst_camera camera = {.width_px = 1000,
                               .height_px = 800,
                               .pixel_scale_arcsec = 20.0,
                               .aperture_m = 0.1,
                               .throughput = 0.7,
                               .quantum_efficiency = 0.6,
                               .photon_flux_v0_per_s_m2 = 3.6e10};
    bst_frame_knowledge known = {
        .q_cam_from_gcrf = bst_quat_look(bst_vec3_from_radec(1.4, -0.1), (bst_vec3){0.1, 0.3, 0.9}),
        .light = {{29000.0, -7000.0, 3000.0}, {1e11, 1.1e11, 0.2e11}},
        .window = {300, 200, 400, 250}};
    const double scale = bst_camera_scale_rad(&camera), exposure_s = 0.4;
    const bst_camera_motion motion = {.q_cam_from_gcrf = known.q_cam_from_gcrf,
                                      .turn_cam_rad = {20.0 * scale, 6.0 * scale, 0.0}};
    bst_predicted_stars sky, all;
    bst_assert_ok(&ctx, bst_predicted_stars_create(&ctx, &camera, stars, 2022.0, 4096, &sky));
    bst_assert_ok(&ctx, bst_predicted_stars_create(&ctx, &camera, stars, 2022.0, 4096, &all));
    int count = 0;
    const bst_predicted_stars_query wide = {
        known.q_cam_from_gcrf, &known.light, {0, 0, 1000, 800}, 500.0, 9.0};
    bst_assert_ok(&ctx, bst_predicted_stars_expect(&ctx, &all, &wide, &count));
    bst_psf_wings_ground here = {3.0, NOISE_E};
    bst_wing_labels_input in = {.camera = &camera,
                                .known = &known,
                                .binning = 2,
                                .exposure_s = exposure_s,
                                .ground = ground_as_given,
                                .user = &here};
    f->found->threshold_snr = 400.0; /* few stars, far fewer than there is room for */
    double bright_e = bst_psf_wings_bright_e(f->wings, 0.5 * NOISE_E, 400.0);
    f->found->count = 4;
    for (int i = 0; i < 4; i++) { /* saturated and bright, one of them, none */
        f->found->items[i] = (bst_detection){.x_px = 310.0 + 60.0 * i,
                                             .y_px = 40.0,
                                             .flux_e = (i & 1 ? 1.01 : 0.99) * bright_e,
                                             .snr = 9.0,
                                             .flags = i & 2 ? BST_DETECTION_SATURATED : 0u};
    }
    for (int oriented = 1; oriented >= 0; oriented--) {
        known.oriented = oriented;
        in.motion = oriented ? &motion : NULL;
        bst_assert_ok(&ctx, bst_wing_labels_make(&ctx, &in, &sky, f->wings, f->found));
        int with = 0, without = 0;
        for (int i = 0; i < count; i++) {
            const bst_imgproc_expected_star *e = &all.expected[i];
            bool near = e->x_px >= 300 - 256 && e->x_px <= 699 + 256 && e->y_px >= 200 - 256 &&
                        e->y_px <= 449 + 256;
            bool bright = exposure_s * bst_camera_electrons_per_s(&camera, e->v_mag) >= bright_e;
            bool held = bst_psf_wings_holds(f->wings, e->x_px, e->y_px, 1e-6);
            assert_int_equal(held, oriented && near && bright);
            with += held;
            without += bright && !near;
        }
        print_message("         %d stars have wings, %d are too far\n", with, without);
        assert_true(!oriented || (with > 2 && without > 2));
        for (int i = 0; i < 4; i++) {
            assert_int_equal(bst_psf_wings_holds(f->wings, 310.0 + 60.0 * i, 40.0, 1e-6), i == 3);
        }
    }
    bst_predicted_stars_free(&sky);
    bst_predicted_stars_free(&all);
    bst_stars_close(stars);
    f->found->threshold_snr = 5.0;
}

/* The wings of a saturated source are spread along the motion of the frame: images move by (r_y,
 * -r_x) with a turn r. */
static void wings_are_spread_by_the_cameras_motion(void **state) {
    fixture *f = *state;
    bst_ctx ctx = {0};
    const bst_camera camera = {.width_px = 1000, .height_px = 800, .pixel_scale_arcsec = 20.0};
    const double scale = bst_camera_scale_rad(&camera);
    const bst_camera_motion motion = {.q_cam_from_gcrf = BST_QUAT_IDENTITY,
                                      .turn_cam_rad = {20.0 * scale, 6.0 * scale, 0.0}};
    const bst_frame_knowledge known = {.oriented = false};
    bst_predicted_stars sky = {.capacity = 0};
    bst_psf_wings_ground here = {3.0, NOISE_E};
    const bst_wing_labels_input in = {.camera = &camera,
                                      .known = &known,
                                      .motion = &motion,
                                      .binning = 1,
                                      .exposure_s = 0.4,
                                      .ground = ground_as_given,
                                      .user = &here};
    double apart = 0.0;
    const bst_detection saturated = {.x_px = 490.0,
                                     .y_px = 40.0,
                                     .flux_e = STAR_E,
                                     .snr = 9.0,
                                     .flags = BST_DETECTION_SATURATED};
    f->found->items[0] = saturated;
    for (int k = 0; k < 3; k++) {
        const double dx[3] = {15.2, -26.1, 4.4}, dy[3] = {-30.3, 8.2, 41.1};
        f->found->count = 1;
        bst_assert_ok(&ctx, bst_wing_labels_make(&ctx, &in, &sky, f->wings, f->found));
        bst_detection star = saturated;
        double x = star.x_px + dx[k], y = star.y_px + dy[k], limit[2];
        limit[0] = limit_e(f, x, y, 20.0, 1, here, ground_as_given);
        bst_psf_wings_begin(f->wings, 6.0, -20.0);
        bst_psf_wings_add(f->wings, star.x_px, star.y_px, STAR_E);
        limit[1] = limit_e(f, x, y, 20.0, 1, here, ground_as_given);
        bst_assert_close(limit[0] / limit[1], 1.0, 0.02); /* rounding to pixels */
        bst_psf_wings_begin(f->wings, -20.0, 6.0);
        bst_psf_wings_add(f->wings, star.x_px, star.y_px, STAR_E);
        apart += fabs(limit_e(f, x, y, 20.0, 1, here, ground_as_given) / limit[1] - 1.0);
        f->found->items[0] = star;
    }
    assert_true(apart > 0.3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spikes_are_artefacts_and_targets_beside_them_are_not),
        cmocka_unit_test(what_the_background_holds_is_no_wing),
        cmocka_unit_test(spikes_move_with_their_star),
        cmocka_unit_test(faint_stars_have_no_wings),
        cmocka_unit_test(places_are_near_by_both_axes),
        cmocka_unit_test(binned_pixels_hold_more_light),
        cmocka_unit_test(the_limit_is_as_stated),
        cmocka_unit_test(stars_of_the_catalogue_and_saturated_ones_have_wings),
        cmocka_unit_test(wings_are_spread_by_the_cameras_motion),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
