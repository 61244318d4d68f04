/* Light of shapes against closed forms and against rays. */
#include <unistd.h>

#include "tests/satellite/satellite_support.h"

#define WHITE "\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}]"

/* The asked accuracy of closed forms. */
static const double CLOSED = 1e-4;

static void sphere_has_its_closed_form(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" WHITE
        ", \"parts\": [{\"name\": \"s\", \"kind\": \"sphere\", \"radius_m\": 1.5, "
        "\"material\": \"w\", \"rotation_deg\": [10, 20, 30]}]}");
    uint64_t random = 7;
    for (int i = 0; i < 50; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        double phase = bst_vec3_angle(sun, eye);
        /* Lambert's sphere: integral of both cosines over the lit and visible lune */
        double form =
            0.8 / BST_PI * 1.5 * 1.5 * 2.0 / 3.0 * (sin(phase) + (BST_PI - phase) * cos(phase));
        bst_assert_close(bst_test_flux(&m, sun, eye), form, CLOSED * form + 1e-9);
    }
    bst_test_model_close(&m);
}

static void cylinder_has_its_closed_form(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" WHITE
        ", \"parts\": [{\"name\": \"c\", \"kind\": \"cylinder\", \"radius_m\": 0.7, "
        "\"length_m\": 3, \"material\": \"w\"}]}");
    uint64_t random = 11;
    for (int i = 0; i < 50; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        double azimuth = fabs(bst_wrap_angle(atan2(sun.y, sun.x) - atan2(eye.y, eye.x)));
        double across = hypot(sun.x, sun.y) * hypot(eye.x, eye.y);
        double side = 0.7 * 3 * across * 0.5 * (sin(azimuth) + (BST_PI - azimuth) * cos(azimuth));
        double end = sun.z * eye.z > 0 ? BST_PI * 0.7 * 0.7 * sun.z * eye.z : 0.0;
        double form = 0.8 / BST_PI * (side + end);
        bst_assert_close(bst_test_flux(&m, sun, eye), form, CLOSED * form + 1e-9);
    }
    bst_test_model_close(&m);
}

static void box_and_plate_have_their_closed_forms(void **state) {
    (void)state;
    bst_test_model box = bst_test_model_open(
        "{" WHITE
        ", \"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1, 2, 3], "
        "\"material\": \"w\"}]}");
    bst_test_model plate = bst_test_model_open(
        "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"d\", \"diffuse\": "
        "0.1}], \"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [2, 5, 1], "
        "\"material\": \"w\", \"back_material\": \"d\"}]}");
    uint64_t random = 3;
    for (int i = 0; i < 50; i++) {
        bst_vec3 s = bst_test_direction(&random), e = bst_test_direction(&random);
        double form = 0.8 / BST_PI *
                      (6 * fmax(s.x * e.x, 0) + 3 * fmax(s.y * e.y, 0) + 2 * fmax(s.z * e.z, 0));
        bst_assert_close(bst_test_flux(&box, s, e), form, 1e-9);
        double albedo = s.z > 0 ? 0.8 : 0.1;
        form = s.z * e.z > 0 ? albedo / BST_PI * 10 * s.z * e.z : 0.0;
        bst_assert_close(bst_test_flux(&plate, s, e), form, 1e-9);
    }
    bst_test_model_close(&box);
    bst_test_model_close(&plate);
}

