/* Light of straight lines that bodies hide, against rays from points of the lines. */
#include "sim/satellite/line_shadow.h"

#include "sim/satellite/pose_view.h"
#include "tests/satellite/satellite_support.h"

/* Lines are on the top of the first body. */
#define MODEL                                                                                    \
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": ["                        \
    "{\"name\": \"own\", \"kind\": \"box\", \"size_m\": [9, 9, 0.2], \"material\": \"w\"}, "     \
    "{\"name\": \"box\", \"kind\": \"box\", \"size_m\": [1.2, 0.8, 0.6], \"position_m\": [0.4, " \
    "0.3, 3], \"material\": \"w\"}, "                                                            \
    "{\"name\": \"ball\", \"kind\": \"sphere\", \"radius_m\": 0.7, \"position_m\": [-1.5, 0.8, " \
    "4], \"segments\": 48, \"material\": \"w\"}, "                                               \
    "{\"name\": \"cup\", \"kind\": \"cone\", \"radius_m\": 0.9, \"top_radius_m\": 0.3, "         \
    "\"length_m\": 1.4, \"position_m\": [0.8, -1.6, 3.5], \"segments\": 48, \"material\": "      \
    "\"w\"}]}"

/* Whether a ray meets the box, by its slabs. */
static bool meets_box(bst_vec3 at, bst_vec3 way) {
    const double p[3] = {at.x - 0.4, at.y - 0.3, at.z - 3.0}, d[3] = {way.x, way.y, way.z};
    const double half[3] = {0.6, 0.4, 0.3};
    double low = 0.0, high = INFINITY;
    for (int k = 0; k < 3; k++) {
        double a = (-half[k] - p[k]) / d[k], b = (half[k] - p[k]) / d[k];
        low = fmax(low, fmin(a, b));
        high = fmin(high, fmax(a, b));
    }
    return low < high;
}

static bool meets_ball(bst_vec3 at, bst_vec3 way) {
    bst_vec3 to = bst_vec3_sub((bst_vec3){-1.5, 0.8, 4.0}, at);
    double along = bst_vec3_dot(to, way);
    return along > 0.0 && bst_vec3_dot(to, to) - along * along < 0.49;
}

/* The cone's side: r = 0.6 - 3 z / 7 at the height z about its middle, of 0.9 to 0.3; and both
 * ends. */
static bool meets_cup(bst_vec3 at, bst_vec3 way) {
    double x = at.x - 0.8, y = at.y + 1.6, z = at.z - 3.5;
    for (int end = -1; end <= 1; end += 2) {
        double t = (0.7 * end - z) / way.z;
        if (t > 0.0 && hypot(x + t * way.x, y + t * way.y) < (end > 0 ? 0.3 : 0.9)) {
            return true;
        }
    }
    double r = 0.6 - 3.0 / 7.0 * z, s = -3.0 / 7.0 * way.z;
    double a = way.x * way.x + way.y * way.y - s * s, b = x * way.x + y * way.y - r * s;
    double c = x * x + y * y - r * r, root = b * b - a * c;
    for (int sign = -1; sign <= 1 && root > 0.0; sign += 2) {
        double t = (-b + sign * sqrt(root)) / a;
        if (t > 0.0 && fabs(z + t * way.z) < 0.7) {
            return true;
        }
    }
    return false;
}

static bool is_hidden(bst_vec3 at, bst_vec3 way) {
    return meets_box(at, way) || meets_ball(at, way) || meets_cup(at, way);
}

