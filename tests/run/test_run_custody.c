/* Custody in a run: correlation of tracks, tables, figures, saved states. */
#include "tests/run/custody_support.h"

/* Tracks of both objects at two times, one beside an object, and a short one. */
static void take_all(bst_ctx *ctx, bst_run_custody *c, const bst_world *world) {
    const double beside = 3.0 * BST_DEG_RAD;
    take(ctx, c, world, 0, 1, 9, 100.0, 0.0);
    take(ctx, c, world, -1, 0, 0, 110.0, 0.0); /* no longer listed: it has ended */
    take(ctx, c, world, 1, 2, 5, 200.0, 0.0);
    take(ctx, c, world, 0, 3, 9, 300.0, beside); /* ends 2 */
    take(ctx, c, world, 0, 4, 4, 400.0, 0.0);    /* ends 3; too short itself */
    take(ctx, c, world, 0, 5, 9, 700.0, 0.0);    /* goes on to the end */
}

static void tracks_update_their_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_custody *c, *plain;
    bst_run_reader *run;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), store, &c));
    take_all(&ctx, c, world);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 1000.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.objects == 3 && f.updated == 2);
    assert_true(f.tracks == 4 && f.correlated == 3 && f.uncorrelated == 1);
    assert_true(f.ambiguous == 0 && f.cross_tags == 0);
    bst_assert_close(f.age_mean_s, 0.5 * (300.0 + 800.0), 1e-9);
    assert_true(f.nees_mean > 0.0 && f.nees_mean < 20.0 && f.nees_low < 6.0 && f.nees_high > 6.0);

    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &plain));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, plain, 1000.0));
    bst_custody_figures without;
    (void)bst_run_custody_figures(plain, &without);
    assert_true(without.updated == 0 && isnan(without.age_mean_s) && isnan(without.nees_mean));
    assert_true(f.sigma_p90_m < 0.9 * without.sigma_p90_m);
    bst_run_custody_free(plain);

    cJSON *manifest = cJSON_CreateObject();
    bst_run_custody_add(c, manifest);
    const cJSON *node = cJSON_GetObjectItem(manifest, "custody");
    const char *keys[] = {"objects",          "updated",     "in_custody",
                          "tracks",           "correlated",  "ambiguous",
                          "uncorrelated",     "cross_tags",  "age_mean_s",
                          "sigma_median_m",   "sigma_p90_m", "sigma_updated_median_m",
                          "nees_mean",        "nees_low",    "nees_high",
                          "unknown",          "candidates",  "candidates_confirmed",
                          "candidates_wrong", "new_objects", "new_tracks",
                          "new_wrong",        "new_matched"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        assert_true(cJSON_IsNumber(cJSON_GetObjectItem(node, keys[i])));
    }
    cJSON_Delete(manifest);
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    assert_int_equal(bst_run_reader_int(run, "SELECT count(*) FROM custody_tracks", 0, 0), 4);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE object = "
                                        "true_object AND candidates = 1 AND chi2 < 27 AND nees > 0",
                                        0, 0),
                     3);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody_tracks WHERE track_id = 3 "
                                        "AND object IS NULL AND true_object IS NULL AND hits = 9",
                                        0, 0),
                     1);
    assert_int_equal(bst_run_reader_int(run,
                                        "SELECT count(*) FROM custody WHERE object = 0 AND name = "
                                        "'A' AND norad = 44801 AND updates = 2 AND last_s = 700 "
                                        "AND age_s = 300 AND error_m < 4 * sigma_m",
                                        0, 0),
                     1);
    bst_run_reader_close(run);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A run that goes on from a saved state ends with the same figures. */
static void saved_states_go_on(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *whole, *part;
    bst_custody_figures a, b;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &whole));
    take(&ctx, whole, world, 1, 2, 9, 200.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(6, 0), NULL, &part));
    copy_state(&ctx, whole, part);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, whole, 500.0));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, part, 500.0));
    (void)bst_run_custody_figures(whole, &a);
    (void)bst_run_custody_figures(part, &b);
    assert_true(a.updated == 1 && b.updated == 1 && a.nees_mean == b.nees_mean &&
                a.sigma_p90_m == b.sigma_p90_m);
    bst_run_custody_free(whole);
    bst_run_custody_free(part);
    bst_world_free(world);
}

