/* Surfaces that glint, and the times at which they do, for a body that turns about z. */
#include "sim/satellite/glint.h"

#include "tests/satellite/satellite_support.h"

#define MIRRORS                                                                                \
    "\"materials\": [{\"name\": \"m\", \"library\": \"optical_solar_reflector\"}, {\"name\": " \
    "\"w\", \"diffuse\": 0.5}]"

/* A box has six directions, a cylinder one family and two ends; white surfaces have none. */
static void surfaces_with_narrow_lobes_are_found(void **state) {
    (void)state;
    static const struct {
        const char *parts;
        int surfaces;
    } cases[] = {
        {"{\"name\": \"b\", \"kind\": \"box\", \"material\": \"m\"}", 6},
        {"{\"name\": \"b\", \"kind\": \"box\", \"material\": \"m\"}, {\"name\": \"c\", \"kind\": "
         "\"box\", \"material\": \"m\", \"position_m\": [3, 0, 0]}",
         6},
        {"{\"name\": \"b\", \"kind\": \"box\", \"material\": \"w\"}", 0},
        {"{\"name\": \"s\", \"kind\": \"sphere\", \"material\": \"m\"}", 0},
        {"{\"name\": \"c\", \"kind\": \"cylinder\", \"material\": \"m\"}", 3},
        {"{\"name\": \"c\", \"kind\": \"cone\", \"radius_m\": 1, \"length_m\": 2, \"material\": "
         "\"m\"}",
         2},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[1024];
        snprintf(text, sizeof text, "{" MIRRORS ", \"parts\": [%s]}", cases[i].parts);
        bst_test_model m = bst_test_model_open(text);
        bst_glint_surface surfaces[BST_GLINT_SURFACES];
        assert_int_equal(bst_glint_surfaces(m.satellite, surfaces), cases[i].surfaces);
        for (int k = 0; k < 6 && i < 2; k++) { /* a side of 1 m^2 of each box */
            bst_assert_close(surfaces[k].area_m2, 1.0 + (double)i, 1e-9);
        }
        bst_test_model_close(&m);
    }
}

/* On each facet of a cone and a cylinder the offset of its own normal is 0. */
static void normals_of_curved_surfaces_have_no_offset(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" MIRRORS
        ", \"parts\": [{\"name\": \"c\", \"kind\": \"cone\", \"radius_m\": 1, \"top_radius_m\": "
        "0.4, \"length_m\": 2, \"segments\": 48, \"material\": \"m\", \"rotation_deg\": [20, 30, "
        "40]}]}");
    bst_glint_surface surfaces[BST_GLINT_SURFACES];
    int count = bst_glint_surfaces(m.satellite, surfaces), curved = 0;
    for (int i = 0; i < count; i++) {
        curved = surfaces[i].angle > 0 ? i : curved;
    }
    assert_true(surfaces[curved].angle > 0);
    /* of a truncated cone: pi (r + r') times the slant; the ends are circles of 48 corners */
    bst_assert_close(surfaces[curved].area_m2, BST_PI * 1.4 * hypot(2.0, 0.6), 1e-9);
    bst_assert_close(surfaces[curved].angle, atan2(2.0, 0.6), 1e-9);
    double ends = 0.0;
    for (int i = 0; i < count; i++) {
        ends += i != curved ? surfaces[i].area_m2 : 0.0;
    }
    bst_assert_close(ends, BST_PI * 1.16, 0.01);
    for (int f = 0; f < m.satellite->facet_count; f++) {
        if (m.satellite->facets[f].curved >= 0) {
            bst_assert_close(
                bst_glint_offset(&surfaces[curved], m.pose, m.satellite->facets[f].normal), 0,
                2e-3); /* facets of 7.5 degrees lie inside of the surface */
        }
    }
    bst_test_model_close(&m);
}

/* A body that turns about z, in its own frame: the half vector circles. */
typedef struct circling {
    const bst_glint_surface *surfaces;
    int count;
    const bst_satellite_pose *pose;
    double turns, height;
} circling;

static void offsets(void *user, double u, double *out) {
    const circling *c = user;
    double a = 2.0 * BST_PI * c->turns * u, r = sqrt(1.0 - c->height * c->height);
    bst_vec3 half = {r * cos(a), r * sin(a), c->height};
    for (int i = 0; i < c->count; i++) {
        out[i] = bst_glint_offset(&c->surfaces[i], c->pose, half);
    }
}

/* The half vector passes the four sides of a box at multiples of a quarter turn. */
static void glints_of_a_box_are_found(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" MIRRORS ", \"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"material\": \"m\"}]}");
    bst_glint_surface surfaces[BST_GLINT_SURFACES];
    circling c = {surfaces, bst_glint_surfaces(m.satellite, surfaces), m.pose, 1.9, 0.004};
    double times[200];
    int count = bst_glint_times(surfaces, c.count, 2.3e-3, 80, offsets, &c, times, 200);
    /* 1.9 turns: eight passages, the first at the start */
    for (int k = 0; k < 8; k++) {
        double wanted = k / (4.0 * c.turns);
        int close = 0, around = 0;
        for (int i = 0; i < count; i++) {
            double rad = fabs(times[i] - wanted) * 2.0 * BST_PI * c.turns;
            close += rad < 1e-4;
            around += rad < 0.05;
        }
        assert_true(k == 0 || close == 1);
        assert_true(around >= (k == 0 ? 4 : 9));
    }
    assert_true(count <= 8 * 9);
    /* out of reach of the lobe: none */
    c.height = 0.2;
    assert_int_equal(bst_glint_times(surfaces, c.count, 2.3e-3, 80, offsets, &c, times, 200), 0);
    /* little room: whole glints only */
    c.height = 0.0;
    assert_int_equal(bst_glint_times(surfaces, c.count, 2.3e-3, 80, offsets, &c, times, 20), 14);
    bst_test_model_close(&m);
}

