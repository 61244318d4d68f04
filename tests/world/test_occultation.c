/* Occultations of objects by others: areas against closed forms, and the light that is left. */
#include "sim/world/scene/occultation.h"
#include "sim/world/scene/view_shapes.h"
#include "tests/world/world_support.h"

static const bst_vec3 far_sun = {149597870700.0, 0, 0};

static bst_occultation *work_memory(int vertices) {
    bst_ctx ctx = {0};
    bst_occultation *w;
    bst_assert_ok(&ctx, bst_occultation_create(&ctx, vertices, &w));
    return w;
}

static bst_occultation_body sphere_at(double x, double y, double radius) {
    return (bst_occultation_body){
        .position_m = {7e6 + x, y, 0}, .velocity_mps = {0, 7e3, 0}, .radius_m = radius};
}

/* Area of two discs in common. */
static double lens(double r, double s, double d) {
    if (d >= r + s) {
        return 0;
    }
    if (d <= fabs(r - s)) {
        return BST_PI * fmin(r, s) * fmin(r, s);
    }
    double a = acos((d * d + r * r - s * s) / (2 * d * r));
    double b = acos((d * d + s * s - r * r) / (2 * d * s));
    return r * r * (a - 0.5 * sin(2 * a)) + s * s * (b - 0.5 * sin(2 * b));
}

static void spheres_hide_by_their_discs(void **state) {
    (void)state;
    bst_occultation *w = work_memory(0);
    bst_occultation_body body = sphere_at(0, 0, 2);
    bst_vec3 eye = {7e6 + 1000, 0, 0};
    for (double y = -4; y <= 4; y += 0.5) {
        bst_occultation_body front = sphere_at(500, y, 0.7); /* twice as large from the eye */
        double want = lens(2, 1.4, 2 * fabs(y)) / (BST_PI * 4);
        /* polygons of 96 corners and the area of the disc: 1e-3 of it where they cross */
        bst_assert_close(bst_occultation_from_eye(w, &body, &front, eye, far_sun), want, 1e-3);
    }
    bst_occultation_body front = sphere_at(-500, 0, 5), past = sphere_at(1500, 0, 5);
    bst_assert_close(bst_occultation_from_eye(w, &body, &front, eye, far_sun), 0, 0); /* behind */
    bst_assert_close(bst_occultation_from_eye(w, &body, &past, eye, far_sun), 0, 0);
    bst_occultation_free(w);
}

/* Near by a shadow is sharp; far away the body sees a small disc before the Sun. */
static void shadows_of_spheres(void **state) {
    (void)state;
    bst_occultation *w = work_memory(0);
    bst_occultation_body body = sphere_at(0, 0, 1);
    for (double y = 0; y <= 4; y += 0.5) {
        bst_occultation_body front = sphere_at(3, y, 2);
        double want = lens(1, 2, y) / BST_PI; /* the Sun widens it by 0.014 m */
        bst_assert_close(bst_occultation_of_sun(w, &body, &front, far_sun), want, 0.01);
    }
    bst_occultation_body point = sphere_at(0, 0, 1e-3), front = sphere_at(1000, 0, 0);
    double sun = 1000 * BST_SUN_RADIUS_M / (far_sun.x - 7e6);
    for (double x = 0.3; x < 1.2; x += 0.2) {
        front.radius_m = x * sun;
        double in = x < 1 ? 0.4 * x * x + 0.4 * (1 - pow(1 - x * x, 1.5)) : 0.8;
        /* rings of a quarter of the disc */
        bst_assert_close(bst_occultation_of_sun(w, &point, &front, far_sun), in / 0.8, 0.16);
    }
    front.radius_m = 0.5 * sun; /* the first ring, of four, inside: 0.3 by the closed form */
    bst_assert_close(bst_occultation_of_sun(w, &point, &front, far_sun), 0.3, 1e-3);
    bst_occultation_free(w);
}

/* Share of the Sun's light, its limb darkened by 0.6, that a disc of `radius` at a distance from
 * the middle covers; in radii of the Sun's disc. */
static double covered(double radius, double distance) {
    enum { PARTS = 400 };
    double in = 0.0, all = 0.0;
    for (int i = 0; i < PARTS; i++) {
        double r = (i + 0.5) / PARTS, light = r * (0.4 + 0.6 * sqrt(1.0 - r * r));
        /* cosine of half the arc of this ring that is within the disc */
        double c = (r * r + distance * distance - radius * radius) / (2.0 * r * distance);
        in += light * acos(fmin(fmax(c, -1.0), 1.0)) / BST_PI;
        all += light;
    }
    return in / all;
}

/* A small body beside the way to the Sun covers a part of it as long as the discs overlap, on each
 * side. */
