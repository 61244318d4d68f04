/* Objects out of catalogues. */
#include "sim/world/name_index.h"
#include "tests/io/scratch.h"
#include "tests/world/world_support.h"

/* The mean anomaly, the name and the epoch are all that differs. Checksums of the two lines follow
 * from their digits. */
static int checksum(const char *line) {
    int sum = 0;
    for (int i = 0; i < 68; i++) {
        sum += line[i] >= '0' && line[i] <= '9' ? line[i] - '0' : line[i] == '-';
    }
    return sum % 10;
}

static void write_set(FILE *file, const char *name, int norad, double epoch_day) {
    char line1[80], line2[80];
    snprintf(line1, sizeof line1, "1 %05dU 19080B   22%012.8f  .00000075  00000+0  00000+0 0  999",
             norad, epoch_day);
    snprintf(line2, sizeof line2,
             "2 %05d   0.0366 343.6423 0001933 100.2390 191.6441  1.00270919  944", norad);
    if (*name) {
        fprintf(file, "%s\n", name);
    }
    fprintf(file, "%s%d\n%s%d\n", line1, checksum(line1), line2, checksum(line2));
}

static bst_status make(bst_ctx *ctx, const char *objects, const char *catalogues,
                       bst_world **world) {
    char text[8000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [%s], \"catalogues\": "
             "[%s]}, \"observers\": [{\"name\": \"n\", " TEST_NEOSSAT
             ", \"sensors\": [{" TEST_CAMERA "}]}]}",
             objects, catalogues);
    return test_world_try(ctx, TEST_EPOCH, text, world);
}

static void a_catalogue_adds_each_satellite_once(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    const char *path = scratch_path(&s, "sets.tle");
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    write_set(file, "DEBRIS", 10001, 166.0);
    write_set(file, "DEBRIS", 10002, 166.0);
    write_set(file, "", 10003, 166.0);
    write_set(file, "DEBRIS", 10001, 167.9); /* nearer to the epoch, 167.92 */
    write_set(file, "GX5 AGAIN", 44801, 167.0);
    fclose(file);
    char catalogue[1200];
    snprintf(catalogue, sizeof catalogue,
             "{\"elements_file\": \"%s\", \"area_m2\": 2, \"albedo\": 0.5}", path);
    bst_ctx ctx = {0};
    bst_world *world;
    bst_assert_ok(&ctx, make(&ctx, "{\"name\": \"GX5\", " TEST_GX5 "}", catalogue, &world));
    assert_int_equal(bst_world_object_count(world), 4);
    static const char *const names[] = {"GX5", "DEBRIS", "NORAD 10003", "DEBRIS 10001"};
    static const int numbers[] = {44801, 10002, 10003, 10001};
    for (int i = 0; i < 4; i++) {
        const bst_world_object_info *info = bst_world_object(world, i);
        assert_string_equal(info->name, names[i]);
        assert_int_equal(info->norad, numbers[i]);
        assert_int_equal(bst_world_find_object(world, names[i]), i);
    }
    assert_true(bst_world_object(world, 1)->area_m2 == 2.0);
    assert_true(bst_world_object(world, 1)->albedo == 0.5);
    assert_int_equal(bst_world_find_object(world, "GX5 AGAIN"), -1);
    /* of 10001's two sets the one whose epoch is nearest: 0.02 days from the scenario's; rounding
     * of the epoch to 1e-8 days is 1 ms */
    double wanted_s = (22.0 + 10.0 / 60.0) * 3600.0 - 0.9 * 86400.0;
    assert_true(fabs(world->objects[3].orbit.epoch_offset_s - wanted_s) < 2e-3);
    bst_world_free(world);

    assert_int_equal(make(&ctx, "", "{\"elements_file\": \"nowhere.tle\"}", &world),
                     BST_ERR_CONFIG);
    assert_string_equal(
        ctx.message,
        "test: /world/catalogues/0/elements_file: nowhere.tle: cannot be opened: "
        "No such file or directory; give a file of element sets (TLE, or OMM as JSON or CSV)");
    scratch_remove(&s);
}

/* Each object has area, albedo and brightness of its own catalogue, whatever their sizes. */
static void two_catalogues_have_settings_of_their_own(void **state) {
    (void)state;
    scratch s;
    scratch_make(&s);
    char catalogues[4400], path[2][sizeof s.path];
    for (int c = 0; c < 2; c++) {
        snprintf(path[c], sizeof path[c], "%s", scratch_path(&s, c ? "b.tle" : "a.tle"));
        FILE *file = fopen(path[c], "w");
        assert_non_null(file);
        for (int i = 0; i < 3 - c; i++) {
            write_set(file, "", 10001 + 2 * i + 100 * c, 166.0);
        }
        fclose(file);
    }
    snprintf(
        catalogues, sizeof catalogues,
        "{\"elements_file\": \"%s\", \"area_m2\": 2, \"albedo\": 0.5, \"brightness\": "
        "{\"model\": \"standard_magnitude\", \"standard_v_mag\": 5}}, {\"elements_file\": \"%s\", "
        "\"area_m2\": 3, \"albedo\": 0.1, \"brightness\": {\"model\": \"standard_magnitude\", "
        "\"standard_v_mag\": 7}}",
        path[0], path[1]);
    bst_ctx ctx = {0};
    bst_world *world;
    bst_assert_ok(&ctx,
                  make(&ctx,
                       "{\"name\": \"GX5\", \"brightness\": {\"model\": \"standard_magnitude\", "
                       "\"standard_v_mag\": 9}, " TEST_GX5 "}",
                       catalogues, &world));
    assert_int_equal(bst_world_object_count(world), 6);
    assert_true(bst_brightness_config_of(bst_world_object(world, 0)->brightness)->standard_v_mag ==
                9.0);
    for (int i = 1; i < 6; i++) {
        const bst_world_object_info *info = bst_world_object(world, i);
        const bool second = info->norad > 10100;
        assert_true(info->area_m2 == (second ? 3.0 : 2.0) && info->albedo == (second ? 0.1 : 0.5));
        assert_true(bst_brightness_config_of(info->brightness)->standard_v_mag ==
                    (second ? 7.0 : 5.0));
    }
    bst_world_free(world);
    scratch_remove(&s);
}

static void an_index_finds_what_was_added(void **state) {
    (void)state;
    enum { NAMES = 20000 };
    static char names[NAMES][16];
    bst_ctx ctx = {0};
    bst_name_index *index;
    bst_assert_ok(&ctx, bst_name_index_create(&ctx, NAMES, &index));
    for (int i = 0; i < NAMES; i++) {
        snprintf(names[i], sizeof names[i], "SAT %d", i);
        assert_int_equal(bst_name_index_find(index, names[i]), -1);
        bst_name_index_add(index, names[i], i);
    }
    for (int i = 0; i < NAMES; i++) {
        assert_int_equal(bst_name_index_find(index, names[i]), i);
    }
    assert_int_equal(bst_name_index_find(index, ""), -1);
    bst_name_index_free(index);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_catalogue_adds_each_satellite_once),
        cmocka_unit_test(two_catalogues_have_settings_of_their_own),
        cmocka_unit_test(an_index_finds_what_was_added),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
