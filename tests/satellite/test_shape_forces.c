/* Pressure of sunlight and area in the air of shapes, against closed forms. */
#include "sim/satellite/shape_forces.h"
#include "tests/satellite/satellite_support.h"

#define GREY                                                                                 \
    "\"materials\": [{\"name\": \"g\", \"diffuse\": 0.6}, {\"name\": \"m\", \"model\": "     \
    "\"phong\", \"diffuse\": 0.2, \"specular\": 0.5, \"exponent\": 100}, {\"name\": \"b\", " \
    "\"diffuse\": 0.6, \"absorptance\": 1}]"

static bst_test_model part_of(const char *part) {
    char text[1500];
    snprintf(text, sizeof text, "{" GREY ", \"parts\": [%s]}", part);
    bst_test_model m = bst_test_model_open(text);
    bst_satellite_make_surfaces(m.satellite);
    return m;
}

/* A Lambertian sphere: 1 + 4/9 of its reflectance; its silhouette is a disc. */
static void a_sphere_has_its_coefficient(void **state) {
    (void)state;
    bst_test_model m = part_of(
        "{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 1.5, \"segments\": 96, "
        "\"material\": \"g\"}");
    double disc = BST_PI * 1.5 * 1.5;
    uint64_t random = 5;
    for (int i = 0; i < 5; i++) {
        bst_vec3 sun = bst_test_direction(&random);
        bst_vec3 area = bst_shape_light_area_m2(m.pose, sun);
        double want = disc * (1 + 4.0 / 9 * 0.6);
        /* facets of 3.75 degrees inside the sphere: 2e-3 of its area */
        bst_assert_close(bst_vec3_norm(bst_vec3_axpy(area, want, sun)), 0, 3e-3 * want);
        bst_assert_close(bst_shape_silhouette_m2(m.pose, sun), disc, 3e-3 * disc);
    }
    bst_test_model_close(&m);
}

/* A plate: pressure along the light and along the normal, of black, diffuse and mirror parts. */
static void a_plate_has_its_force(void **state) {
    (void)state;
    static const char *const names[] = {"g", "m", "b"};
    for (int k = 0; k < 3; k++) {
        char part[200];
        snprintf(part, sizeof part,
                 "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 1], \"material\": "
                 "\"%s\"}",
                 names[k]);
        bst_test_model m = part_of(part);
        for (int deg = 0; deg < 80; deg += 20) {
            double a = deg * BST_DEG_RAD, c = cos(a);
            bst_vec3 sun = {sin(a), 0, c}, n = {0, 0, 1};
            double diffuse = k == 2 ? 0 : k == 1 ? 0.2 : 0.6, mirror = 0;
            if (k == 1) {
                mirror = bst_brdf_reflectance(&m.satellite->materials[1].brdf, c) - 0.2;
                assert_true(deg > 0 || fabs(mirror - 0.5) < 0.02);
            }
            bst_vec3 want = bst_vec3_scale(sun, -6 * c * (1 - mirror));
            want = bst_vec3_axpy(want, -12 * c * (mirror * c + diffuse / 3), n);
            bst_vec3 got = bst_shape_light_area_m2(m.pose, sun);
            /* the table of reflectances is linear in steps of 1/16 of the cosine */
            bst_assert_close(bst_vec3_norm(bst_vec3_sub(got, want)), 0, k == 1 ? 0.02 : 1e-4);
            bst_assert_close(bst_shape_silhouette_m2(m.pose, sun), 6 * c, 1e-12);
        }
        bst_test_model_close(&m);
    }
}

/* The side of a Lambertian cylinder across the light: 2 r l (1 + pi / 6 of its reflectance). */
static void a_cylinder_has_its_force(void **state) {
    (void)state;
    bst_test_model m = part_of(
        "{\"name\": \"c\", \"kind\": \"cylinder\", \"radius_m\": 0.5, \"length_m\": 4, "
        "\"segments\": 96, \"material\": \"g\"}");
    double want = 4 * (1 + BST_PI / 6 * 0.6);
    bst_vec3 got = bst_shape_light_area_m2(m.pose, (bst_vec3){1, 0, 0});
    bst_assert_close(got.x, -want, 2e-3 * want); /* 96 facets */
    bst_assert_close(got.y, 0, 1e-9);
    bst_test_model_close(&m);
}