/* A closed cone, sliced by hand: its light is that of many thin plane strips. */
static void cone_is_the_sum_of_strips(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" WHITE
        ", \"parts\": [{\"name\": \"c\", \"kind\": \"cone\", \"radius_m\": 1, "
        "\"top_radius_m\": 0.3, \"length_m\": 2, \"open\": true, \"material\": \"w\"}]}");
    uint64_t random = 5;
    double slant = hypot(0.7, 2.0);
    for (int i = 0; i < 20; i++) {
        bst_vec3 s = bst_test_direction(&random), e = bst_test_direction(&random);
        double sum = 0.0;
        enum { STRIPS = 100000 };
        for (int k = 0; k < STRIPS; k++) {
            double a = 2.0 * BST_PI * (k + 0.5) / STRIPS;
            bst_vec3 n = {2.0 / slant * cos(a), 2.0 / slant * sin(a), 0.7 / slant};
            double in = bst_vec3_dot(n, s), out = bst_vec3_dot(n, e);
            sum += in > 0 && out > 0 ? in * out * slant * 0.65 * 2.0 * BST_PI / STRIPS : 0.0;
        }
        double form = 0.8 / BST_PI * sum;
        bst_assert_close(bst_test_flux(&m, s, e), form, CLOSED * form + 1e-8);
    }
    bst_test_model_close(&m);
}

/* A plate over a larger one: its shadow and its silhouette, which overlap or not. */
static void shadow_of_a_plate_is_exact(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"d\"}], \"parts\": "
        "[{\"name\": \"low\", \"kind\": \"plate\", \"size_m\": [10, 10, 1], \"material\": \"w\"}, "
        "{\"name\": \"high\", \"kind\": \"plate\", \"size_m\": [2, 2, 1], \"position_m\": [0, 0, "
        "1], \"material\": \"d\"}]}");
    bst_vec3 s = bst_vec3_unit((bst_vec3){1, 0, 1}), e = bst_vec3_unit((bst_vec3){-0.5, 0, 1});
    /* shadow x in [-2, 0], silhouette x in [-0.5, 1.5]: 2 x (2 + 2 - 0.5) hidden */
    double both = 0.8 / BST_PI * s.z * e.z * (100 - 2 * 3.5);
    bst_assert_close(bst_test_flux(&m, s, e), both, 1e-9);
    bst_vec3 up = {0, 0, 1};
    bst_assert_close(bst_test_flux(&m, up, up), 0.8 / BST_PI * 96, 1e-9);
    bst_vec3 low = bst_vec3_unit((bst_vec3){10, 0, 1}); /* the shadow misses the plate */
    bst_assert_close(bst_test_flux(&m, low, up), 0.8 / BST_PI * low.z * 96, 1e-9);
    bst_test_model_close(&m);
}

static const char CROWDED[] =
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"d\", \"diffuse\": 0.2}], "
    "\"joints\": [{\"name\": \"j\", \"follows\": \"sun\", \"axis\": [0, 1, 0], \"normal\": [0, 0, "
    "1]}], \"parts\": ["
    "{\"name\": \"bus\", \"kind\": \"box\", \"size_m\": [2, 1.5, 2.5], \"material\": \"w\"},"
    "{\"name\": \"left\", \"kind\": \"plate\", \"size_m\": [2, 4, 1], \"position_m\": [0, 3.2, 0], "
    "\"joint\": \"j\", \"material\": \"d\"},"
    "{\"name\": \"right\", \"kind\": \"plate\", \"size_m\": [2, 4, 1], \"position_m\": [0, -3.2, "
    "0], \"joint\": \"j\", \"material\": \"d\"},"
    "{\"name\": \"mast\", \"kind\": \"box\", \"size_m\": [0.2, 0.2, 3], \"position_m\": [0.4, 0, "
    "2], \"rotation_deg\": [20, 10, 0], \"material\": \"w\"}]}";

