/* Settings of the detector: which exclude each other, from which size on edges leave nothing, what
 * needs columns or the whole sensor, and the times of a rolling shutter. */
#include "boresight/detector_config.h"
#include "tests/test_support.h"

/* A block with all effects off. */
static bst_detector_config off(void) {
    return (bst_detector_config){
        .em_gain = 1.0, .crosstalk = {.outputs = 1}, .dark_doubling_k = 6.5};
}

static bool is_allowed(const bst_detector_config *d) {
    bst_ctx ctx = {0};
    bst_status s = bst_detector_config_check(&ctx, d);
    assert_true(s == BST_OK || s == BST_ERR_CONFIG);
    return s == BST_OK;
}

static bool fits(const bst_detector_config *d, int64_t width, int64_t height) {
    bst_ctx ctx = {0};
    bst_status s = bst_detector_config_check_size(&ctx, d, width, height);
    assert_true(s == BST_OK || s == BST_ERR_CONFIG);
    return s == BST_OK;
}

/* The dark current doubles with each dark_doubling_k, on both sides of the reference. */
static void dark_current_doubles(void **state) {
    (void)state;
    bst_detector_config d = off();
    d.reference_temperature_c = -30.0;
    const double kelvin[4] = {-13.0, 0.0, 6.5, 26.0}, factor[4] = {0.25, 1.0, 2.0, 16.0};
    for (int i = 0; i < 4; i++) {
        d.temperature_c = -30.0 + kelvin[i];
        bst_assert_close(bst_detector_dark_factor(&d), factor[i], 1e-12); /* rounding of exp2 */
    }
    d = (bst_detector_config){.em_gain = 1.0};
    bst_assert_close(bst_detector_dark_factor(&d), 1.0, 0.0);
}

/* Middle row to first or last row: (n - 1) / 2 rows, read in either direction; ticks are rounded
 * up, but not for the rounding of a product. */
static void rows_lead(void **state) {
    (void)state;
    bst_detector_config d = off();
    bst_assert_close(bst_detector_lead_s(&d, 512), 0.0, 0.0);
    for (int sign = -1; sign <= 1; sign += 2) {
        d.row_time_s = sign * 2e-3;
        bst_assert_close(bst_detector_lead_s(&d, 1), 0.0, 0.0);
        bst_assert_close(bst_detector_lead_s(&d, 2), 1e-3, 1e-15);
        bst_assert_close(bst_detector_lead_s(&d, 101), 0.1, 1e-13);
        assert_int_equal(bst_detector_lead_ticks(&d, 1, 1000.0), 0);
        assert_int_equal(bst_detector_lead_ticks(&d, 101, 1000.0), 100);
        assert_int_equal(bst_detector_lead_ticks(&d, 102, 1000.0), 101); /* 0.101 s */
        assert_int_equal(bst_detector_lead_ticks(&d, 102, 100.0), 11);   /* 10.1 */
        assert_int_equal(bst_detector_lead_ticks(&d, 102, 10.0), 2);     /* 1.01 */
    }
    d.row_time_s = 0.1;
    assert_int_equal(bst_detector_lead_ticks(&d, 7, 10.0), 3); /* 0.1 x 3 is above 0.3 */
}

/* Each effect by itself: which region it needs, and whether it goes with a rolling shutter and with
 * a ramp. */