static void shadows_off_the_middle(void **state) {
    (void)state;
    bst_occultation *w = work_memory(0);
    const double sun = 1000 * BST_SUN_RADIUS_M / (far_sun.x - 7e6);
    bst_occultation_body point = sphere_at(0, 0, 1e-3), front = sphere_at(1000, 0, 0.5 * sun);
    for (int side = 0; side < 4; side++) {
        for (double x = 0.1; x < 2.0; x += 0.2) {
            double off = (side % 2 ? -x : x) * sun;
            front.position_m.y = side < 2 ? off : 0.0;
            front.position_m.z = side < 2 ? 0.0 : off;
            double want = covered(0.5, x);
            /* 48 points of the Sun: the light of five of them */
            bst_assert_close(bst_occultation_of_sun(w, &point, &front, far_sun), want,
                             x < 1.5 ? 0.1 : 0.0);
        }
    }
    bst_occultation_free(w);
}

#define SQUARE(name, size, more)                                                               \
    "{\"name\": \"" name                                                                       \
    "\", \"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": "                  \
    "[{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": \"p\", \"kind\": \"box\", " \
    "\"size_m\": [0.1, " size ", " size "], \"material\": \"w\"}" more                         \
    "]}, \"attitude\": "                                                                       \
    "[{\"law\": \"inertial\"}], " TEST_GX5 "}"

/* Exact silhouettes: a square hides a quarter of one of twice its size; its panel half of it. */
static void shapes_hide_by_their_silhouettes(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_world *world =
        test_world_with(SQUARE("big", "2", "") ", " SQUARE("small", "1", "") ", " SQUARE(
                            "panel", "0.5",
                            ", {\"name\": \"q\", \"kind\": \"plate\", \"size_m\": [4, 1, 1], "
                            "\"rotation_deg\": [0, 90, 0], \"material\": \"w\"}"),
                        "");
    bst_occultation *w = work_memory(64);
    bst_occultation_body b[3];
    for (int i = 0; i < 3; i++) {
        b[i] = sphere_at(i ? 10 : 0, 0, 3);
        b[i].shape = bst_world_object(world, i)->shape;
        bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, b[i].shape->satellite, &b[i].pose));
    }
    bst_vec3 eye = {1e9, 0, 0};
    bst_assert_close(bst_occultation_from_eye(w, &b[0], &b[1], eye, far_sun), 0.25, 1e-6);
    b[1].position_m.y = 1; /* half of it before the edge */
    bst_assert_close(bst_occultation_from_eye(w, &b[0], &b[1], eye, far_sun), 0.125, 1e-6);
    /* box and plate overlap each other: 1 x 2 of 2 x 2 */
    bst_assert_close(bst_occultation_from_eye(w, &b[0], &b[2], eye, far_sun), 0.5, 1e-6);
    eye.x = 7e6 + 20; /* from twice the distance: twice as large, all of it */
    b[1].position_m.y = 0;
    bst_assert_close(bst_occultation_from_eye(w, &b[0], &b[1], eye, far_sun), 1, 1e-6);
    for (int i = 0; i < 3; i++) {
        bst_satellite_pose_free(b[i].pose);
    }
    bst_occultation_free(w);
    bst_world_free(world);
}

#define ORBIT                                                                           \
    "\"orbit\": {\"source\": \"numerical\", \"state\": {\"source\": \"keplerian\", "    \
    "\"semi_major_axis_m\": 7e6, \"true_anomaly_deg\": 80}, \"forces\": {\"gravity\": " \
    "\"two_body\", "                                                                    \
    "\"sun\": false, \"moon\": false, \"solar_pressure\": false, \"drag\": false}}"

/* Magnitude of the object behind, at an offset from the one in front; *lit: its sunlight. */
static double magnitude(bool occults, bst_vec3 offset, bool from_behind, double *lit,
                        bst_vec3 *to_sun) {
    bst_ctx ctx = {0};
    char objects[1500];
    /* axes of GCRF by radial and transverse at 80 degrees */
    double c = cos(80 * BST_DEG_RAD), s = sin(80 * BST_DEG_RAD);
    snprintf(objects, sizeof objects,
             "{\"name\": \"front\", \"area_m2\": 12.6, \"occults\": %s, " ORBIT
             "}, {\"name\": \"back\", \"area_m2\": 3.14, \"orbit\": {\"source\": \"relative\", "
             "\"reference\": \"front\", \"offset_rtn_m\": [%.9f, %.9f, %.9f]}}",
             occults ? "true" : "false", c * offset.x + s * offset.y, c * offset.y - s * offset.x,
             offset.z);
    bst_world *world = test_world_with(objects, "");
    bst_world_view *view;
    bst_world_state front, eye;
    bst_world_sight sight;
    bst_bodies bodies;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_world_view_object_state(&ctx, view, 0, 0, &front));
    bst_assert_ok(&ctx, bst_world_view_bodies(&ctx, view, 0, &bodies));
    *to_sun = bst_vec3_unit(bst_vec3_sub(bst_bodies_sunlight_from(&bodies), front.position_m));
    eye = front;
    bst_vec3 side = from_behind ? bst_vec3_unit(offset) : bst_vec3_perpendicular(*to_sun);
    eye.position_m = bst_vec3_axpy(front.position_m, from_behind ? -1000.0 : 1000.0, side);
    bst_assert_ok(&ctx, bst_world_view_sight_from(&ctx, view, &eye, 1, 0, &sight));
    *lit = sight.sunlit_fraction;
    bst_world_view_free(view);
    bst_world_free(world);
    return sight.v_mag;
}

