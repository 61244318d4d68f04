/* Uncertainty of places along orbits as the tasking keeps it, and targets that are due by it. */
#include "tests/archive_support.h"
#include "tests/control/tasking_fixture.h"

#define TARGET_ "\"object\": \"INMARSAT GX5\", \"revisit_s\": 60, \"frames\": 3"
#define REST_ "\"min_snr\": 0, \"sun_keep_out_deg\": 0, \"catalogue_sigma_m\": 400, "

static bst_status archive_tasking(void *self, bst_archive *archive) {
    return bst_tasking_archive(self, archive);
}

/* Without tracks it grows as the catalogue's: sigma^2 + (drift (age + t))^2, and with the process
 * noise q by q^2 t^3 / 3. */
static void it_grows_as_the_catalogue_ages(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{" TARGET_ "}], " REST_
              "\"catalogue_drift_m_per_day\": 1200, \"catalogue_noise_m_per_day\": 90}");
    double age_s;
    assert_true(bst_knowledge_element_age(f.knowledge[0], GX5, &age_s));
    assert_true(age_s > 3600.0);
    for (int day = 0; day < 4; day++) {
        const double days = age_s / 86400.0 + day;
        const double expected =
            sqrt(400.0 * 400.0 + pow(1200.0 * days, 2) + 90.0 * 90.0 * pow(day, 3) / 3.0);
        bst_assert_close(bst_tasking_sigma_m(&f.tasking, GX5, 86400.0 * day) / expected, 1.0,
                         1e-12); /* rounding */
    }
    tear_down(&f);
}

/* Tracks at three times give what a fit of both numbers to all of them gives. */
static void tracks_count_as_in_a_fit(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{" TARGET_ "}], " REST_ "\"catalogue_drift_m_per_day\": 1200}");
    static const double days[] = {0.1, 0.4, 0.7}, sigma_m[] = {20.0, 300.0, 5.0};
    bst_tasking_along *p = &f.tasking.along[GX5];
    *p = (bst_tasking_along){.aa = 250000.0, .ad = 90000.0, .dd = 1440000.0};
    double determinant = p->aa * p->dd - p->ad * p->ad;
    double n[3] = {p->dd / determinant, -p->ad / determinant, p->aa / determinant};
    for (int i = 0; i < 3; i++) {
        bst_tasking_uncertainty_update(&f.tasking, GX5, 86400.0 * days[i],
                                       1.0 / (sigma_m[i] * sigma_m[i]));
        const double weight = 1.0 / (sigma_m[i] * sigma_m[i] + 400.0 * 400.0);
        n[0] += weight;
        n[1] += weight * days[i];
        n[2] += weight * days[i] * days[i];
    }
    bst_tasking_uncertainty_update(&f.tasking, GX5, 86400.0, 0.0); /* says nothing */
    determinant = n[0] * n[2] - n[1] * n[1];
    bst_assert_close(p->aa * determinant / n[2], 1.0, 1e-10); /* rounding */
    bst_assert_close(p->ad * determinant / n[1], -1.0, 1e-10);
    bst_assert_close(p->dd * determinant / n[0], 1.0, 1e-10);
    const double at = 2.0, variance = (n[2] - 2.0 * at * n[1] + at * at * n[0]) / determinant;
    bst_assert_close(bst_tasking_sigma_m(&f.tasking, GX5, 86400.0 * at) / sqrt(variance), 1.0,
                     1e-10);
    tear_down(&f);
}

/* Of a direction along x, seen from 2000 km: only what moves across it counts, by the covariance
 * along y and z. */
static void directions_tell_what_lies_across_them(void **state) {
    (void)state;
    const bst_vec3 ahead = {1.0, 0.0, 0.0};
    const double range = 2e6, y = 1e-6, z = 4e-6;
    const double apart[2][2] = {{y * y, 0.0}, {0.0, z * z}};
    bst_assert_close(bst_tasking_information_m2(ahead, range, (bst_vec3){3.0, 0.0, 0.0}, apart),
                     0.0, 0.0);
    bst_assert_close(bst_tasking_information_m2(ahead, range, (bst_vec3){0.0, -7e3, 0.0}, apart),
                     1.0 / 4.0, 1e-12);
    /* at 60 degrees from the line of sight */
    bst_assert_close(
        bst_tasking_information_m2(ahead, range, (bst_vec3){1.0, 0.0, sqrt(3.0)}, apart),
        0.75 / 64.0, 1e-12);
    /* correlation 0.6: along y + z, [1 1] C^-1 [1 1]' / 2 with C = s^2 [1 0.6; 0.6 1] */
    const double joint[2][2] = {{y * y, 0.6 * y * y}, {0.6 * y * y, y * y}};
    bst_assert_close(bst_tasking_information_m2(ahead, range, (bst_vec3){0.0, 1.0, 1.0}, joint),
                     1.0 / 1.6 / 4.0, 1e-12);
    static const double nothing[2][2];
    bst_assert_close(bst_tasking_information_m2(ahead, range, (bst_vec3){0.0, 1.0, 1.0}, nothing),
                     0.0, 0.0);
}