static void effects_by_themselves(void **state) {
    (void)state;
    bst_detector_config d[24];
    for (int i = 0; i < 24; i++) {
        d[i] = off();
    }
    /* 0 to 3 need columns, 4 to 12 the sensor, the rest neither */
    d[0].saturation = BST_WELL_BLOOM;
    d[1].frame_transfer_s = 0.01;
    d[2].parallel_traps.traps_per_px[0] = 0.1;
    d[3].parallel_traps.traps_per_px[2] = 0.1;
    d[4].serial_traps.traps_per_px[0] = 0.1;
    d[5].serial_traps.traps_per_px[1] = 0.1;
    d[6].serial_traps.traps_per_px[2] = 0.1;
    d[7].interpixel_coupling = 0.01;
    d[8].brighter_fatter_per_e = 1e-7;
    d[9].persistence.trapped_share[0] = 0.01;
    d[10].persistence.trapped_share[4] = 0.01;
    d[11].crosstalk = (bst_detector_crosstalk_config){.outputs = 2, .coupling = 1e-3};
    d[12].crosstalk = (bst_detector_crosstalk_config){.outputs = 2, .coupling = -1e-3};
    d[13].crosstalk.coupling = 1e-3; /* of one output */
    d[14].crosstalk.outputs = 4;     /* that have nothing of each other */
    d[15].row_time_s = 1e-4;
    d[16].row_time_s = -1e-4;
    d[17].em_gain = 1.5;
    d[18].readout_s = 0.1;
    d[19].clock_induced_e = 0.01;
    d[20].glow.peak_e = 1.0;
    d[21].cosmic_rays.readout_s = 1.0;
    d[22].double_sampling_s = 1e-3;
    d[23].telegraph_noise_fraction = 0.1;
    const char *beside_ramp =
        "0000000" /* 0 to 6: charge that moves */
        "1"       /* coupling of pixels */
        "0"
        "111111" /* persistence, crosstalk */
        "000000000";
    for (int i = 0; i < 24; i++) {
        assert_true(is_allowed(&d[i]));
        assert_int_equal(bst_detector_config_whole_columns(&d[i]), i < 13);
        assert_int_equal(bst_detector_config_whole_sensor(&d[i]), i >= 4 && i < 13);
        bst_detector_config c = d[i];
        c.row_time_s = i == 15 || i == 16 ? c.row_time_s : 1e-4;
        assert_int_equal(is_allowed(&c), i >= 13);
        c.row_time_s = -1e-4;
        assert_int_equal(is_allowed(&c), i >= 13);
        c = d[i];
        c.ramp.reads = 2;
        assert_int_equal(is_allowed(&c), beside_ramp[i] == '1');
    }
    assert_true(bst_detector_has_traps(&d[3].parallel_traps));
    assert_false(bst_detector_has_traps(&d[3].serial_traps));
    assert_true(bst_detector_has_persistence(&d[10]));
    assert_false(bst_detector_has_persistence(&d[7]));
}

/* Reads of a ramp, traps beside outputs, shares of persistence, frequencies of 1/f noise: from both
 * sides of each limit. */
static void limits_of_settings(void **state) {
    (void)state;
    const int reads[4] = {0, 1, 2, 64};
    for (int i = 0; i < 4; i++) {
        bst_detector_config d = off();
        d.ramp.reads = reads[i];
        assert_int_equal(is_allowed(&d), i != 1);
    }
    bst_detector_config d = off();
    d.serial_traps.traps_per_px[1] = 0.5;
    d.crosstalk.outputs = 2;
    assert_false(is_allowed(&d));
    d.serial_traps.traps_per_px[1] = 0.0;
    d.parallel_traps.traps_per_px[1] = 0.5;
    assert_true(is_allowed(&d));
    d = off();
    for (int i = 0; i < BST_PERSISTENCE_SPECIES; i++) {
        d.persistence.trapped_share[i] = 0.2;
    }
    assert_true(is_allowed(&d));
    d.persistence.trapped_share[3] = 0.21;
    assert_false(is_allowed(&d));
    d = off();
    d.pixel_flicker_noise.lowest_hz = 2.0; /* without noise the range does not count */
    d.pixel_flicker_noise.highest_hz = 1.0;
    assert_true(is_allowed(&d) && !bst_detector_has_pixel_flicker(&d));
    d.pixel_flicker_noise.rms_e = 3.0;
    const double highest[5] = {1.9, 2.0, 2.0 * 262144.0, 2.0 * 262145.0, NAN}; /* docs: 262144 */
    for (int i = 0; i < 5; i++) {
        d.pixel_flicker_noise.highest_hz = highest[i];
        assert_int_equal(is_allowed(&d), i == 1 || i == 2);
    }
    d.pixel_flicker_noise.highest_hz = 20.0;
    d.ramp.reads = 4;
    assert_true(bst_detector_has_pixel_flicker(&d) && !is_allowed(&d));
}