/* In a world: the object behind is dark to the observer, or has no sunlight. */
static void light_is_taken_away(void **state) {
    (void)state;
    double lit;
    bst_vec3 sun;
    bst_vec3 back = {0, 0, 100};
    double free = magnitude(false, back, true, &lit, &sun);
    assert_true(isfinite(free) && lit == 1);
    assert_true(isinf(magnitude(true, back, true, &lit, &sun)));
    bst_assert_close(lit, 1, 0);
    bst_vec3 shade = bst_vec3_scale(sun, -30);
    free = magnitude(false, shade, false, &lit, &sun);
    assert_true(isfinite(free));
    assert_true(isinf(magnitude(true, shade, false, &lit, &sun)));
    bst_assert_close(lit, 0, 1e-9);
    /* 2 m from the axis: half of its disc of 1 m is in the shadow of 2 m */
    shade = bst_vec3_axpy(shade, 2, bst_vec3_perpendicular(sun));
    free = magnitude(false, shade, false, &lit, &sun);
    double half = magnitude(true, shade, false, &lit, &sun);
    double left = 1 - lens(1, 2, 2) / BST_PI;
    bst_assert_close(lit, left, 0.02); /* the Sun widens the border by 0.14 m */
    bst_assert_close(half - free, -2.5 * log10(lit), 1e-6);
}

/* Sunlight passes what is in front before the emission, the light to the observer after it, by the
 * way over the speed of light. At those times a body as far ahead of the middle of the one in front
 * as another is behind it loses as much. */
static void light_takes_time_between_bodies(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const double way_m = 6e4, late_s = way_m / 299792458.0; /* 1.5 m of the orbit */
    bst_world *world =
        test_world_with("{\"name\": \"front\", \"area_m2\": 1e6, \"occults\": true, " ORBIT
                        "}, {\"name\": \"back\", \"area_m2\": 1e5, " ORBIT "}",
                        "");
    bst_world_view *view;
    bst_sky_clock *clock;
    bst_view_shapes shapes;
    bst_assert_ok(&ctx, bst_world_view_create(&ctx, world, &view));
    bst_assert_ok(&ctx, bst_sky_clock_create_on(&ctx, world->sky_grid, &clock));
    bst_assert_ok(&ctx, bst_view_shapes_create(&ctx, world, clock, &shapes));
    for (int side = 0; side < 2; side++) {
        bst_world_state front;
        const double seconds = 100.0;
        bst_assert_ok(&ctx, bst_world_view_object_state(
                                &ctx, view, 0, seconds + (side ? late_s : -late_s), &front));
        bst_vec3 along = bst_vec3_unit(front.velocity_mps);
        bst_vec3 back = bst_vec3_unit(bst_vec3_cross(along, front.position_m));
        double left[2];
        for (int k = 0; k < 2; k++) {
            bst_vec3 place = bst_vec3_axpy(bst_vec3_axpy(front.position_m, way_m, back),
                                           k ? -560.0 : 560.0, along);
            const bst_view_emission at = {.object = 1, .position_m = place, .seconds = seconds};
            bst_view_mutual m =
                bst_view_shapes_occultations(&shapes, &at, bst_vec3_axpy(place, -1e9, back),
                                             bst_vec3_axpy(place, -1.5e11, back));
            left[k] = side ? m.visible : m.sunlight;
        }
        assert_true(left[0] > 0.3 && left[0] < 0.7); /* where it changes by 0.2 % a metre */
        bst_assert_close(left[0], left[1], 1e-4);
    }
    bst_view_shapes_free(&shapes);
    bst_sky_clock_free(clock);
    bst_world_view_free(view);
    bst_world_free(world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_hide_by_their_discs),
        cmocka_unit_test(shadows_of_spheres),
        cmocka_unit_test(shadows_off_the_middle),
        cmocka_unit_test(shapes_hide_by_their_silhouettes),
        cmocka_unit_test(light_is_taken_away),
        cmocka_unit_test(light_takes_time_between_bodies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