/* True if a ray from a point of a facet meets another facet (Moeller and Trumbore 1997). */
static bool ray_meets(const bst_satellite_pose *p, int own, bst_vec3 from, bst_vec3 way) {
    const bst_satellite *s = p->satellite;
    for (int f = 0; f < s->facet_count; f++) {
        const int *c = s->corner + s->facets[f].first;
        for (int k = 2; k < s->facets[f].count && s->facets[f].occluder != s->facets[own].occluder;
             k++) {
            bst_vec3 a = p->vertices[c[0]], u = bst_vec3_sub(p->vertices[c[k - 1]], a);
            bst_vec3 v = bst_vec3_sub(p->vertices[c[k]], a), q = bst_vec3_cross(way, v);
            double det = bst_vec3_dot(u, q);
            bst_vec3 r = bst_vec3_sub(from, a), t = bst_vec3_cross(r, u);
            double x = bst_vec3_dot(r, q) / det, y = bst_vec3_dot(way, t) / det;
            if (fabs(det) > 1e-12 && x >= 0 && y >= 0 && x + y <= 1 &&
                bst_vec3_dot(v, t) / det > 1e-9) {
                return true;
            }
        }
    }
    return false;
}

/* Light by rays from a grid of points on each facet. */
static double flux_by_rays(const bst_satellite_pose *p, bst_vec3 sun, bst_vec3 eye) {
    enum { SIDE = 200 };
    const bst_satellite *s = p->satellite;
    double sum = 0.0;
    for (int f = 0; f < s->facet_count; f++) {
        double in = bst_vec3_dot(p->normals[f], sun), out = bst_vec3_dot(p->normals[f], eye);
        const int *c = s->corner + s->facets[f].first;
        if (in <= 0 || out <= 0) {
            continue;
        }
        assert_int_equal(s->facets[f].count, 4); /* parallelograms */
        bst_vec3 a = p->vertices[c[0]], u = bst_vec3_sub(p->vertices[c[1]], a);
        bst_vec3 v = bst_vec3_sub(p->vertices[c[3]], a);
        int free = 0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            bst_vec3 q = bst_vec3_axpy(bst_vec3_axpy(a, (i % SIDE + 0.5) / SIDE, u),
                                       ((double)(i / SIDE) + 0.5) / SIDE, v);
            free += !ray_meets(p, f, q, sun) && !ray_meets(p, f, q, eye);
        }
        sum += s->materials[s->facets[f].material].brdf.diffuse / BST_PI * in * out *
               s->facets[f].area_m2 * free / (SIDE * SIDE);
    }
    return sum;
}

/* Intersecting and articulated parts, some of them partly behind the plane of others. */
static void shadows_agree_with_rays(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(CROWDED);
    uint64_t random = 17;
    int shadowed = 0;
    for (int i = 0; i < 12; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        double flux = bst_test_flux(&m, sun, eye), rays = flux_by_rays(m.pose, sun, eye);
        bst_satellite_pose_set(m.pose, &(bst_satellite_aim){sun, {0, 0, 1}, eye, 0});
        double whole = 0.0;
        for (int f = 0; f < m.satellite->facet_count; f++) {
            double in = bst_vec3_dot(m.pose->normals[f], sun);
            double out = bst_vec3_dot(m.pose->normals[f], eye);
            const bst_facet *facet = &m.satellite->facets[f];
            whole += in > 0 && out > 0 ? m.satellite->materials[facet->material].brdf.diffuse /
                                             BST_PI * in * out * facet->area_m2
                                       : 0.0;
        }
        shadowed += flux < 0.97 * whole;
        /* 200 x 200 points: the border of a shadow is uncertain by half a cell, a 400th of an edge;
         * borders cross it in both directions */
        bst_assert_close(flux, rays, 2e-3 * whole + 1e-9);
    }
    assert_true(shadowed >= 4);
    bst_test_model_close(&m);
}

