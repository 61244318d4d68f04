/* The interpolated direction of the ideal gimbal against a closed form. */
#include "gimbal/ideal.h"
#include "tests/test_support.h"

typedef struct pass {
    int calls;
    double earliest, latest, fail_after;
} pass;

/* A straight fly-by: 500 km at closest approach (t = 20 s), 15 km/s. */
static bst_status fly_by(void *user, bst_ctx *ctx, double seconds, bst_vec3 *direction) {
    pass *p = user;
    p->calls++;
    p->earliest = fmin(p->earliest, seconds);
    p->latest = fmax(p->latest, seconds);
    if (seconds > p->fail_after) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "no orbit");
    }
    *direction = bst_vec3_unit((bst_vec3){15e3 * (seconds - 20.0), 500e3, 40e3});
    return BST_OK;
}

static void interpolation_is_good_to_a_nanoradian(void **state) {
    (void)state;
    pass p = {.fail_after = INFINITY};
    bst_ideal ideal = {.direction_at = fly_by, .user = &p};
    bst_ctx ctx = {0};
    double worst = 0.0;
    for (int n = 0; n <= 40000; n++) {
        double t = n * 1e-3;
        bst_vec3 got = {0}, want = {0};
        bst_assert_ok(&ctx, bst_ideal_at(&ideal, &ctx, t, &got));
        pass q = {.fail_after = INFINITY};
        bst_assert_ok(&ctx, fly_by(&q, &ctx, t, &want));
        worst = fmax(worst, bst_vec3_angle(got, want));
    }
    assert_true(worst < 1e-9);   /* what pointing truth is allowed */
    assert_true(p.calls <= 405); /* ten a second and the first cells' */
    assert_true(p.earliest >= 0.0);
    assert_true(p.latest <= 40.0 + 0.2 + 1e-9);
}

static void jumps_in_time_and_failures(void **state) {
    (void)state;
    pass p = {.fail_after = 30.0};
    bst_ideal ideal = {.direction_at = fly_by, .user = &p};
    bst_ctx ctx = {0};
    bst_vec3 v, want;
    bst_assert_ok(&ctx, bst_ideal_at(&ideal, &ctx, 25.0, &v));
    bst_assert_ok(&ctx, bst_ideal_at(&ideal, &ctx, 3.123, &v));
    bst_assert_ok(&ctx, fly_by(&p, &ctx, 3.123, &want));
    assert_true(bst_vec3_angle(v, want) < 1e-9);
    assert_int_equal(bst_ideal_at(&ideal, &ctx, 35.0, &v), BST_ERR_NUMERIC);
    bst_assert_ok(&ctx, bst_ideal_at(&ideal, &ctx, 3.123, &v));
    assert_true(bst_vec3_angle(v, want) < 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(interpolation_is_good_to_a_nanoradian),
        cmocka_unit_test(jumps_in_time_and_failures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
