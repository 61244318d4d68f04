/* When a target is looked at before it is given to a sensor: on arrival and at the last wanted
 * frame. The linker puts the look here in the place of the tasking's. */
#include "tests/control/tasking_fixture.h"

enum { LOOKS = 16 };

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

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_seen_until_its_last_frame)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