/* A joint by a table, and one that a burn turns. */
static void joints_follow_tables_and_burns(void **state) {
    (void)state;
    char path[BST_TEST_PATH], text[1200];
    bst_test_template(path, "boresight_joint");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    FILE *f = fdopen(fd, "w");
    fputs("time_s,angle_deg\n10,0\n20,40\n30,40\n", f);
    fclose(f);
    snprintf(text, sizeof text,
             "{" WHITE
             ", \"joints\": [{\"name\": \"t\", \"follows\": \"table\", \"file\": \"%s\", "
             "\"axis\": [1, 0, 0], \"offset_deg\": 5}, {\"name\": \"b\", \"follows\": \"burn\", "
             "\"burn\": 2, \"turn_deg\": -60, \"rate_deg_per_s\": 3, \"axis\": [1, 0, 0], "
             "\"offset_deg\": 10}], \"parts\": [{\"name\": \"p\", \"kind\": \"plate\", "
             "\"joint\": \"t\", \"material\": \"w\"}, {\"name\": \"q\", \"kind\": \"plate\", "
             "\"position_m\": [5, 0, 0], \"joint\": \"b\", \"material\": \"w\"}]}",
             path);
    bst_test_model m = bst_test_model_open(text);
    static const double burns[] = {3, 20};
    m.pose->burn_s = burns;
    m.pose->burn_count = 2;
    /* front and back of each plate: facets 0 and 2 are the fronts */
    static const double when[] = {0, 15, 22, 35, 50}, table[] = {5, 25, 45, 45, 45},
                        burn[] = {10, 10, 4, -35, -50};
    for (int i = 0; i < 5; i++) {
        bst_satellite_pose_set(m.pose,
                               &(bst_satellite_aim){{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, when[i]});
        for (int k = 0; k < 2; k++) {
            bst_vec3 n = m.pose->normals[2 * k];
            double deg = atan2(-n.y, n.z) / BST_DEG_RAD;
            bst_assert_close(deg, k ? burn[i] : table[i], 1e-9);
        }
    }
    m.pose->burn_count = 1; /* without that burn it stays */
    bst_satellite_pose_set(m.pose, &(bst_satellite_aim){{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, 50});
    bst_assert_close(atan2(-m.pose->normals[2].y, m.pose->normals[2].z) / BST_DEG_RAD, 10, 1e-9);
    bst_test_model_close(&m);
    unlink(path);
}

static void panels_follow_the_sun(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(CROWDED);
    bst_vec3 sun = bst_vec3_unit((bst_vec3){0.5, 0.4, -0.7});
    bst_satellite_pose_set(m.pose, &(bst_satellite_aim){sun, {0, 0, 1}, {1, 0, 0}, 0});
    /* the best that one axis can do: the normal is the Sun's component across the axis */
    bst_vec3 best = bst_vec3_unit((bst_vec3){0.5, 0, -0.7}), n = m.pose->normals[6];
    bst_assert_close(bst_vec3_angle(n, best), 0, 1e-12);
    bst_test_model_close(&m);
    m = bst_test_model_open(
        "{" WHITE
        ", \"joints\": [{\"name\": \"base\", \"follows\": \"spin\", \"axis\": [0, 0, 1], "
        "\"normal\": [1, 0, 0], \"rate_deg_per_s\": 10}, {\"name\": \"j\", \"parent\": \"base\", "
        "\"follows\": \"sun\", \"axes\": 2, \"axis\": [0, 1, 0], \"normal\": [0, 0, 1]}], "
        "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"joint\": \"j\", \"material\": "
        "\"w\"}]}");
    bst_satellite_pose_set(m.pose, &(bst_satellite_aim){sun, {0, 0, 1}, {1, 0, 0}, 12.3});
    bst_assert_close(bst_vec3_angle(m.pose->normals[0], sun), 0, 1e-12);
    bst_test_model_close(&m);
}

/* A spinning joint turns by the right-hand rule from its offset, and its child with it: at t the
 * normals are (cos a, sin a, 0), and those of the child's axis, which leans in its parent's frame.
 */
static void joints_spin_by_the_right_hand(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{" WHITE
        ", \"joints\": [{\"name\": \"base\", \"follows\": \"spin\", \"axis\": [0, 0, 1], "
        "\"normal\": [1, 0, 0], \"rate_deg_per_s\": 10, \"offset_deg\": 15, \"position_m\": [0, 3, "
        "0]}, "
        "{\"name\": \"j\", \"parent\": \"base\", \"follows\": \"spin\", \"axis\": [1, 0, 0], "
        "\"normal\": [0, 0, 1], \"rate_deg_per_s\": -4, \"position_m\": [2, 0, 1]}], "
        "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"joint\": \"j\", \"material\": "
        "\"w\"}]}");
    for (double t = 0.0; t < 60.0; t += 7.3) {
        bst_vec3 up = {0, 0, 1};
        bst_satellite_pose_set(m.pose, &(bst_satellite_aim){up, up, up, t});
        double a = (15 + 10 * t) * BST_DEG_RAD, b = -4 * t * BST_DEG_RAD;
        /* z turned about x by b, and then about z by a */
        bst_vec3 in_base = {0, -sin(b), cos(b)};
        bst_vec3 expected = {cos(a) * in_base.x - sin(a) * in_base.y,
                             sin(a) * in_base.x + cos(a) * in_base.y, in_base.z};
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(m.pose->normals[0], expected)), 0, 1e-12);
        bst_vec3 origin = {2 * cos(a), 3 + 2 * sin(a), 1};
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(m.pose->origin[1], origin)), 0, 1e-12);
    }
    bst_test_model_close(&m);
}

