/* Facets of curved surfaces in finer parts: ranges, corners, normals and areas by closed forms. */
#include "sim/satellite/curved_patches.h"

#include "tests/satellite/satellite_support.h"

#define BODY(shape)                                                                             \
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": [{\"name\": "            \
    "\"b\", \"material\": \"w\", \"position_m\": [0.3, -0.7, 1.1], \"rotation_deg\": [20, 30, " \
    "40], " shape "}]}"

enum { SEGMENTS = 12 };

static const struct {
    const char *text;
    double radius, top, length;
    bool sphere;
} bodies[] = {
    {BODY("\"kind\": \"cylinder\", \"radius_m\": 1.5, \"length_m\": 2, \"segments\": 12"), 1.5, 1.5,
     2.0, false},
    {BODY("\"kind\": \"cone\", \"radius_m\": 1.5, \"top_radius_m\": 0.5, \"length_m\": 2, "
          "\"segments\": 12"),
     1.5, 0.5, 2.0, false},
    {BODY("\"kind\": \"sphere\", \"radius_m\": 1.5, \"segments\": 12"), 1.5, 1.5, 0.0, true},
};
enum { BODIES = sizeof bodies / sizeof bodies[0] };

/* Ranges of each facet: a segment of azimuth; of a cone both ends at their radii, of a sphere a
 * ring of latitude. */
static void ranges_of_facets(void **state) {
    (void)state;
    for (int n = 0; n < BODIES; n++) {
        bst_ctx ctx = {0};
        bst_test_model m = bst_test_model_open(bodies[n].text);
        const bst_satellite *s = m.satellite;
        bst_curved_places places;
        bst_assert_ok(&ctx, bst_curved_places_create(&ctx, s, &places));
        double around = 0.0, up = 0.0;
        int facets = 0;
        for (int i = 0; i < s->facet_count; i++) {
            if (s->facets[i].curved < 0) {
                continue;
            }
            bst_curved_facet f;
            bst_curved_facet_make(m.pose, &places, i, &f);
            facets++;
            around += f.azimuth[1] - f.azimuth[0];
            bst_assert_close(f.azimuth[1] - f.azimuth[0], 2.0 * BST_PI / SEGMENTS, 1e-12);
            assert_true(f.height[1] > f.height[0]);
            if (bodies[n].sphere) {
                up += f.height[1] - f.height[0];
                assert_true(f.height[0] > -0.5 * BST_PI - 1e-9);
                assert_true(f.height[1] < 0.5 * BST_PI + 1e-9);
            } else {
                up += f.height[1] - f.height[0];
                bst_assert_close(f.height[1], 0.5 * bodies[n].length, 1e-12);
                bst_assert_close(f.height[0], -0.5 * bodies[n].length, 1e-12);
                bst_assert_close(f.radius_m[0], bodies[n].radius, 1e-12);
                bst_assert_close(f.radius_m[1], bodies[n].top, 1e-12);
            }
            bst_assert_close(bst_vec3_norm(f.x), 1.0, 1e-12);
            bst_assert_close(bst_vec3_norm(bst_vec3_sub(bst_vec3_cross(f.x, f.y), f.z)), 0.0,
                             1e-12);
            bst_vec3 off = bst_vec3_sub(f.centre, (bst_vec3){0.3, -0.7, 1.1});
            bst_assert_close(bst_vec3_norm(off), 0.0, 1e-12);
        }
        int rings = facets / SEGMENTS;
        bst_assert_close(around, 2.0 * BST_PI * rings, 1e-9);
        /* rings of a sphere follow each other from pole to pole */
        double range = bodies[n].sphere ? BST_PI : bodies[n].length;
        bst_assert_close(up, SEGMENTS * range, 1e-9);
        assert_int_equal(rings, bodies[n].sphere ? SEGMENTS / 2 : 1);
        bst_curved_places_free(&places);
        bst_test_model_close(&m);
    }
}

/* Area of a quadrilateral. */
static double area_of(const bst_vec3 c[4]) {
    bst_vec3 d = bst_vec3_sub(c[2], c[0]), e = bst_vec3_sub(c[3], c[1]);
    return 0.5 * bst_vec3_norm(bst_vec3_cross(d, e));
}

/* Parts of a facet: their corners are on the surface that has `scale` times the radius, each
 * turns counter-clockwise from outside, and together they have the area of the surface in the limit
 * of small parts; the normal at a part's middle is that of its diagonals. */
