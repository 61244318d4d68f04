/* How far joints are turned and where they are: following within limits, spinning, turning at a
 * burn, on a joint that turns itself. */
#include "tests/satellite/satellite_support.h"

#define PLATE(joint)                                                 \
    "{\"name\": \"" joint                                            \
    "\", \"kind\": \"plate\", \"size_m\": [1, 1, 1], \"material\": " \
    "\"w\", \"joint\": \"" joint "\"}"

static const char model[] =
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}], \"joints\": ["
    "{\"name\": \"array\", \"follows\": \"sun\", \"offset_deg\": 10, \"limit_deg\": [-40, 70]},"
    "{\"name\": \"spun\", \"follows\": \"spin\", \"axis\": [0, 0, 1], \"normal\": [1, 0, 0],"
    " \"offset_deg\": 10, \"rate_deg_per_s\": 0.5, \"position_m\": [1, 2, 3]},"
    "{\"name\": \"dish\", \"parent\": \"spun\", \"follows\": \"target\", \"axes\": 2,"
    " \"axis\": [1, 0, 0], \"normal\": [0, 0, 1], \"position_m\": [4, 5, 6]},"
    "{\"name\": \"boom\", \"follows\": \"burn\", \"axis\": [1, 0, 0], \"offset_deg\": 5,"
    " \"rate_deg_per_s\": 2, \"turn_deg\": -50, \"burn\": 2},"
    "{\"name\": \"antenna\", \"follows\": \"earth\", \"axis\": [1, 0, 0]},"
    "{\"name\": \"wing\", \"follows\": \"sun\", \"axes\": 2}], "
    "\"parts\": [" PLATE("array") ", " PLATE("spun") ", " PLATE("dish") ", " PLATE(
        "boom") ", " PLATE("antenna") ", " PLATE("wing") "]}";

enum { ARRAY, SPUN, DISH, BOOM, ANTENNA, WING };

static bst_vec3 turned(const bst_test_model *m, int joint, bst_vec3 v) {
    return bst_mat3_mul_vec(&m->pose->rotation[joint], v);
}

static void expect(bst_vec3 found, double x, double y, double z) {
    bst_assert_close(found.x, x, 1e-12);
    bst_assert_close(found.y, y, 1e-12);
    bst_assert_close(found.z, z, 1e-12);
}

static void follows_within_limits(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(model);
    /* the Sun's angle from z to x about y, and the joint's: limits are before the offset */
    static const double cases[][2] = {{30, 40}, {-25, -15}, {100, 80}, {-60, -30}};
    for (int i = 0; i < 4; i++) {
        double sun = cases[i][0] * BST_DEG_RAD, own = cases[i][1] * BST_DEG_RAD;
        /* what lies along the axis does not matter */
        bst_vec3 d = bst_vec3_unit((bst_vec3){sin(sun), 0.4, cos(sun)});
        bst_satellite_pose_set(
            m.pose, &(bst_satellite_aim){.sun = d, .earth = {0, 0, 1}, .target = {1, 0, 0}});
        expect(turned(&m, ARRAY, (bst_vec3){0, 0, 1}), sin(own), 0, cos(own));
        expect(turned(&m, ARRAY, (bst_vec3){0, 1, 0}), 0, 1, 0);
    }
    bst_test_model_close(&m);
}

/* A dish of two axes on a joint that has turned by 10 + 0.5 x 100 degrees about z. */
static void on_a_joint_that_spins(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(model);
    bst_vec3 to = bst_vec3_unit((bst_vec3){-0.3, 0.8, 0.45});
    bst_satellite_pose_set(
        m.pose,
        &(bst_satellite_aim){.sun = {0, 0, 1}, .earth = {0, 0, 1}, .target = to, .seconds = 100});
    double c = cos(60 * BST_DEG_RAD), s = sin(60 * BST_DEG_RAD);
    expect(turned(&m, SPUN, (bst_vec3){1, 0, 0}), c, s, 0);
    expect(turned(&m, SPUN, (bst_vec3){0, 1, 0}), -s, c, 0);
    expect(m.pose->origin[SPUN], 1, 2, 3);
    expect(turned(&m, DISH, (bst_vec3){0, 0, 1}), to.x, to.y, to.z);
    expect(m.pose->origin[DISH], 1 + 4 * c - 5 * s, 2 + 4 * s + 5 * c, 9);
    bst_test_model_close(&m);
}

/* From the second burn on, at 2 degrees/s down to 50 below the offset of 5. */
static void at_a_burn(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(model);
    static const double burns_s[] = {20, 100}, times_s[] = {90, 110, 124, 300},
                        deg[] = {5, -15, -43, -45};
    m.pose->burn_s = burns_s;
    m.pose->burn_count = 2;
    for (int i = 0; i < 4; i++) {
        bst_satellite_pose_set(
            m.pose,
            &(bst_satellite_aim){
                .sun = {0, 0, 1}, .earth = {0, 0, 1}, .target = {1, 0, 0}, .seconds = times_s[i]});
        double a = deg[i] * BST_DEG_RAD;
        expect(turned(&m, BOOM, (bst_vec3){0, 0, 1}), 0, -sin(a), cos(a));
    }
    bst_test_model_close(&m);
}

/* An antenna about x toward the Earth, a wing of two axes toward the Sun. */
static void each_follows_its_own(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(model);
    double a = 130 * BST_DEG_RAD;
    bst_vec3 sun = bst_vec3_unit((bst_vec3){0.2, -0.7, -0.5}),
             earth = bst_vec3_unit((bst_vec3){0.6, -sin(a), cos(a)});
    bst_satellite_pose_set(m.pose,
                           &(bst_satellite_aim){.sun = sun, .earth = earth, .target = {1, 0, 0}});
    expect(turned(&m, ANTENNA, (bst_vec3){0, 0, 1}), 0, -sin(a), cos(a));
    expect(turned(&m, ANTENNA, (bst_vec3){1, 0, 0}), 1, 0, 0);
    expect(turned(&m, WING, (bst_vec3){0, 0, 1}), sun.x, sun.y, sun.z);
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(follows_within_limits),
        cmocka_unit_test(on_a_joint_that_spins),
        cmocka_unit_test(at_a_burn),
        cmocka_unit_test(each_follows_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