/* A flat mirror's glint has the width of the Sun: twice the tilt turns the ray by twice as much. */
static void glint_has_the_width_of_the_sun(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{\"materials\": [{\"name\": \"osr\", \"library\": \"optical_solar_reflector\"}], "
        "\"parts\": [{\"name\": \"p\", \"kind\": \"plate\", \"material\": \"osr\"}]}");
    double mean = 0.0, point = 0.0;
    enum { STEPS = 400 };
    for (int i = 0; i < STEPS; i++) {
        double tilt = (i - 0.5 * STEPS) * 0.05 * BST_DEG_RAD;
        bst_vec3 sun = {sin(tilt), 0, cos(tilt)}, eye = {0, 0, 1};
        bst_satellite_light light = {
            .sun = sun, .observer = eye, .sunlit = 1, .sun_radius_rad = 4.65e-3};
        bst_satellite_flux flux;
        bst_satellite_flux_at(m.pose, &light, &flux);
        mean += flux.sun[BST_SUNLIGHT_V] / STEPS;
        light.sun_radius_rad = 0;
        bst_satellite_flux_at(m.pose, &light, &flux);
        point = fmax(point, flux.sun[BST_SUNLIGHT_V]);
        if (i == STEPS / 2) { /* the disc is wider than the lobe of 2 x 0.003 rad: it dims */
            light.sun_radius_rad = 4.65e-3;
            double peak = flux.sun[BST_SUNLIGHT_V];
            bst_satellite_flux_at(m.pose, &light, &flux);
            assert_true(flux.sun[BST_SUNLIGHT_V] < 0.9 * peak);
            assert_true(flux.sun[BST_SUNLIGHT_V] > 0.4 * peak);
        }
    }
    assert_true(mean > 0 && point > 0);
    bst_test_model_close(&m);
}

/* From far the Earth is a Lambert sphere at full phase, with the geometric albedo 2/3 of its
 * albedo; near the surface at noon it is a plane of radiance albedo / pi, and a plate receives its
 * albedo. */
static void earthlight_has_its_closed_form(void **state) {
    (void)state;
    bst_earth_surface earth = {.diffuse = 0.3, .fineness = 1};
    bst_earthlight light;
    double sum = 0.0, d = 1000 * BST_EARTH_RADIUS_M;
    bst_earthlight_at(&earth, (bst_vec3){0, 0, d}, (bst_vec3){0, 0, 1}, &light);
    for (int i = 0; i < light.count; i++) {
        sum += light.irradiance[i];
    }
    double far = 0.3 * 2.0 / 3.0 * 1e-6;
    bst_assert_close(sum, far, 2e-3 * far); /* a distance of 1000 radii brightens by 1e-3 */
    bst_earthlight_at(&earth, (bst_vec3){0, 0, BST_EARTH_RADIUS_M + 1.0}, (bst_vec3){0, 0, 1},
                      &light);
    sum = 0.0;
    for (int i = 0; i < light.count; i++) {
        sum += light.irradiance[i] * -light.direction[i].z;
    }
    bst_assert_close(sum, 0.3, 1e-3);
    bst_earthlight_at(&earth, (bst_vec3){0, 0, 7e6}, (bst_vec3){0, 0, -1}, &light);
    assert_int_equal(light.count, 0); /* midnight */
}