/* A target is due above its sigma_m, is seen, and then is not until it has grown again; the state
 * is saved. */
static void a_target_is_due_by_its_uncertainty(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{" TARGET_ ", \"sigma_m\": 500}], " REST_
              "\"catalogue_drift_m_per_day\": 1200}");
    f.tasking.along[GX5] = (bst_tasking_along){.aa = 490.0 * 490.0, .dd = 1e6};
    assert_false(plan(&f, 0, 0)); /* 490 m */
    f.tasking.along[GX5].aa = 510.0 * 510.0;
    assert_true(plan(&f, 0, 100)); /* replan_interval_s later */
    assert_int_equal(f.tasking.sensors[0].task.object, GX5);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    tracks->count = 1;
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED,
                                   .target_of_interest = true,
                                   .direction_gcrf = f.tasking.sensors[0].direction};
    tracks->items[0].covariance[0][0] = tracks->items[0].covariance[1][1] = 1e-12;
    for (int64_t k = 1; k <= 3; k++) {
        tracks->tick = 100 + 20 * k;
        bst_tasking_tracks(&f.tasking, 0, tracks);
    }
    test_free(tracks);
    assert_true(plan(&f, 0, 161));
    assert_int_equal(f.tasking.sensors[0].task.object, -1);
    /* 1e-6 rad at 4e7 m are nothing beside the 400 m of the other elements; 16 s of drift too */
    const double p = 510.0 * 510.0, left = p * 160000.0 / (p + 160000.0);
    bst_assert_close(pow(bst_tasking_sigma_m(&f.tasking, GX5, 16.0), 2) / left, 1.0, 0.01);
    assert_false(plan(&f, 1, 1000));
    /* sqrt(500^2 - left) m of drift at 1000 m a day: 9.4 h */
    const double due_s = 86400.0 * sqrt(250000.0 - left) / 1000.0;
    bst_assert_close(bst_tasking_sigma_m(&f.tasking, GX5, due_s), 500.0, 2.0);
    bst_tasking_along before = f.tasking.along[GX5];
    test_saved saved = test_save(archive_tasking, &f.tasking);
    f.tasking.along[GX5] = (bst_tasking_along){.aa = 1.0};
    bst_assert_ok(&f.ctx, test_restore(&f.ctx, archive_tasking, &f.tasking, saved));
    free(saved.bytes);
    assert_memory_equal(&f.tasking.along[GX5], &before, sizeof before);
    tear_down(&f);
}

/* A place that drifts fast counts at the time of its last sighting: what the track says of it then
 * is 400 m and the track's own 38 m across the motion beside what was known at that time. */
static void a_sighting_counts_at_its_time(void **state) {
    (void)state;
    fixture f;
    start(&f, "{\"targets\": [{" TARGET_ ", \"sigma_m\": 500}], " REST_
              "\"catalogue_drift_m_per_day\": 1200}");
    const double drift_mps = 100.0, seen_s = 16.0;
    f.tasking.along[GX5] =
        (bst_tasking_along){.aa = 510.0 * 510.0, .dd = pow(86400.0 * drift_mps, 2)};
    assert_true(plan(&f, 0, 0));
    assert_int_equal(f.tasking.sensors[0].task.object, GX5);
    bst_tracks *tracks = test_calloc(1, sizeof *tracks + sizeof tracks->items[0]);
    tracks->count = 1;
    tracks->items[0] = (bst_track){.status = BST_TRACK_CONFIRMED,
                                   .target_of_interest = true,
                                   .direction_gcrf = f.tasking.sensors[0].direction};
    tracks->items[0].covariance[0][0] = tracks->items[0].covariance[1][1] = 1e-12;
    f.tasking.sensors[0].arrival_s = 0.5 * seen_s; /* not the time that counts */
    for (int64_t k = 0; k < 3; k++) {
        tracks->tick = (int64_t)(10.0 * seen_s) - 20 * (2 - k);
        bst_tasking_tracks(&f.tasking, 0, tracks);
    }
    test_free(tracks);
    assert_true(plan(&f, 0, 161));
    assert_int_equal(f.tasking.sensors[0].task.object, -1);
    const double known = 510.0 * 510.0 + pow(drift_mps * seen_s, 2);
    const double said = 400.0 * 400.0 + 38.0 * 38.0;
    bst_assert_close(
        pow(bst_tasking_sigma_m(&f.tasking, GX5, seen_s), 2) * (1.0 / known + 1.0 / said), 1.0,
        0.01); /* the track's 38 m, which the angle to the motion makes more */
    tear_down(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_grows_as_the_catalogue_ages),
                                       cmocka_unit_test(tracks_count_as_in_a_fit),
                                       cmocka_unit_test(directions_tell_what_lies_across_them),
                                       cmocka_unit_test(a_target_is_due_by_its_uncertainty),
                                       cmocka_unit_test(a_sighting_counts_at_its_time)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