/* A track without detections goes on while it is listed; one that is resumed later, in a run that
 * goes on from a saved state too, is not used again. */
static void a_track_is_used_once(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c, *later;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &later));
    take(&ctx, c, world, 0, 7, 9, 100.0, 0.0);
    take_track(&ctx, c, world, 0, 7, 9, 40, 190.0, 0.0);
    assert_int_equal(tracks_of(c), 0);
    take(&ctx, c, world, 0, 7, 12, 200.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 210.0, 0.0);
    assert_int_equal(tracks_of(c), 1);
    take(&ctx, c, world, 1, 3, 9, 220.0, 0.0); /* another one, with a smaller id */
    take(&ctx, c, world, 0, 7, 15, 300.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 310.0, 0.0);
    assert_int_equal(tracks_of(c), 2);
    copy_state(&ctx, c, later);
    take(&ctx, later, world, 0, 7, 20, 400.0, 0.0);
    take(&ctx, later, world, 1, 3, 20, 410.0, 0.0);
    take(&ctx, later, world, 0, 8, 9, 420.0, 0.0); /* a new one */
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, later, 500.0));
    assert_int_equal(tracks_of(later), 3);
    bst_run_custody_free(c);
    bst_run_custody_free(later);
    bst_world_free(world);
}

/* An object on another element set than in the saved state starts anew, the others go on. */
static void changed_objects_start_anew(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_world *changed = test_world_with(
        "{\"name\": \"A\", " TEST_GX5
        "}, {\"name\": \"B\", \"orbit\": {\"elements_file\": "
        "\"scenarios/catalogue_2022-06.tle\", \"norad\": 25544}}, {\"name\": \"own\", " TEST_NEOSSAT
        "}",
        "");
    bst_run_custody *c, *later;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    take(&ctx, c, world, 1, 2, 9, 200.0, 0.0);
    take(&ctx, c, world, -1, 0, 0, 210.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, changed, &SCENARIO(5, 0), NULL, &later));
    copy_state(&ctx, c, later);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, later, 500.0));
    assert_true(bst_run_custody_figures(later, &f));
    assert_true(f.objects == 3 && f.updated == 1 && f.correlated == 2);
    bst_run_custody_free(c);
    bst_run_custody_free(later);
    bst_world_free(changed);
    bst_world_free(world);
}

/* NEES of an object's elements at the start of a run. */
static double first_nees(const bst_world *world, uint64_t number, const char *object) {
    bst_ctx ctx = {0};
    scratch place;
    bst_run *store;
    bst_run_custody *c;
    bst_run_reader *run;
    char query[128];
    scratch_make(&place);
    bst_assert_ok(&ctx, bst_run_create(&ctx, scratch_path(&place, "run"), false, &store));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, number), store, &c));
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 1.0));
    bst_run_custody_free(c);
    bst_assert_ok(&ctx, bst_run_seal(&ctx, store));
    bst_assert_ok(&ctx, bst_run_finish(&ctx, store));
    bst_assert_ok(&ctx, bst_run_reader_open(&ctx, scratch_path(&place, "run"), &run));
    snprintf(query, sizeof query,
             "SELECT CAST(1e6 * nees AS INTEGER) FROM custody WHERE name = '%s'", object);
    double nees = 1e-6 * (double)bst_run_reader_int(run, query, 0, -1);
    bst_run_reader_close(run);
    scratch_remove(&place);
    return nees;
}

/* The error of an object depends on the run, not on the other objects. */
static void errors_of_the_catalogue(void **state) {
    (void)state;
    bst_world *world = world_of_two();
    bst_world *other = test_world_with(
        "{\"name\": \"own\", " TEST_NEOSSAT "}, {\"name\": \"A\", " TEST_GX5 "}", "");
    double nees = first_nees(world, 0, "A");
    assert_true(nees > 0.0);
    bst_assert_close(first_nees(other, 0, "A"), nees, 1e-9 * nees);
    assert_true(fabs(first_nees(world, 1, "A") - nees) > 1e-3);
    bst_world_free(other);
    bst_world_free(world);
}

