#include "boresight/vec.h"
#include "tests/test_support.h"

static void assert_vec(bst_vec3 a, bst_vec3 e, double tol) {
    bst_assert_close(a.x, e.x, tol);
    bst_assert_close(a.y, e.y, tol);
    bst_assert_close(a.z, e.z, tol);
}

static void quaternion_and_matrix_agree(void **state) {
    (void)state;
    bst_quat q = bst_quat_unit((bst_quat){0.1, -0.7, 0.3, 0.5});
    bst_mat3 m = bst_quat_to_mat3(q);
    bst_vec3 v = {1.5, -2.0, 0.25};
    assert_vec(bst_quat_rotate(q, v), bst_mat3_mul_vec(&m, v),
               1e-15 * 8); /* rounding of a few products */
    bst_quat p = bst_quat_from_mat3(&m);
    bst_assert_close(fabs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w), 1.0, 1e-15 * 4);
}

/* Every branch of Shepperd's method, and the exact half turns. */
static void matrix_to_quaternion_at_half_turns(void **state) {
    (void)state;
    const bst_quat cases[] = {
        {1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}, {0.6, 0.8, 0, 1e-12}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_quat q = bst_quat_unit(cases[i]);
        bst_mat3 m = bst_quat_to_mat3(q);
        bst_quat p = bst_quat_from_mat3(&m);
        bst_assert_close(fabs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w), 1.0, 1e-15 * 4);
    }
}

static void rotation_vectors_round_trip(void **state) {
    (void)state;
    const double angles[] = {0.0, 1e-16, 1e-9, 1e-4, 0.5, 3.0, BST_PI - 1e-9};
    bst_vec3 axis = bst_vec3_unit((bst_vec3){1, -2, 3});
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i++) {
        bst_vec3 r = bst_vec3_scale(axis, angles[i]);
        bst_quat q = bst_quat_from_rotvec(r);
        assert_vec(bst_quat_to_rotvec(q), r, 1e-15 * 8);
        bst_quat antipode = {-q.x, -q.y, -q.z, -q.w};
        assert_vec(bst_quat_to_rotvec(antipode), r, 1e-15 * 8);
    }
}

static void arc_tangents_are_those_of_the_library(void **state) {
    (void)state;
    for (int i = -400; i <= 400; i++) {
        /* the series' range and both of its edges; a last digit or two of the angle */
        double y = 0.0125 * 3.0 * i / 400.0, angle = atan2(y, 3.0);
        bst_assert_close(bst_atan2(y, 3.0), angle, 4e-16 * fabs(angle));
        assert_true(bst_atan2(y, -3.0) == atan2(y, -3.0));
    }
    assert_true(bst_atan2(0.0, 0.0) == 0.0);
    assert_true(bst_atan2(1.0, 0.0) == atan2(1.0, 0.0));
}

static void slerp_takes_the_short_way(void **state) {
    (void)state;
    bst_quat a = BST_QUAT_IDENTITY;
    bst_quat b = bst_quat_from_rotvec((bst_vec3){0, 0, 0.8});
    bst_quat minus_b = {-b.x, -b.y, -b.z, -b.w};
    assert_vec(bst_quat_to_rotvec(bst_quat_slerp(a, b, 0.25)), (bst_vec3){0, 0, 0.2}, 1e-15);
    assert_vec(bst_quat_to_rotvec(bst_quat_slerp(a, minus_b, 0.25)), (bst_vec3){0, 0, 0.2}, 1e-15);
    assert_vec(bst_quat_to_rotvec(bst_quat_slerp(a, a, 0.5)), (bst_vec3){0, 0, 0}, 0.0);
}