/* Surfaces of one axis and lobe, but of other angles or joints, are others, in either order. */
static void surfaces_differ_by_angle_and_joint(void **state) {
    (void)state;
    static const char *const tube =
        "{\"name\": \"t\", \"kind\": \"cylinder\", \"material\": \"m\"}";
    static const char *const cup =
        "{\"name\": \"c\", \"kind\": \"cone\", \"radius_m\": 1, \"top_radius_m\": 0.5, "
        "\"length_m\": 1, \"position_m\": [0, 0, 5], \"material\": \"m\"}";
    for (int k = 0; k < 2; k++) {
        char text[1024];
        snprintf(text, sizeof text, "{" MIRRORS ", \"parts\": [%s, %s]}", k ? tube : cup,
                 k ? cup : tube);
        bst_test_model m = bst_test_model_open(text);
        bst_glint_surface surfaces[BST_GLINT_SURFACES];
        /* two ends that both have, and two sides */
        assert_int_equal(bst_glint_surfaces(m.satellite, surfaces), 4);
        bst_test_model_close(&m);
    }
    bst_test_model m = bst_test_model_open(
        "{" MIRRORS
        ", \"joints\": [{\"name\": \"j\", \"follows\": \"spin\"}], \"parts\": ["
        "{\"name\": \"b\", \"kind\": \"box\", \"material\": \"m\"}, "
        "{\"name\": \"c\", \"kind\": \"box\", \"joint\": \"j\", \"material\": \"m\"}]}");
    bst_glint_surface surfaces[BST_GLINT_SURFACES];
    assert_int_equal(bst_glint_surfaces(m.satellite, surfaces), 12);
    /* the offset turns with the joint: about z by 0.4 rad */
    m.pose->rotation[0] = bst_quat_to_mat3(bst_quat_from_rotvec((bst_vec3){0, 0, 0.4}));
    for (int joint = -1; joint <= 0; joint++) {
        const bst_glint_surface s = {
            .joint = joint, .axis = bst_vec3_unit((bst_vec3){0.6, 0, 0.8}), .angle = 0.5};
        bst_vec3 axis = joint < 0 ? s.axis : (bst_vec3){0.6 * cos(0.4), 0.6 * sin(0.4), 0.8};
        bst_vec3 aside = bst_vec3_unit(bst_vec3_cross(axis, (bst_vec3){0, 0, 1}));
        for (int k = 0; k < 8; k++) { /* on both sides of the normals */
            double angle = 0.2 * k;
            bst_vec3 half = bst_vec3_axpy(bst_vec3_scale(axis, cos(angle)), sin(angle), aside);
            bst_assert_close(bst_glint_offset(&s, m.pose, half), fabs(angle - 0.5), 1e-7);
        }
    }
    bst_test_model_close(&m);
}

/* Passes at a least distance, with a slope on both sides. */
typedef struct passing {
    double at, least, slope;
} passing;

static void pass(void *user, double u, double *out) {
    const passing *p = user;
    out[0] = hypot(p->least, p->slope * (u - p->at));
}

/* Place, time in the lobe, and the least offset up to which there is a glint: five widths of the
 * lobe with what the Sun's disc adds. */
static void glints_within_reach(void **state) {
    (void)state;
    enum { STEPS = 20 };
    const bst_glint_surface surface = {.lobe_rad = 0.02, .joint = -1};
    const double widen = 0.01, lobe = 0.03;
    bst_glint glints[BST_GLINTS_MAX];
    for (int k = 0; k < 2; k++) {
        passing p = {0.37, (k ? 5.1 : 4.9) * lobe, 4.0};
        int count = bst_glint_find(&surface, 1, widen, STEPS, pass, &p, glints);
        assert_int_equal(count, k ? 0 : 1);
        if (!k) { /* the steps about it end at 0.3 and 0.4 */
            double fall = hypot(p.least, 4.0 * 0.07) - p.least;
            bst_assert_close(glints[0].u, 0.37, 1e-5);
            bst_assert_close(glints[0].per, lobe / STEPS / fall, 1e-6);
        }
    }
    /* an offset that hardly changes is no glint: a fifth of the lobe in a step */
    for (int k = 0; k < 2; k++) {
        passing p = {0.4, 0.0, (k ? 0.19 : 0.21) * lobe * STEPS};
        int count = bst_glint_find(&surface, 1, widen, STEPS, pass, &p, glints);
        assert_int_equal(count, k ? 0 : 1);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(surfaces_with_narrow_lobes_are_found),
        cmocka_unit_test(normals_of_curved_surfaces_have_no_offset),
        cmocka_unit_test(glints_of_a_box_are_found),
        cmocka_unit_test(surfaces_differ_by_angle_and_joint),
        cmocka_unit_test(glints_within_reach),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