/* Every track is in one of the counts. */
static void a_failed_update_is_counted(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    updates_fail = true;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    updates_fail = false;
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.tracks == 1 && f.uncorrelated == 1 && f.correlated == 0 && f.ambiguous == 0);
    bst_run_custody_free(c);
    bst_world_free(world);
}

/* GX5, called A, of 12 m^2, and C, with a mean anomaly of its own; the observer has two sensors,
 * the second one with images of twice the width. */
static bst_world *world_with_neighbour(const scratch *place, const char *anomaly) {
    char text[256], objects[2048], line[70];
    snprintf(line, sizeof line, "2 44802   0.0366 343.6423 0001933 100.2390 %s  1.00270919  944",
             anomaly);
    int sum = 0;
    for (const char *c = line; *c; c++) {
        sum += *c >= '0' && *c <= '9' ? *c - '0' : 0;
    }
    snprintf(text, sizeof text,
             "1 44802U 19080B   22167.00079919  .00000075  00000+0  00000+0 0  9999\n%s%d\n", line,
             sum % 10);
    scratch at = *place;
    FILE *file = fopen(scratch_path(&at, "near.tle"), "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    snprintf(objects, sizeof objects,
             "{\"name\": \"A\", \"area_m2\": 12, " TEST_GX5
             "}, {\"name\": \"C\", \"orbit\": {\"elements_file\": \"%s\", \"norad\": 44802}}",
             scratch_path(&at, "near.tle"));
    return test_world_with(objects,
                           ", \"name\": \"one\"}, {\"name\": \"two\", \"camera\": "
                           "{\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15, \"psf_fwhm_px\": 5}");
}

/* What becomes of one track of A. */
static bst_custody_figures figures_of_a(const bst_world *world) {
    bst_ctx ctx = {0};
    bst_scenario scenario = SCENARIO(5, 0);
    scenario.record.custody_sigma_m = 20;
    scenario.record.custody_drift_m_per_day = 20;
    bst_run_custody *c;
    bst_custody_figures f;
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &scenario, NULL, &c));
    take(&ctx, c, world, 0, 1, 9, 100.0, 0.0);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    assert_true(bst_run_custody_figures(c, &f));
    bst_run_custody_free(c);
    return f;
}

/* A track beside which a second object is predicted, outside of the gate but nearer than two images
 * can be separated, updates none. */
static void neighbours_are_ambiguous(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    /* 0.001 degrees (4 arcsec, 0.7 of a FWHM) and 0.01 degrees beside GX5 */
    const char *anomalies[2] = {"191.6451", "191.6541"};
    for (int n = 0; n < 2; n++) {
        bst_world *world = world_with_neighbour(&place, anomalies[n]);
        bst_custody_figures f = figures_of_a(world);
        assert_true(f.tracks == 1 && f.ambiguous == (n == 0) && f.correlated == (n == 1));
        bst_world_free(world);
    }
    scratch_remove(&place);
}