static void look_survives_parallel_vectors(void **state) {
    (void)state;
    const bst_vec3 z = {0.3, -0.4, 0.2};
    const bst_vec3 hints[] = {{0.3, -0.4, 0.2}, {-0.3, 0.4, -0.2}, {0, 0, 0}, {1, 0, 0}};
    for (size_t i = 0; i < sizeof hints / sizeof *hints; i++) {
        bst_quat q = bst_quat_look(z, hints[i]);
        assert_vec(bst_quat_rotate(q, bst_vec3_unit(z)), (bst_vec3){0, 0, 1}, 1e-15 * 4);
    }
    bst_quat q = bst_quat_look((bst_vec3){0, 0, 2}, (bst_vec3){1, 0, 1});
    assert_vec(bst_quat_rotate(q, (bst_vec3){1, 0, 0}), (bst_vec3){1, 0, 0}, 1e-15 * 4);
    /* a hint that is nearly parallel still says where x is */
    for (double beside = 0.1; beside > 1e-7; beside *= 0.01) {
        q = bst_quat_look((bst_vec3){0, 0, 3}, (bst_vec3){-0.6 * beside, 0.8 * beside, -2});
        assert_vec(bst_quat_rotate(q, (bst_vec3){-0.6, 0.8, 0}), (bst_vec3){1, 0, 0},
                   1e-15 / beside + 1e-15 * 4);
    }
}

static void angle_is_accurate_at_both_ends(void **state) {
    (void)state;
    bst_assert_close(bst_vec3_angle((bst_vec3){1, 0, 0}, (bst_vec3){1, 1e-12, 0}), 1e-12, 1e-27);
    bst_assert_close(bst_vec3_angle((bst_vec3){1, 0, 0}, (bst_vec3){-1, 1e-9, 0}), BST_PI - 1e-9,
                     1e-15);
}

static void radec_wraps(void **state) {
    (void)state;
    double ra, dec;
    bst_vec3_to_radec(bst_vec3_from_radec(6.2, -1.5), &ra, &dec);
    bst_assert_close(ra, 6.2, 1e-13); /* near the pole RA loses 1/cos(dec) = 14 */
    bst_assert_close(dec, -1.5, 1e-15);
    bst_vec3_to_radec((bst_vec3){0, 0, -2}, &ra, &dec);
    bst_assert_close(dec, -BST_PI / 2, 0.0);
}

/* A frame that turns by r about its own axis sees a fixed vector turn by -r. */
static void frames_turn_against_what_they_see(void **state) {
    (void)state;
    const double fixed[3] = {1.0, 0.0, 0.0};
    bst_quat q = bst_quat_turn_frame(BST_QUAT_IDENTITY, (bst_vec3){0.0, 0.0, 0.5 * BST_PI});
    /* rounding of a few products */
    assert_vec(bst_quat_rotate(q, bst_vec3_from_array(fixed)), (bst_vec3){0.0, -1.0, 0.0}, 1e-15);
    /* two turns of a quarter are a half one, each about the frame's own axis */
    q = bst_quat_turn_frame(q, (bst_vec3){0.0, 0.0, 0.5 * BST_PI});
    assert_vec(bst_quat_rotate(q, bst_vec3_from_array(fixed)), (bst_vec3){-1.0, 0.0, 0.0}, 1e-15);
}

static void angles_wrap_to_the_half_open_turn(void **state) {
    (void)state;
    const double cases[][2] = {{0.0, 0.0},          {BST_PI, BST_PI},        {-BST_PI, BST_PI},
                               {-3.0, -3.0},        {3.5, 3.5 - 2 * BST_PI}, {2 * BST_PI, 0.0},
                               {7 * BST_PI, BST_PI}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        /* rounding of angles up to 22 */
        bst_assert_close(bst_wrap_angle(cases[i][0]), cases[i][1], 8e-15);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quaternion_and_matrix_agree),
        cmocka_unit_test(matrix_to_quaternion_at_half_turns),
        cmocka_unit_test(rotation_vectors_round_trip),
        cmocka_unit_test(arc_tangents_are_those_of_the_library),
        cmocka_unit_test(slerp_takes_the_short_way),
        cmocka_unit_test(look_survives_parallel_vectors),
        cmocka_unit_test(angle_is_accurate_at_both_ends),
        cmocka_unit_test(radec_wraps),
        cmocka_unit_test(frames_turn_against_what_they_see),
        cmocka_unit_test(angles_wrap_to_the_half_open_turn),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
