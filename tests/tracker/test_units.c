/* What the keys of a scenario, in pixels, arcseconds, degrees and kilometres, are inside: radians,
 * metres and variances. */
#include "tests/test_support.h"
#include "tracker/mtt/multitarget_internal.h"
#include "tracker/tracker_internal.h"

#define AS BST_ARCSEC_RAD
#define PX (4.0 * AS) /* of the camera here */

typedef struct pair {
    const char *name;
    double found, expected;
} pair;

static bool no_star(void *user, uint32_t id, bst_vec3 *icrs) {
    (void)user;
    (void)id;
    (void)icrs;
    return false;
}

static void expect(const pair *list, size_t count) {
    for (size_t k = 0; k < count; k++) {
        if (!(fabs(list[k].found - list[k].expected) <= 1e-9 * fabs(list[k].expected))) {
            fail_msg("%s = %.12g, expected %.12g", list[k].name, list[k].found, list[k].expected);
        }
    }
}

static void units_of_the_keys(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_tracker_config c;
    bst_tracker *t;
    const bst_camera camera = {
        .width_px = 900, .height_px = 500, .pixel_scale_arcsec = 4.0, .psf_fwhm_px = 2.0};
    bst_assert_ok(&ctx, bst_config_defaults(&ctx, bst_tracker_config_table, &c));
    c.star_systematic_px = 0.03;
    c.max_attitude_sigma_px = 0.7;
    c.max_roll_sigma_arcsec = 500;
    c.drift_sigma_arcsec_per_s = 17;
    c.drift_noise_arcsec_per_s15 = 0.31;
    c.jitter_px = 0.23;
    c.telemetry_sigma_arcsec = 41;
    c.process_noise_arcsec_per_s15 = 0.021;
    c.manoeuvre_noise_arcsec_per_s15 = 2.9;
    c.max_rate_arcsec_per_s = 113;
    c.cue_rate_margin_arcsec_per_s = 2.3;
    c.max_sigma_arcsec = 53;
    c.merge_distance_px = 5.9;
    c.merged_systematic_px = 0.37;
    c.object_systematic_px = 0.019;
    c.blended_systematic_px = 0.47;
    c.edge_margin_px = 4.3;
    c.cue_acceleration_radius_deg = 4.7;
    c.target_rate_systematic_arcsec_per_s = 0.13;
    c.target_max_rate_sigma_arcsec_per_s = 0.83;
    c.stationary_rate_arcsec_per_s = 0.59;
    c.max_dormant_sigma_deg = 1.1;
    c.assumed_range_km = 37000;
    c.orbit_noise_mps15 = 1.7e-3;
    c.identity_period_s = 7.0;
    c.uncatalogued_per_field = 0.07;
    bst_assert_ok(&ctx, bst_tracker_create(&ctx, &c, &camera, 6000, no_star, NULL, &t));
    const bst_mtt_params *m = &t->mtt->params;
    const pair list[] = {
        {"attitude floor", t->attitude_params.floor_px, 0.03},
        {"attitude cross", t->attitude_params.max_cross_rad, 0.7 * PX},
        {"attitude roll", t->attitude_params.max_roll_rad, 500 * AS},
        {"drift", t->error_params.rate_sigma_radps, 17 * AS},
        {"drift noise", t->error_params.noise_rad2ps3, 0.31 * 0.31 * AS * AS},
        {"jitter", t->error_params.jitter_rad, 0.23 * PX},
        {"telemetry", t->error_params.telemetry_sigma_rad, 41 * AS},
        {"rate floor", t->target_params.rate_floor_radps, 0.13 * AS},
        {"rate sigma", t->target_params.max_rate_sigma_radps, 0.83 * AS},
        {"memory noise", t->target_params.memory_noise_rad2ps3, 0.21 * 0.21 * AS * AS},
        {"range", t->assumed_range_m, 37e6},
        {"floor", t->floor_variance_px2, 0.019 * 0.019},
        {"blend", t->blend_variance_px2, 0.47 * 0.47},
        {"largest variance", t->max_variance_px2, 0.49},
        {"edge", t->edge_margin_px, 4.3},
        {"largest attitude", t->max_attitude_sigma_rad, 0.7 * PX},
        {"process noise", m->noise_rad2ps3, 0.021 * 0.021 * AS * AS},
        {"manoeuvre noise", m->manoeuvre_noise_rad2ps3, 2.9 * 2.9 * AS * AS},
        {"dormant sigma", m->max_dormant_sigma_rad, 1.1 * BST_DEG_RAD},
        {"orbit noise", m->orbit_noise_m2ps3, 1.7e-3 * 1.7e-3},
        {"pixel", m->pixel_rad, PX},
        {"field", m->field_sr, 900.0 * 500.0 * PX * PX},
        {"largest rate", m->max_rate_radps, 113 * AS},
        {"cue margin", m->cue_rate_margin_radps, 2.3 * AS},
        {"largest sigma", m->max_sigma_rad, 53 * AS},
        {"merge", m->merge_rad, 5.9 * PX},
        {"merge floor", m->merge_floor_rad, 0.37 * PX},
        {"feed forward", m->feed_forward_rad, 4.7 * BST_DEG_RAD},
        {"stationary", m->star_rate_radps, 0.59 * AS},
        /* per steradian, (rad/s)^2 of the disc of rates, and magnitude of 10 */
        {"unknown objects", t->identity_params.unknown_density,
         0.07 / (900.0 * 500.0 * PX * PX) / (BST_PI * 113 * AS * 113 * AS) / 10.0}};
    expect(list, sizeof list / sizeof *list);
    bst_tracker_free(t);
    bst_config_free(bst_tracker_config_table, &c);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(units_of_the_keys)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