/* A mirror-like sphere behind a black plate that covers a part of it for the Sun only: what counts
 * is whether the highlight, at x = 0.5, is in shadow. */
static void highlights_in_shadow_are_dark(void **state) {
    (void)state;
    static const char format[] =
        "{\"materials\": [{\"name\": \"m\", \"model\": \"cook_torrance\", \"diffuse\": 0, "
        "\"specular\": "
        "0.9, \"roughness\": 0.1}, {\"name\": \"black\", \"diffuse\": 0}], \"parts\": [{\"name\": "
        "\"s\", "
        "\"kind\": \"sphere\", \"radius_m\": 1, \"segments\": 48, \"material\": \"m\"}, {\"name\": "
        "\"p\", "
        "\"kind\": \"plate\", \"size_m\": [1.9, 4, 1], \"position_m\": [%g, 0, 3], \"material\": "
        "\"black\"}]}";
    bst_vec3 sun = {0, 0, 1}, eye = {0.8660254037844386, 0, 0.5};
    double flux[3];
    const double place_m[3] = {-60.0, 1.05, -0.85}; /* aside; over x > 0.1; over x < 0.1 */
    for (int i = 0; i < 3; i++) {
        char text[900];
        snprintf(text, sizeof text, format, place_m[i]);
        bst_test_model m = bst_test_model_open(text);
        flux[i] = bst_test_flux(&m, sun, eye);
        bst_test_model_close(&m);
    }
    assert_true(flux[1] < 0.1 * flux[0]);
    assert_true(flux[2] > 0.9 * flux[0] && flux[2] < flux[0]);
}

/* A small plate within a black dish of 2 m radius and 0.5 m depth, halfway out, above the bowl by
 * more or less than its height there: light from the opening reaches the one inside; the dish hides
 * the one behind it. */
static void a_plate_in_a_dish(void **state) {
    (void)state;
    /* the bowl is 0.125 m high at 1 m from the axis */
    static const struct {
        double z_m;
        bool lit;
    } cases[] = {{0.2, true}, {0.15, true}, {0.05, false}};
    for (int i = 0; i < 3; i++) {
        char text[600];
        snprintf(text, sizeof text,
                 "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.8}, {\"name\": \"k\"}], "
                 "\"parts\": [{\"name\": \"d\", \"kind\": \"dish\", \"radius_m\": 2, "
                 "\"length_m\": 0.5, \"segments\": 96, \"position_m\": [3, -1, 2], \"material\": "
                 "\"k\"}, {\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [0.1, 0.1, 1], "
                 "\"position_m\": [4, -1, %g], \"material\": \"w\"}]}",
                 2 + cases[i].z_m);
        bst_test_model m = bst_test_model_open(text);
        bst_vec3 sun = bst_vec3_unit((bst_vec3){0.1, 0.2, 1}),
                 eye = bst_vec3_unit((bst_vec3){-0.2, 0.1, 1});
        double whole = 0.8 / BST_PI * 0.01 * sun.z * eye.z;
        bst_assert_close(bst_test_flux(&m, sun, eye), cases[i].lit ? whole : 0.0, 1e-9);
        /* from low over the rim only what it leaves is lit */
        bst_vec3 low = bst_vec3_unit((bst_vec3){-1, 0, 0.05});
        bst_assert_close(bst_test_flux(&m, low, eye), 0.0, 1e-9);
        bst_test_model_close(&m);
    }
}

