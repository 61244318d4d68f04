/* Attitudes of an exposure from the history of the line of sight. */
#include "tests/world/field_scene.h"

static void the_ring_may_have_wrapped(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    bst_los_history *h = s.history;
    for (int capacity = 100; capacity <= HISTORY; capacity += HISTORY - 100) {
        h->capacity = capacity;
        h->written = 0;
        for (int64_t n = 0; n < 777; n++) {
            /* each second sample with the other sign: the same attitude */
            bst_quat q = turned(s.target, 0.1 * (double)n, 0, 0);
            push(h, 6 * n, n % 2 ? (bst_quat){-q.x, -q.y, -q.z, -q.w} : q);
        }
        bst_los_track t;
        /* between samples 700 and 770: ticks 4203 (half way) to 4618 (two thirds of a step) */
        bst_assert_ok(&s.ctx, bst_field_track(&s.ctx, s.field, h, 4203, 4618, RATE, &t));
        assert_int_equal(t.count, 71); /* the ends and 701 to 769 */
        bst_assert_close(t.time_s[0], 0, 0);
        bst_assert_close(t.time_s[1], 3.0 / RATE, 1e-15);
        bst_assert_close(t.time_s[70], 415.0 / RATE, 1e-15);
        for (int k = 0; k < t.count; k++) {
            double sample = (4203 + t.time_s[k] * RATE) / 6;
            bst_quat want = turned(s.target, 0.1 * sample, 0, 0);
            bst_vec3 off =
                bst_quat_to_rotvec(bst_quat_mul(t.q_cam_from_gcrf[k], bst_quat_conj(want)));
            bst_assert_close(bst_vec3_norm(off), 0, 1e-14);
            if (k > 0) { /* neighbouring signs agree */
                bst_quat a = t.q_cam_from_gcrf[k - 1], b = t.q_cam_from_gcrf[k];
                assert_true(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w > 0.99);
            }
        }
    }
    free_scene(&s);
}

static void an_exposure_outside_the_history_is_refused(void **state) {
    (void)state;
    scene s = make_scene(GX5);
    bst_los_history *h = s.history;
    bst_los_track t;
    assert_int_equal(bst_field_track(&s.ctx, s.field, h, 0, 10, RATE, &t), BST_ERR_STATE);
    h->capacity = 100;
    for (int64_t n = 0; n < 150; n++) {
        push(h, 6 * n, s.target);
    }
    /* the ring holds samples 50 to 149: ticks 300 to 894 */
    bst_assert_ok(&s.ctx, bst_field_track(&s.ctx, s.field, h, 300, 894, RATE, &t));
    assert_int_equal(t.count, 100);
    assert_int_equal(bst_field_track(&s.ctx, s.field, h, 299, 894, RATE, &t), BST_ERR_STATE);
    assert_string_equal(s.ctx.message,
                        "the line-of-sight history (ticks 300 to 894) does not cover the exposure "
                        "(299 to 894): give the gimbal a longer history_s or a rate that divides "
                        "the exposure");
    assert_int_equal(bst_field_track(&s.ctx, s.field, h, 300, 895, RATE, &t), BST_ERR_STATE);
    free_scene(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_ring_may_have_wrapped),
        cmocka_unit_test(an_exposure_outside_the_history_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