/* A column and a row must be left between edges, of which shielded and overscan are counted from
 * the same side. */
static void edges_leave_pixels(void **state) {
    (void)state;
    for (int which = 0; which < 2; which++) {
        bst_detector_config d = off();
        *(which ? &d.overscan : &d.shielded) = (bst_detector_edges_config){3, 5, 7, 11};
        assert_true(fits(&d, 9, 19));
        assert_false(fits(&d, 8, 19));
        assert_false(fits(&d, 9, 18));
    }
    for (int which = 0; which < 2; which++) { /* of each side the wider one: 4, 6, 8, 12 */
        bst_detector_config d = off();
        *(which ? &d.overscan : &d.shielded) = (bst_detector_edges_config){4, 1, 8, 1};
        *(which ? &d.shielded : &d.overscan) = (bst_detector_edges_config){2, 6, 3, 12};
        assert_true(fits(&d, 11, 21));
        assert_false(fits(&d, 10, 21));
        assert_false(fits(&d, 11, 20));
    }
    bst_detector_config d = off();
    d.crosstalk.outputs = 4;
    assert_true(fits(&d, 1024, 3));
    assert_false(fits(&d, 1022, 4)); /* outputs share columns, not rows */
    d.crosstalk.outputs = 1;
    assert_true(fits(&d, 7, 3));
}

/* What does not fit is named in the message. */
static void edges_and_outputs_fit_the_frame(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_detector_config d = {.shielded = {60, 40, 0, 0}};
    assert_int_equal(bst_detector_config_check_size(&ctx, &d, 100, 50), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "shielded: 100 columns and 0 rows leave nothing"));
    d = (bst_detector_config){.overscan = {0, 0, 0, 50}};
    assert_int_equal(bst_detector_config_check_size(&ctx, &d, 100, 50), BST_ERR_CONFIG);
    d = (bst_detector_config){.shielded = {60, 0, 0, 0}, .overscan = {0, 40, 0, 0}};
    assert_int_equal(bst_detector_config_check_size(&ctx, &d, 100, 50), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "shielded and overscan together: 100 columns"));
    d.overscan.right = 39;
    d.overscan.left = 60; /* the same columns */
    bst_assert_ok(&ctx, bst_detector_config_check_size(&ctx, &d, 100, 50));
    d = (bst_detector_config){.crosstalk = {3, 0.01, true}};
    assert_int_equal(bst_detector_config_check_size(&ctx, &d, 100, 50), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "crosstalk/outputs: 3 outputs"));
    bst_assert_ok(&ctx, bst_detector_config_check_size(&ctx, &d, 99, 50));
    /* rows cannot be exposed one after the other and move charge */
    d = (bst_detector_config){.row_time_s = 1e-4, .parallel_traps = {{1.0}, {1.0}, 0.5, 0.0}};
    assert_int_equal(bst_detector_config_check(&ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "traps"));
    d = (bst_detector_config){.serial_traps = {{1.0}, {1.0}, 0.5, 0.0},
                              .crosstalk = {2, 0.0, true}};
    assert_int_equal(bst_detector_config_check(&ctx, &d), BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "serial_traps"));
    d.crosstalk.outputs = 1;
    bst_assert_ok(&ctx, bst_detector_config_check(&ctx, &d));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dark_current_doubles),  cmocka_unit_test(rows_lead),
        cmocka_unit_test(effects_by_themselves), cmocka_unit_test(limits_of_settings),
        cmocka_unit_test(edges_leave_pixels),    cmocka_unit_test(edges_and_outputs_fit_the_frame)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