/* The Sun's disc blurs the borders of shadows between parts: over its disc (4 rings of equal area
 * of 12 points) the light of a bus with panels and a boom is that of its centre, as a border loses
 * on one side what it gains on the other. */
static void penumbrae_leave_the_light(void **state) {
    (void)state;
    enum { RINGS = 4, AROUND = 12, DIRECTIONS = 40 };
    bst_test_model m = bst_test_model_open(
        "{" WHITE
        ", \"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [2, 2, 3], \"material\": "
        "\"w\"}, {\"name\": \"n\", \"kind\": \"plate\", \"size_m\": [2, 8, 1], \"position_m\": [0, "
        "6, "
        "0], \"rotation_deg\": [0, 30, 0], \"material\": \"w\"}, {\"name\": \"d\", \"kind\": "
        "\"plate\", \"size_m\": [3, 3, 1], \"position_m\": [1, 1, 8], \"rotation_deg\": [20, 10, "
        "0], "
        "\"material\": \"w\"}]}");
    const double sun_rad = 0.00465;
    uint64_t random = 19;
    double worst = 0.0, square = 0.0;
    for (int i = 0; i < DIRECTIONS; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        bst_vec3 x = bst_vec3_perpendicular(sun), y = bst_vec3_cross(sun, x);
        double centre = bst_test_flux(&m, sun, eye), sum = 0.0;
        for (int k = 0; k < RINGS * AROUND; k++) {
            double r = sun_rad * sqrt((k / AROUND + 0.5) / RINGS);
            double a = 2.0 * BST_PI * (k % AROUND + 0.5 * (k / AROUND % 2)) / AROUND;
            bst_vec3 to = bst_vec3_axpy(bst_vec3_axpy(sun, r * cos(a), x), r * sin(a), y);
            sum += bst_test_flux(&m, bst_vec3_unit(to), eye) / (RINGS * AROUND);
        }
        double error = (sum - centre) / fmax(centre, 0.1);
        worst = fmax(worst, fabs(error));
        square += error * error / DIRECTIONS;
    }
    bst_assert_close(sqrt(square), 0.0, 4e-4);
    bst_assert_close(worst, 0.0, 2e-3);
    bst_test_model_close(&m);
}

/* What faces the observer, and what it emits: a box of two emissivities behind a plate that hides a
 * quarter of its side. */
static void what_is_seen_emits(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(
        "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.3, \"emissivity\": 0.8}, {\"name\": "
        "\"w\", "
        "\"diffuse\": 0.2, \"emissivity\": 0.25}], \"parts\": [{\"name\": \"b\", \"kind\": "
        "\"box\", "
        "\"size_m\": [2, 3, 4], \"material\": \"m\"}, {\"name\": \"p\", \"kind\": \"plate\", "
        "\"size_m\": [1, 1.5, 0], \"position_m\": [0.5, 0.75, 5], \"material\": \"w\"}]}");
    for (int k = 0; k < 2; k++) {
        bst_vec3 eye = k ? bst_vec3_unit((bst_vec3){2, -1, 2}) : (bst_vec3){0, 0, 1};
        bst_satellite_light light = {.sun = {1, 0, 0}, .observer = eye, .emission = true};
        bst_satellite_aim aim = {.sun = {1, 0, 0}, .earth = {0, 0, 1}, .target = eye};
        bst_satellite_flux flux;
        bst_satellite_pose_set(m.pose, &aim);
        bst_satellite_flux_at(m.pose, &light, &flux);
        /* along z the plate hides what lies behind it; from aside, at 45 degrees, nothing */
        double box_m2 = k ? 12.0 * eye.x - 8.0 * eye.y + 6.0 * eye.z : 6.0 - 1.5;
        double plate_m2 = 1.5 * eye.z;
        bst_assert_close(flux.visible_m2, box_m2 + plate_m2, 1e-9);
        bst_assert_close(flux.emission_m2, 0.8 * box_m2 + 0.25 * plate_m2, 1e-9);
    }
    bst_test_model_close(&m);
}