/* What a part shadows feels no pressure, and the air meets it once. */
static void parts_shadow_each_other(void **state) {
    (void)state;
    bst_test_model m = part_of(
        "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 2, 1], \"material\": \"b\"}, "
        "{\"name\": \"q\", \"kind\": \"plate\", \"size_m\": [1, 1, 1], \"position_m\": [0, 0, 1], "
        "\"material\": \"b\"}");
    bst_vec3 got = bst_shape_light_area_m2(m.pose, (bst_vec3){0, 0, 1});
    bst_assert_close(got.z, -4, 1e-9);
    bst_assert_close(bst_shape_silhouette_m2(m.pose, (bst_vec3){0, 0, 1}), 4, 1e-9);
    got = bst_shape_light_area_m2(m.pose, bst_vec3_unit((bst_vec3){3, 0, 1}));
    bst_assert_close(bst_vec3_norm(got), 5 / sqrt(10), 1e-9); /* beside it: both */
    bst_test_model_close(&m);
}

/* Forces are those of the functions without torque; another point of reference adds the lever times
 * the force; drag on a box goes through its centre. */
static void loads_have_their_lever(void **state) {
    (void)state;
    bst_test_model m = part_of(
        "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1, 2, 3], \"position_m\": [0.3, -0.2, "
        "0.5], \"material\": \"m\"}, {\"name\": \"c\", \"kind\": \"cylinder\", \"radius_m\": 0.3, "
        "\"length_m\": 5, \"position_m\": [0.3, -0.2, 0.5], \"material\": \"g\"}");
    const bst_vec3 centre = {0.3, -0.2, 0.5}, other = {-1.0, 0.4, 2.0};
    uint64_t random = 11;
    for (int i = 0; i < 6; i++) {
        bst_vec3 sun = bst_test_direction(&random), force = bst_shape_light_area_m2(m.pose, sun);
        bst_shape_load load = bst_shape_light_load(m.pose, sun, centre);
        bst_shape_load moved = bst_shape_light_load(m.pose, sun, other);
        bst_vec3 lever = bst_vec3_cross(bst_vec3_sub(centre, other), force);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(load.force, force)), 0, 1e-12);
        bst_assert_close(
            bst_vec3_norm(bst_vec3_sub(bst_vec3_sub(moved.torque, load.torque), lever)), 0, 1e-11);
        bst_shape_load drag = bst_shape_drag_load(m.pose, sun, other);
        bst_vec3 want = bst_vec3_scale(sun, -bst_shape_silhouette_m2(m.pose, sun));
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(drag.force, want)), 0, 1e-12);
    }
    bst_test_model_close(&m);
    m = part_of(
        "{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1, 2, 3], \"position_m\": [0.3, -0.2, "
        "0.5], \"material\": \"m\"}");
    for (int i = 0; i < 6; i++) {
        /* drag on a convex body goes through the centroid of its silhouette: none about the centre
         */
        bst_shape_load drag = bst_shape_drag_load(m.pose, bst_test_direction(&random), centre);
        bst_assert_close(bst_vec3_norm(drag.torque), 0, 1e-12);
    }
    bst_test_model_close(&m);
}

/* A plate beside the centre of mass, a third of which another one shadows: force times the lever of
 * the centroid of what is lit. */
static void a_plate_off_centre_has_its_torque(void **state) {
    (void)state;
    bst_test_model m = part_of(
        "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [3, 2, 1], \"position_m\": [4, 1, 0], "
        "\"material\": \"b\"}, {\"name\": \"q\", \"kind\": \"plate\", \"size_m\": [1, 2, 1], "
        "\"position_m\": [5, 1, 0.5], \"material\": \"b\"}");
    const bst_vec3 sun = {0, 0, 1}, origin = {0, 0, 0};
    /* black: 4 m^2 at x = 3.5, and 2 m^2 at x = 5, both at y = 1 */
    bst_shape_load light = bst_shape_light_load(m.pose, sun, origin);
    bst_assert_close(light.force.z, -6, 1e-9);
    bst_assert_close(light.torque.x, 1 * -6, 1e-9);
    bst_assert_close(light.torque.y, 4 * 3.5 + 2 * 5, 1e-9);
    bst_assert_close(light.torque.z, 0, 1e-9);
    bst_shape_load drag = bst_shape_drag_load(m.pose, sun, origin);
    bst_assert_close(drag.torque.y, 4 * 3.5 + 2 * 5, 1e-9);
    /* from the edge of the second one: the first is shadowed half a metre farther */
    const bst_vec3 slant = bst_vec3_unit((bst_vec3){1, 0, 1});
    light = bst_shape_light_load(m.pose, slant, origin);
    /* black: force along the light, areas times cosine; shadow from x = 4 to 5, lit 2.5 to 4 and 5
     * to 5.5, and the second plate at z = 0.5 */
    double f = 2 * sqrt(0.5), torque = 0;
    const double part[3][3] = {{1.5, 3.25, 0}, {0.5, 5.25, 0}, {1, 5, 0.5}}; /* length, x, z */
    for (int i = 0; i < 3; i++) {
        torque += part[i][0] * f * (part[i][2] * -slant.x - part[i][1] * -slant.z);
    }
    bst_assert_close(light.torque.y, torque, 1e-9);
    bst_assert_close(bst_vec3_norm(light.force), 3 * f, 1e-9);
    bst_test_model_close(&m);
}