static void parts_of_facets(void **state) {
    (void)state;
    static const double areas[BODIES] = {
        2.0 * BST_PI * 1.5 * 2.0, BST_PI * 2.0 * 2.2360679774997896, 4.0 * BST_PI * 1.5 * 1.5};
    for (int n = 0; n < BODIES; n++) {
        bst_ctx ctx = {0};
        bst_test_model m = bst_test_model_open(bodies[n].text);
        const bst_satellite *s = m.satellite;
        const int parts[2] = {5, 3};
        bst_curved_places places;
        bst_assert_ok(&ctx, bst_curved_places_create(&ctx, s, &places));
        double area = 0.0;
        for (int i = 0; i < s->facet_count; i++) {
            bst_curved_facet f;
            if (s->facets[i].curved < 0) {
                continue;
            }
            bst_curved_facet_make(m.pose, &places, i, &f);
            /* a polygon of 12 x 5 sides with the area of the circle; of a sphere also from pole to
             * pole in 6 x 3 steps */
            double side = 2.0 * BST_PI / (SEGMENTS * parts[0]), step = BST_PI / (6.0 * parts[1]);
            double scale =
                sqrt(side / sin(side)) * (bodies[n].sphere ? sqrt(step / sin(step)) : 1.0);
            bst_assert_close(bst_curved_facet_scale(&f, parts[0], parts[1]), scale, 1e-12);
            for (int p = 0; p < parts[0] * parts[1]; p++) {
                const int place[2] = {p % parts[0], p / parts[0]};
                bst_vec3 corner[4];
                bst_curved_facet_part(&f, parts, place, scale, corner);
                for (int k = 0; k < 4; k++) {
                    bst_vec3 r = bst_vec3_sub(corner[k], (bst_vec3){0.3, -0.7, 1.1});
                    double z = bst_vec3_dot(r, f.z), flat = bst_vec3_norm(bst_vec3_cross(r, f.z));
                    double v = z / bodies[n].length + 0.5; /* 0 to 1 from low to high */
                    double want = bodies[n].radius + v * (bodies[n].top - bodies[n].radius);
                    double found = bodies[n].sphere ? bst_vec3_norm(r) : flat;
                    bst_assert_close(found, scale * (bodies[n].sphere ? 1.5 : want), 1e-12);
                }
                area += area_of(corner);
                double u = (place[0] + 0.5) / parts[0], v = (place[1] + 0.5) / parts[1];
                bst_vec3 normal = bst_curved_facet_normal(&f, u, v);
                bst_vec3 turn = bst_vec3_cross(bst_vec3_sub(corner[2], corner[0]),
                                               bst_vec3_sub(corner[3], corner[1]));
                bst_assert_close(bst_vec3_norm(normal), 1.0, 1e-12);
                /* of a trapezium on a sphere it leans by a part of half a step, 0.08 rad; of a cone
                 * by that of scale on its slope, 1e-3 x 0.5 / 1.25 */
                bst_assert_close(bst_vec3_angle(normal, turn), 0.0, bodies[n].sphere ? 0.02 : 4e-4);
            }
        }
        bst_assert_close(area, areas[n], 6e-3 * areas[n]); /* square of the steps over 6 */
        bst_curved_places_free(&places);
        bst_test_model_close(&m);
    }
}

/* An end of a cylinder or cone whose rim is divided: the area of its circle, whatever the number.
 */
static void ends_of_cones(void **state) {
    (void)state;
    for (int n = 0; n < 2; n++) {
        bst_ctx ctx = {0};
        bst_test_model m = bst_test_model_open(bodies[n].text);
        const bst_satellite *s = m.satellite;
        bst_curved_places places;
        bst_assert_ok(&ctx, bst_curved_places_create(&ctx, s, &places));
        int ends = 0;
        for (int i = 0; i < s->facet_count; i++) {
            if (s->facets[i].curved >= 0) {
                continue;
            }
            ends++;
            for (int around = 1; around <= 4; around += 3) {
                bst_vec3 corner[4 * SEGMENTS], sum = {0}, normal = s->facets[i].normal;
                int count = bst_plane_facet_corners(m.pose, &places, i, around, corner);
                assert_int_equal(count, SEGMENTS * around);
                for (int k = 0; k < count; k++) {
                    bst_vec3 a = bst_vec3_sub(corner[k], corner[0]);
                    bst_vec3 b = bst_vec3_sub(corner[(k + 1) % count], corner[0]);
                    sum = bst_vec3_axpy(sum, 0.5, bst_vec3_cross(a, b));
                    bst_assert_close(bst_vec3_dot(a, normal), 0.0, 1e-12); /* in its plane */
                }
                double r =
                    bst_vec3_norm(bst_vec3_sub(s->vertices[s->corner[s->facets[i].first]],
                                               s->vertices[s->corner[s->facets[i].first + 6]]));
                double circle = BST_PI * (r < 2.0 ? 0.25 : 2.25);
                bst_assert_close(bst_vec3_dot(sum, normal), circle, 1e-11 * circle);
            }
        }
        assert_int_equal(ends, 2);
        bst_curved_places_free(&places);
        bst_test_model_close(&m);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(ranges_of_facets),
                                       cmocka_unit_test(parts_of_facets),
                                       cmocka_unit_test(ends_of_cones)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