/* The limit of it: one FWHM and two standard deviations over both axes, at most two FWHM. */
static void neighbours_by_their_uncertainty(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    bst_world *world = world_with_neighbour(&place, "191.6451");
    const double sigmas[3][2] = {{0.1, 0.3}, {0.3, 0.1}, {0.2, 0.6}};
    for (int n = 0; n < 12; n++) {
        const int k = n / 2;
        from_sensor = n % 2;
        const bst_camera *camera = bst_world_camera(world, 0, from_sensor);
        const double fwhm = camera->psf_fwhm_px * camera->pixel_scale_arcsec * BST_ARCSEC_RAD;
        const double *s = sigmas[k / 2], limit = 1.0 + fmin(2.0 * hypot(s[0], s[1]), 1.0);
        const double d = fwhm * limit * (k % 2 ? 1.01 : 0.99);
        bst_custody_prediction p = {.innovation = {0.6 * d, -0.8 * d}, .chi2 = 1e3};
        p.covariance[0][0] = pow(s[0] * fwhm, 2.0);
        p.covariance[1][1] = pow(s[1] * fwhm, 2.0);
        p.covariance[0][1] = p.covariance[1][0] = -0.5 * s[0] * s[1] * fwhm * fwhm;
        predicted = &p;
        photocentre_count = 0;
        bst_custody_figures f = figures_of_a(world);
        predicted = NULL;
        assert_true(f.tracks == 1 && f.ambiguous == (k % 2 == 0) && f.correlated == (k % 2));
        /* half of the radius of a disc of this area */
        bst_assert_close(photocentres_m[0], 0.5 * sqrt(12.0 / BST_PI), 1e-12);
    }
    from_sensor = 0;
    bst_world_free(world);
    scratch_remove(&place);
}

/* What becomes of three tracks of A, all known objects being predicted `off_rad` beside them and
 * outside of the gate. */
static bst_custody_figures figures_beside(const bst_world *world, double off_rad) {
    bst_ctx ctx = {0};
    bst_run_custody *c;
    bst_custody_figures f;
    const int own[6] = {0, 0, 0, 0, 0, 0};
    const bst_custody_prediction far = {.innovation = {off_rad, 0.0}, .chi2 = 1e3};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    predicted = &far;
    lost_norad = -1;
    for (int k = 0; k < 3; k++) {
        take_detected(&ctx, c, world, own, k + 1, 100.0 + 6900.0 * k);
    }
    predicted = NULL;
    lost_norad = 44802;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 25000.0));
    assert_true(bst_run_custody_figures(c, &f));
    bst_run_custody_free(c);
    return f;
}

/* Tracks that no filter explains, with an orbit that is that of two known objects, make no third
 * one; those beside both, whose light may be that of both, are no candidates at all. */
static void an_orbit_of_two_objects_is_no_third(void **state) {
    (void)state;
    scratch place;
    scratch_make(&place);
    bst_world *world = world_with_neighbour(&place, "191.6451"); /* 0.7 km beside A */
    bst_custody_figures f = figures_beside(world, 1.0);
    assert_true(f.uncorrelated == 3 && f.candidates_confirmed == 1);
    assert_true(f.new_objects == 0 && f.new_matched == 0 && f.updated == 0);
    f = figures_beside(world, 1e-7);
    assert_true(f.uncorrelated == 0 && f.ambiguous == 3 && f.candidates == 0 && f.updated == 0);
    bst_world_free(world);
    scratch_remove(&place);
}

/* A filter that is too sure, so that the tracks of its object are beside it, gets it back. */
static void a_filter_gets_its_object_back(void **state) {
    (void)state;
    bst_world *world = test_world_with("{\"name\": \"A\", " TEST_GX5 "}", "");
    const bst_custody_figures f = figures_beside(world, 1e-7);
    assert_true(f.uncorrelated == 0 && f.ambiguous == 3 && f.candidates_confirmed == 1);
    assert_true(f.new_objects == 0 && f.new_matched == 1 && f.updated == 1);
    bst_world_free(world);
}

/* A track with detections updates its object with their directions, not with its state; one whose
 * detections are of two objects updates none. */
static void directions_update_their_object(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c, *plain;
    bst_custody_figures f, without;
    const int own[6] = {0, 0, 0, 0, 0, 0}, mixed[6] = {1, 1, 0, 0, 0, 0};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &plain));
    updates_fail = true; /* those with a state */
    take_detected(&ctx, c, world, own, 1, 100.0);
    take_detected(&ctx, c, world, mixed, 2, 300.0);
    updates_fail = false;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.tracks == 2 && f.correlated == 1 && f.uncorrelated == 1 && f.updated == 1);
    assert_true(f.cross_tags == 0 && f.ambiguous == 0);
    /* 264 m, of 2,031 m for all objects without updates */
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, plain, 500.0));
    assert_true(bst_run_custody_figures(plain, &without));
    assert_true(f.sigma_updated_median_m < 0.2 * without.sigma_median_m);
    assert_true(f.nees_mean > 0.5 && f.nees_mean < 20.0);
    bst_run_custody_free(c);
    bst_run_custody_free(plain);
    bst_world_free(world);
}

