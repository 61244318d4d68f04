/* When a target is looked at before it is given to a sensor: on arrival and at the last wanted
 * frame; and which targets are. The linker puts the look here in the place of the tasking's. */
#include "tests/control/tasking_fixture.h"

enum { LOOKS = 256, SATELLITES = 600, MOST_TRIES = 200 };

static struct {
    double seconds;
    int object;
} looks[LOOKS];
static int count;
static double hidden_from_s; /* what is looked at later is behind the Earth */

bst_status __wrap_bst_tasking_look(bst_ctx *ctx, const bst_tasking *t, int sensor, int object,
                                   double seconds, bst_tasking_visibility *out);
bst_status __wrap_bst_tasking_look(bst_ctx *ctx, const bst_tasking *t, int sensor, int object,
                                   double seconds, bst_tasking_visibility *out) {
    (void)ctx;
    (void)t;
    (void)sensor;
    assert_true(count < LOOKS);
    looks[count].object = object;
    looks[count++].seconds = seconds;
    *out = (bst_tasking_visibility){.why = seconds < hidden_from_s ? BST_WHY_NOT : BST_WHY_EARTH,
                                    .snr = 100.0 - seconds};
    return BST_OK;
}

static bool give(fixture *f, double hidden_s) {
    start(f,
          "{\"targets\": [{\"object\": \"INMARSAT GX5\", \"revisit_s\": 600, \"frames\": 7}], "
          "\"min_snr\": 0, \"sun_keep_out_deg\": 0, \"settle_s\": 5}");
    count = 0;
    hidden_from_s = hidden_s;
    return plan(f, 0, 300);
}

/* At 30 s, with frames every 2 s: on arrival at 35 s, and after seven frames at 49 s. */
static void it_is_seen_until_its_last_frame(void **state) {
    (void)state;
    fixture f;
    assert_true(give(&f, 49.5));
    assert_int_equal(count, 2);
    bst_assert_close(looks[0].seconds, 35.0, 1e-9);
    bst_assert_close(looks[1].seconds, 49.0, 1e-9);
    assert_int_equal(looks[0].object, GX5);
    assert_int_equal(looks[1].object, GX5);
    assert_int_equal(f.tasking.sensors[0].task.object, GX5);
    tear_down(&f);
    /* gone before the last of them, or before it arrives */
    for (int k = 0; k < 2; k++) {
        (void)give(&f, k == 0 ? 48.5 : 34.5);
        assert_int_equal(count, 2 - k);
        assert_int_not_equal(f.tasking.sensors[0].task.object, GX5);
        tear_down(&f);
    }
}

/* Angle from an object to a direction by the table of positions; NAN: in a keep-out zone or in the
 * shadow. */
static double off_rad(const bst_tasking *t, int object, bst_vec3 from) {
    const bst_vec3 place = {t->place_m[0][object], t->place_m[1][object], t->place_m[2][object]};
    bst_vec3 direction;
    return bst_tasking_glance(&t->sensors[0], place, &direction) == BST_WHY_NOT
               ? bst_vec3_angle(from, direction)
               : NAN;
}

/* Of 600 satellites 200 are tried, those with the shortest slews in this order, those of one slew
 * in the order of the catalogue. */
static void the_nearest_targets_are_tried_in_order(void **state) {
    (void)state;
    for (int pointed = 0; pointed < 2; pointed++) {
        fixture f;
        set_up_in(
            &f,
            test_world("{\"world\": {\"star_catalogue\": \"embedded\", \"catalogues\": [{" FILE_
                       "}], \"objects\": [], \"constellations\": [{\"name\": \"W\", "
                       "\"satellites\": 600, \"planes\": 20, \"phasing\": 3, "
                       "\"inclination_deg\": 56, \"semi_major_axis_m\": 2.2e7, \"raan_deg\": "
                       "7}]}, \"observers\": [{\"name\": \"low\", \"orbit\": {" FILE_
                       ", \"norad\": 39089}, " SENSORS_ "}, {\"name\": \"high\", \"orbit\": {" FILE_
                       ", \"norad\": 39089}, " SENSORS_ "}]}"),
            "{\"targets\": [{\"perigee_km\": [15000, 17000], \"frames\": 7}]}");
        bst_assert_ok(&f.ctx, bst_tasking_init(&f.ctx, &f.tasking, &f.config, f.members, 2, 10.0));
        const bst_vec3 towards = bst_vec3_unit((bst_vec3){0.3, -0.5, 0.2});
        f.tasking.sensors[0].direction = towards;
        f.tasking.sensors[0].pointed = pointed == 1;
        count = 0;
        hidden_from_s = 0.0;
        assert_false(plan(&f, 0, 300));
        assert_int_equal(count, MOST_TRIES);
        bool tried[SATELLITES + 8] = {false};
        double last = -1.0;
        for (int k = 0; k < count; k++) {
            assert_false(tried[looks[k].object]);
            tried[looks[k].object] = true;
            double now =
                pointed ? off_rad(&f.tasking, looks[k].object, towards) : (double)looks[k].object;
            assert_true(now > last);
            last = now;
        }
        int more = 0;
        for (int i = 0; i < f.tasking.object_count; i++) {
            double off = off_rad(&f.tasking, i, towards);
            if (f.tasking.line[i] >= 0 && !tried[i] && !isnan(off)) {
                more++;
                assert_true((pointed ? off : (double)i) > last);
            }
        }
        assert_true(more > 20);
        tear_down(&f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_seen_until_its_last_frame),
                                       cmocka_unit_test(the_nearest_targets_are_tried_in_order)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