/* A thin round end that is tilted by 53 degrees to either side of two axes, and a plate that hides
 * the last fifth of its width: a segment of an ellipse. */
static void a_plate_hides_the_fringe_of_a_disc(void **state) {
    (void)state;
    const double tilt = acos(0.6);
    for (int k = 0; k < 4; k++) {
        double a = k % 2 ? -tilt : tilt, lost[2] = {0.0};
        for (int side = -1; side <= 1; side += 2) {
            double flux[2];
            /* axes of the image: across the tilt, and along it; the body turns about y, or about x
             */
            bst_vec3 way = k < 2 ? (bst_vec3){sin(a), 0, cos(a)} : (bst_vec3){0, -sin(a), cos(a)};
            bst_vec3 across =
                k < 2 ? (bst_vec3){cos(a), 0, -sin(a)} : (bst_vec3){0, cos(a), sin(a)};
            /* its middle is 0.5 m beyond what it hides first */
            bst_vec3 at = bst_vec3_axpy(bst_vec3_scale(way, 5), side * (0.6 * 0.8 + 0.5), across);
            for (int n = 0; n < 2; n++) {
                char text[700];
                snprintf(
                    text, sizeof text,
                    "{\"materials\": [{\"name\": \"m\", \"diffuse\": 0.5}, {\"name\": \"k\", "
                    "\"diffuse\": 0}], \"parts\": [{\"name\": \"d\", \"kind\": \"cylinder\", "
                    "\"radius_m\": 1, \"length_m\": 1e-4, \"segments\": 96, \"material\": \"m\"}, "
                    "{\"name\": \"p\", \"kind\": \"plate\", \"size_m\": [%d, %d, 0], "
                    "\"position_m\": [%.12g, %.12g, %.12g], \"rotation_deg\": [%.12g, %.12g, 0], "
                    "\"material\": \"k\"}]}",
                    k < 2 ? 1 : 4, k < 2 ? 4 : 1, n ? at.x : 50 * across.x,
                    n ? at.y : 50 * across.y, n ? at.z : 50 * across.z,
                    k < 2 ? 0.0 : a / BST_DEG_RAD, k < 2 ? a / BST_DEG_RAD : 0.0);
                bst_test_model m = bst_test_model_open(text);
                flux[n] = bst_test_flux(&m, way, way);
                bst_test_model_close(&m);
            }
            lost[side > 0] = 1.0 - flux[1] / flux[0];
        }
        double want = (acos(0.8) - 0.8 * 0.6) / BST_PI; /* of a circle, beyond 0.8 of its radius */
        for (int side = 0; side < 2; side++) {
            bst_assert_close(lost[side], want, 0.02 * want); /* the tolerance of a surface */
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_seen_emits),
        cmocka_unit_test(highlights_in_shadow_are_dark),
        cmocka_unit_test(sphere_has_its_closed_form),
        cmocka_unit_test(cylinder_has_its_closed_form),
        cmocka_unit_test(box_and_plate_have_their_closed_forms),
        cmocka_unit_test(cone_is_the_sum_of_strips),
        cmocka_unit_test(shadow_of_a_plate_is_exact),
        cmocka_unit_test(shadows_agree_with_rays),
        cmocka_unit_test(joints_follow_tables_and_burns),
        cmocka_unit_test(panels_follow_the_sun),
        cmocka_unit_test(joints_spin_by_the_right_hand),
        cmocka_unit_test(glint_has_the_width_of_the_sun),
        cmocka_unit_test(penumbrae_leave_the_light),
        cmocka_unit_test(earthlight_has_its_closed_form),
        cmocka_unit_test(a_plate_in_a_dish),
        cmocka_unit_test(a_plate_hides_the_fringe_of_a_disc),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