/* A track whose last attitude is wrong by 60 arcsec, 12 km at its object, updates it by its other
 * directions, and is no candidate. */
static void a_wrong_last_attitude_loses_no_object(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world = world_of_two();
    bst_run_custody *c;
    bst_custody_figures f;
    const int own[6] = {0, 0, 0, 0, 0, 0};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c));
    last_off_rad = 60.0 * BST_ARCSEC_RAD;
    take_detected(&ctx, c, world, own, 1, 100.0);
    take_detected(&ctx, c, world, own, 2, 300.0);
    last_off_rad = 0.0;
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 500.0));
    assert_true(bst_run_custody_figures(c, &f));
    assert_true(f.tracks == 2 && f.correlated == 2 && f.uncorrelated == 0 && f.cross_tags == 0);
    assert_true(f.candidates == 0 && f.nees_mean < 20.0);
    bst_run_custody_free(c);
    bst_world_free(world);
}

static void off_and_without_objects(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_run_custody *c;
    bst_custody_figures f;
    bst_world *world = world_of_two();
    const bst_scenario off = {.record = {.custody = false}};
    bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &off, NULL, &c));
    assert_null(c);
    bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, 10.0));
    assert_false(bst_run_custody_figures(c, &f));
    bst_run_custody_add(c, NULL);
    bst_run_custody_free(c);
    bst_world_free(world);
    world = test_world_with("", "");
    assert_int_equal(bst_run_custody_create(&ctx, world, &SCENARIO(5, 0), NULL, &c),
                     BST_ERR_CONFIG);
    assert_non_null(strstr(ctx.message, "/record/custody"));
    assert_null(c);
    bst_world_free(world);
}

/* A drift that is a random walk, with a variance of n^2 a day, displaces an object after T days by
 * a variance of n^2 T^3 / 3 along its orbit, without any update. */
static void drifts_are_random_walks(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double days = 1.5, noise[2] = {0.0, 3000.0};
    bst_world *world = world_of_two();
    double variance[2];
    for (int k = 0; k < 2; k++) {
        bst_scenario scenario = SCENARIO(5, 0);
        bst_run_custody *c;
        bst_custody_figures f;
        scenario.record.custody_noise_m_per_day = noise[k];
        bst_assert_ok(&ctx, bst_run_custody_create(&ctx, world, &scenario, NULL, &c));
        bst_assert_ok(&ctx, bst_run_custody_finish(&ctx, c, days * BST_DAY_S));
        assert_true(bst_run_custody_figures(c, &f));
        variance[k] = f.sigma_median_m * f.sigma_median_m;
        bst_run_custody_free(c);
    }
    double grown = noise[1] * noise[1] * days * days * days / 3.0;
    /* of the middle one of three objects, whose orbit is nearly a circle */
    bst_assert_close((variance[1] - variance[0]) / grown, 1.0, 0.04);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(drifts_are_random_walks),
        cmocka_unit_test(tracks_update_their_objects),
        cmocka_unit_test(saved_states_go_on),
        cmocka_unit_test(a_track_is_used_once),
        cmocka_unit_test(changed_objects_start_anew),
        cmocka_unit_test(errors_of_the_catalogue),
        cmocka_unit_test(a_failed_update_is_counted),
        cmocka_unit_test(neighbours_are_ambiguous),
        cmocka_unit_test(neighbours_by_their_uncertainty),
        cmocka_unit_test(an_orbit_of_two_objects_is_no_third),
        cmocka_unit_test(a_filter_gets_its_object_back),
        cmocka_unit_test(directions_update_their_object),
        cmocka_unit_test(a_wrong_last_attitude_loses_no_object),
        cmocka_unit_test(off_and_without_objects),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
