/* What the wings of a bright star pretend to be, and what they leave alone. */
#include "imgproc/detect/psf_wings.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spikes_are_artefacts_and_targets_beside_them_are_not),
        cmocka_unit_test(what_the_background_holds_is_no_wing),
        cmocka_unit_test(spikes_move_with_their_star),
        cmocka_unit_test(faint_stars_have_no_wings),
        cmocka_unit_test(places_are_near_by_both_axes),
        cmocka_unit_test(binned_pixels_hold_more_light),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