/* Lines in a plane below all bodies, of which each hides some toward the Sun or the observer. */
static void hidden_parts_of_lines(void **state) {
    (void)state;
    enum { STEPS = 4000, LINES = 60 };
    bst_test_model m = bst_test_model_open(MODEL);
    uint64_t random = 77;
    int some = 0, all = 0, none = 0;
    for (int n = 0; n < LINES; n++) {
        bst_vec3 to[2]; /* within 0.5 rad of the z axis */
        for (int k = 0; k < 2; k++) {
            to[k] = bst_vec3_unit((bst_vec3){0.8 * (bst_test_uniform(&random) - 0.5),
                                             0.8 * (bst_test_uniform(&random) - 0.5), 1.0});
        }
        const bst_satellite_aim aim = {.sun = to[1], .earth = {0, 0, 1}, .target = to[0]};
        bst_satellite_pose_set(m.pose, &aim);
        bst_pose_look(m.pose, 0, to[0]);
        bst_pose_look(m.pose, 1, to[1]);
        bst_light_line line = {.normal = {0, 0, 1},
                               .from_weight = 0.3 + bst_test_uniform(&random),
                               .to_weight = 2.0 * bst_test_uniform(&random)};
        line.from = (bst_vec3){4.0 * bst_test_uniform(&random) - 2.5,
                               4.0 * bst_test_uniform(&random) - 2.5, 0.1};
        line.to = (bst_vec3){line.from.x + 4.0 * bst_test_uniform(&random) - 2.0,
                             line.from.y + 4.0 * bst_test_uniform(&random) - 2.0, 0.1};
        const bst_line_ring rings[2] = {{.centre = line.from, .axis = {0, 0, 1}},
                                        {.centre = line.to, .axis = {0, 0, 1}}};
        bst_line_shadow shadow;
        double want = 0.0, found = 0.0;
        for (int i = 0; i < STEPS; i++) {
            double t = (i + 0.5) / STEPS;
            bst_vec3 at = bst_vec3_axpy(line.from, t, bst_vec3_sub(line.to, line.from));
            if (is_hidden(at, to[0]) || is_hidden(at, to[1])) {
                want += (line.from_weight + t * (line.to_weight - line.from_weight)) / STEPS;
            }
        }
        if (bst_line_shadow_make(m.pose, 0, false, rings, 2, &shadow)) {
            found = bst_line_shadow_lost(&shadow, &line);
        }
        double whole = 0.5 * (line.from_weight + line.to_weight);
        /* half a step at each of up to twelve borders; round bodies are exact */
        bst_assert_close(found, want, 6.0 * 2.0 / STEPS);
        some += want > 0.02 * whole && want < 0.98 * whole;
        all += want >= 0.98 * whole;
        none += want == 0.0;
    }
    assert_true(some > LINES / 2 && all > 0 && none > 0);
    bst_test_model_close(&m);
}

/* The silhouette of each body toward the observer: polygons are about it, no corner of a plane one
 * is beyond; straight sides of the cone touch both its ends, and a ball has none. */
static void silhouettes(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(MODEL);
    bst_vec3 to = bst_vec3_unit((bst_vec3){0.3, 0.2, 0.6});
    const bst_satellite_aim aim = {.sun = to, .earth = {0, 0, 1}, .target = to};
    bst_satellite_pose_set(m.pose, &aim);
    bst_pose_look(m.pose, 0, to);
    bst_pose_look(m.pose, 1, to);
    const bst_line_ring ring = {.centre = {0, 0, 0.1}, .axis = {0, 0, 1}, .radius_m = 100.0};
    bst_line_shadow w;
    assert_true(bst_line_shadow_make(m.pose, 0, false, &ring, 1, &w));
    assert_int_equal(w.first[1] - w.first[0], 3); /* the three others */
    const bst_pose_view *v = &m.pose->views[0];
    for (int i = w.first[0]; i < w.first[1]; i++) {
        bst_point2 p[BST_LINE_CORNERS_MAX], side[2][2];
        int body = m.pose->hiders[i][0], count = bst_line_shadow_corners(&w, 0, i, p);
        bool sides = bst_line_shadow_tangents(&w, i, side);
        double area = 0.0;
        for (int k = 0; k < count; k++) {
            bst_point2 a = p[k], b = p[(k + 1) % count];
            area += 0.5 * (a.x * b.y - b.x * a.y);
        }
        assert_int_equal(sides, body == 3);
        if (body == 1) { /* three faces of the box by their cosines */
            double faces = 0.8 * 0.6 * to.x + 1.2 * 0.6 * to.y + 1.2 * 0.8 * to.z;
            bst_assert_close(fabs(area), faces, 1e-9);
        } else if (body == 2) { /* 8 % wider at most */
            assert_true(fabs(area) >= BST_PI * 0.49 && fabs(area) < 1.17 * BST_PI * 0.49);
        } else if (body == 3) { /* each side touches the ellipses of both circles */
            for (int k = 0; k < 2; k++) {
                bst_point2 a = side[k][0], b = side[k][1];
                double length = hypot(b.x - a.x, b.y - a.y);
                for (int end = 0; end < 2; end++) {
                    bst_vec3 centre = {0.8, -1.6, end ? 4.2 : 2.8};
                    bst_point2 c = {bst_vec3_dot(centre, v->x), bst_vec3_dot(centre, v->y)};
                    /* distance of a tangent from the centre of a circle seen at an angle */
                    double nx = (b.y - a.y) / length, ny = (a.x - b.x) / length;
                    bst_vec3 normal = bst_vec3_axpy(bst_vec3_scale(v->x, nx), ny, v->y);
                    double reach = (end ? 0.3 : 0.9) * sqrt(1.0 - normal.z * normal.z);
                    double off = fabs((c.x - a.x) * nx + (c.y - a.y) * ny);
                    bst_assert_close(off, reach, 1e-9);
                }
            }
        }
    }
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(hidden_parts_of_lines),
                                       cmocka_unit_test(silhouettes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