/* In an orbit, on a body that is turned: a plate whose normal is 25 degrees above the direction
 * that its joint turns to the Earth, the Sun or the observer, for whom the Earth stands. Its areas
 * are those of its normal. */
static void parts_aim_in_an_orbit(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static const char *const follows[] = {"earth", "sun", "target"};
    const bst_quat q = {0.1, -0.5, 0.7, 0.5};
    bst_attitude_config phase = {
        .from_s = -1e9, .law = BST_ATTITUDE_INERTIAL, .quaternion = {0.1, -0.5, 0.7, 0.5}};
    const bst_config_list list = {&phase, 1};
    const bst_attitude_source none = {.base_dir = ""};
    bst_body_attitude *attitude;
    bst_assert_ok(&ctx, bst_body_attitude_create(&ctx, &list, &none, &attitude));
    const bst_force_state at = {.position_m = {4e6, -5e6, 2.5e6},
                                .velocity_mps = {5000, 3000, -4000},
                                .sun = bst_vec3_unit((bst_vec3){-0.3, 0.7, 0.5})};
    const bst_vec3 ahead = bst_vec3_unit(at.velocity_mps);
    for (int k = 0; k < 3; k++) {
        char text[900];
        snprintf(text, sizeof text,
                 "{" GREY
                 ", \"joints\": [{\"name\": \"j\", \"follows\": \"%s\", "
                 "\"axis\": [0, 0, 1], \"normal\": [1, 0, 0]}], \"parts\": [{\"name\": "
                 "\"p\", \"kind\": \"plate\", \"size_m\": [2, 3, 1], \"rotation_deg\": [0, 65, "
                 "0], \"joint\": \"j\", \"material\": \"b\"}]}",
                 follows[k]);
        bst_test_model m = bst_test_model_open(text);
        bst_satellite_make_surfaces(m.satellite);
        bst_shape_forces *forces;
        bst_assert_ok(&ctx, bst_shape_forces_create(&ctx, m.satellite, attitude, NULL, 0, &forces));
        const bst_force_surface *surface = bst_shape_forces_surface(forces);
        bst_vec3 to = bst_quat_rotate(q, k == 1 ? at.sun : bst_vec3_scale(at.position_m, -1.0));
        double along = hypot(to.x, to.y), c = cos(25 * BST_DEG_RAD), s = sin(25 * BST_DEG_RAD);
        bst_vec3 normal =
            bst_quat_rotate(bst_quat_conj(q), (bst_vec3){c * to.x / along, c * to.y / along, s});
        double area_m2 = surface->drag_area_m2(surface->user, &at, ahead);
        bst_assert_close(area_m2, 6 * fabs(bst_vec3_dot(normal, ahead)), 1e-9);
        bst_vec3 light_m2 = surface->light_area_m2(surface->user, &at); /* black: along the light */
        double in = fabs(bst_vec3_dot(normal, at.sun));
        bst_assert_close(bst_vec3_norm(bst_vec3_axpy(light_m2, 6 * in, at.sun)), 0, 1e-9);
        bst_shape_forces_free(forces);
        bst_test_model_close(&m);
    }
    bst_body_attitude_free(attitude);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere_has_its_coefficient),
        cmocka_unit_test(a_plate_has_its_force),
        cmocka_unit_test(a_cylinder_has_its_force),
        cmocka_unit_test(parts_shadow_each_other),
        cmocka_unit_test(loads_have_their_lever),
        cmocka_unit_test(a_plate_off_centre_has_its_torque),
        cmocka_unit_test(parts_aim_in_an_orbit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
