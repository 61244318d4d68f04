/* Marks of a frame of a run in progress: pixels of a window off the corner that is binned by 3. */
#include "view/live_marks.h"

#include "boresight/vec.h"
#include "tests/test_support.h"

static const bst_frame_message frame = {.window = {36, 90, 300, 210}, .binning = 3};

static double number(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    if (!cJSON_IsNumber(item)) {
        fail_msg("%s is no number", key);
    }
    return item->valuedouble;
}

#define SAME(node, key, value) bst_assert_close(number(node, key), value, 1e-9)

static const char *text(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    assert_true(cJSON_IsString(item));
    return item->valuestring;
}

/* Pixel of the frame whose three pixels begin at the window's corner. */
static double binned(double sensor_px, double from_px) {
    return (sensor_px - (from_px + 1.0)) / 3.0;
}

static void detections_are_in_pixels_of_the_frame(void **state) {
    (void)state;
    bst_detections *d = calloc(1, sizeof *d + 2 * sizeof d->items[0]);
    d->count = 2;
    d->items[0].label = BST_LABEL_HIT;
    d->items[1] = (bst_detection){.x_px = 120.25,
                                  .y_px = 100.5,
                                  .cov_xx = 0.18,
                                  .cov_xy = -0.09,
                                  .cov_yy = 0.36,
                                  .flux_e = 2000.0,
                                  .snr = 15.0,
                                  .length_px = 18.0,
                                  .angle_rad = -0.25 * BST_PI,
                                  .v_mag = 8.25,
                                  .star_id = 99,
                                  .label = BST_LABEL_STAR};
    cJSON *node = cJSON_CreateObject();
    bst_view_add_live_detections(node, d, &frame);
    const cJSON *list = cJSON_GetObjectItem(node, "detections");
    assert_int_equal(cJSON_GetArraySize(list), 2);
    assert_string_equal(text(list->child, "label"), "hit");
    const cJSON *mark = list->child->next;
    assert_string_equal(text(mark, "label"), "star");
    SAME(mark, "star_id", 99);
    SAME(mark, "x", binned(120.25, 36));
    SAME(mark, "y", binned(100.5, 90));
    SAME(mark, "xx", 0.02);
    SAME(mark, "xy", -0.01);
    SAME(mark, "yy", 0.04);
    SAME(mark, "flux_e", 2000.0);
    SAME(mark, "snr", 15.0);
    SAME(mark, "length", 6.0);
    SAME(mark, "angle_deg", -45.0);
    SAME(mark, "v_mag", 8.25);
    cJSON_Delete(node);
    free(d);
}

static void tracks_are_in_pixels_of_the_frame(void **state) {
    (void)state;
    bst_tracks *t = calloc(1, sizeof *t + sizeof t->items[0]);
    double ra = 200.0 * BST_PI / 180.0, dec = -35.0 * BST_PI / 180.0;
    t->count = 1;
    t->items[0] = (bst_track){.id = 12,
                              .status = BST_TRACK_COASTING,
                              .target_of_interest = true,
                              .direction_gcrf = {cos(ra) * cos(dec), sin(ra) * cos(dec), sin(dec)},
                              .v_mag = 9.5,
                              .snr = 7.5,
                              .misses_in_row = 4,
                              .x_px = 200.0,
                              .y_px = 150.0};
    cJSON *node = cJSON_CreateObject();
    bst_view_add_live_tracks(node, t, &frame);
    const cJSON *mark = cJSON_GetObjectItem(node, "tracks")->child;
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(mark, "now")));
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(mark, "target")));
    assert_string_equal(text(mark, "status"), "coasting");
    SAME(mark, "id", 12);
    SAME(mark, "x", binned(200.0, 36));
    SAME(mark, "y", binned(150.0, 90));
    SAME(mark, "snr", 7.5);
    SAME(mark, "ra_deg", 200.0);
    SAME(mark, "dec_deg", -35.0);
    SAME(mark, "misses", 4);
    SAME(mark, "v_mag", 9.5);
    cJSON_Delete(node);
    free(t);
}

/* Places of the truth, and a WCS that shows a catalogue direction there: gnomonic projection. */
static void truth_and_wcs_agree(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 640, .height_px = 480, .pixel_scale_arcsec = 20.0};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    bst_truth *t = calloc(1, sizeof *t + 2 * sizeof t->items[0]);
    bst_quat q = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    bst_vec3 star = bst_quat_rotate(bst_quat_conj(q), bst_camera_unproject(&camera, 150.0, 260.0));
    t->q_cam_from_gcrf_mean = q;
    t->sun_m = (bst_vec3){1.5e11, 0.0, 0.0};
    t->count = 2;
    t->items[1] = (bst_truth_item){.kind = BST_SOURCE_OBJECT,
                                   .id = 7,
                                   .norad = 25544,
                                   .flags = BST_TRUTH_IN_FIELD,
                                   .x_centroid_px = 150.0,
                                   .y_centroid_px = 260.0,
                                   .v_mag = 8.5,
                                   .snr = 12.0};
    cJSON *node = cJSON_CreateObject();
    bst_view_add_live_truth(node, t, &frame, &camera);
    const cJSON *list = cJSON_GetObjectItem(node, "truth"), *mark = list->child;
    assert_int_equal(cJSON_GetArraySize(list), 1); /* the other one is not in the field */
    assert_string_equal(text(mark, "kind"), "object");
    SAME(mark, "id", 7);
    SAME(mark, "norad", 25544);
    SAME(mark, "v_mag", 8.5);
    SAME(mark, "snr", 12.0);
    SAME(mark, "x", binned(150.0, 36));
    SAME(mark, "y", binned(260.0, 90));
    const cJSON *w = cJSON_GetObjectItem(node, "wcs");
    double n[8];
    static const char *const keys[3] = {"crpix", "crval_deg", "cd_deg"};
    for (int i = 0; i < 8; i++) {
        int k = i < 4 ? i / 2 : 2;
        n[i] =
            cJSON_GetArrayItem(cJSON_GetObjectItem(w, keys[k]), i < 4 ? i % 2 : i - 4)->valuedouble;
    }
    /* tangent plane at crval: xi and eta of the star, back through cd */
    double rad = BST_PI / 180.0, ra0 = n[2] * rad, dec0 = n[3] * rad;
    bst_vec3 centre = {cos(ra0) * cos(dec0), sin(ra0) * cos(dec0), sin(dec0)},
             east = {-sin(ra0), cos(ra0), 0.0}, north = bst_vec3_cross(centre, east);
    double along = bst_vec3_dot(star, centre), xi = bst_vec3_dot(star, east) / along / rad,
           eta = bst_vec3_dot(star, north) / along / rad, det = n[4] * n[7] - n[5] * n[6];
    double x = n[0] - 1.0 + (n[7] * xi - n[5] * eta) / det,
           y = n[1] - 1.0 + (n[4] * eta - n[6] * xi) / det;
    /* an observer at rest; the Sun bends light by less than 0.1 arcsec there */
    bst_assert_close(x, binned(150.0, 36), 5e-3);
    bst_assert_close(y, binned(260.0, 90), 5e-3);
    cJSON_Delete(node);
    free(t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(detections_are_in_pixels_of_the_frame),
        cmocka_unit_test(tracks_are_in_pixels_of_the_frame),
        cmocka_unit_test(truth_and_wcs_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
