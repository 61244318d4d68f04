/* Areas of shadows: intersections of polygons against pieces, silhouettes against hulls. */
#include "sim/satellite/model_build.h"
#include "sim/satellite/polygon_covers.h"
#include "sim/satellite/polygon_cut.h"
#include "tests/satellite/satellite_support.h"

#define SQUARE(x_, y_, side_)                                               \
    {                                                                       \
        {x_, y_}, {(x_) + (side_), y_}, {(x_) + (side_), (y_) + (side_)}, { \
            x_, (y_) + (side_)                                              \
        }                                                                   \
    }

/* Half planes of a polygon, one by one. */
static int sides_of(const bst_point2 *points, int count, bst_half_plane *out) {
    bst_half_planes blocks[8];
    assert_int_equal(bst_half_planes_of(points, count, blocks),
                     (count + BST_HALF_PLANES - 1) / BST_HALF_PLANES);
    for (int i = 0; i < count; i++) {
        const bst_half_planes *b = &blocks[i / BST_HALF_PLANES];
        int k = i % BST_HALF_PLANES;
        out[i] = (bst_half_plane){b->u[k], b->v[k], b->w[k]};
    }
    return count;
}

static void add(bst_polygon_covers *covers, const bst_point2 *points, int count) {
    bst_half_plane sides[32];
    for (int i = 0; i < sides_of(points, count, sides); i++) {
        assert_true(bst_polygon_covers_add(covers, sides[i]));
    }
    assert_true(bst_polygon_covers_end(covers));
}

/* A polygon with its corners on an ellipse at random. */
static int random_polygon(uint64_t *state, bst_point2 *out) {
    int n = 3 + (int)(14.0 * bst_test_uniform(state));
    double x = 2.0 * bst_test_uniform(state), y = 2.0 * bst_test_uniform(state);
    double a = 0.2 + bst_test_uniform(state), b = 0.2 + bst_test_uniform(state);
    for (int i = 0; i < n; i++) {
        double angle = 2.0 * BST_PI * (i + 0.9 * bst_test_uniform(state)) / n;
        out[i] = (bst_point2){x + a * cos(angle), y + b * sin(angle)};
    }
    return n;
}

static void squares_have_closed_forms(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_polygon_covers covers;
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &covers));
    const bst_point2 whole[] = SQUARE(0.0, 0.0, 4.0), a[] = SQUARE(1.0, 1.0, 2.0);
    const bst_point2 b[] = SQUARE(2.0, 2.0, 3.0), far[] = SQUARE(4.0, 0.0, 1.0);
    /* sums of a few numbers of size 16 */
    bst_assert_close(bst_polygon_uncovered_area(&covers, whole, 4), 16.0, 1e-14);
    add(&covers, a, 4);
    bst_assert_close(bst_polygon_uncovered_area(&covers, whole, 4), 12.0, 1e-14);
    add(&covers, b, 4); /* 4 of 9 are in the square, 1 of these in a */
    bst_assert_close(bst_polygon_uncovered_area(&covers, whole, 4), 9.0, 1e-14);
    add(&covers, far, 4); /* touches */
    bst_assert_close(bst_polygon_uncovered_area(&covers, whole, 4), 9.0, 1e-14);
    add(&covers, whole, 4);
    assert_true(bst_polygon_uncovered_area(&covers, whole, 4) == 0.0);
    assert_int_equal(bst_polygon_place_of(a, 4, whole, 4), BST_POLYGON_WITHIN);
    assert_int_equal(bst_polygon_place_of(whole, 4, a, 4), BST_POLYGON_CROSSING);
    assert_int_equal(bst_polygon_place_of(b, 4, whole, 4), BST_POLYGON_CROSSING);
    const bst_point2 beside[] = SQUARE(4.5, 0.0, 1.0);
    assert_int_equal(bst_polygon_place_of(beside, 4, whole, 4), BST_POLYGON_APART);
    /* through two corners, which stay, and cut the first one off; then x >= 1 */
    bst_polygon_covers_clear(&covers);
    assert_true(bst_polygon_covers_add(&covers, (bst_half_plane){1.0, 1.0, -4.0}));
    assert_true(bst_polygon_covers_add(&covers, (bst_half_plane){1.0, 0.0, -1.0}));
    assert_true(bst_polygon_covers_end(&covers));
    bst_assert_close(bst_polygon_uncovered_area(&covers, whole, 4), 8.5, 1e-14);
    bst_polygon_covers_free(&covers);
}

/* Two ways to the same area. */
static void intersections_agree_with_pieces(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_polygon_covers covers;
    bst_polygon_clip clip;
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &covers));
    bst_assert_ok(&ctx, bst_polygon_clip_create(&ctx, &clip));
    uint64_t random = 5;
    int partial = 0, given_up = 0;
    for (int i = 0; i < 2000; i++) {
        bst_point2 p[20], whole[20];
        int n = random_polygon(&random, whole), wanted = i % BST_POLYGON_COVERS_MAX;
        bst_polygon_clip_start(&clip, whole, n);
        bst_polygon_covers_clear(&covers);
        for (int k = 0; k < wanted; k++) {
            int m = random_polygon(&random, p);
            bst_polygon_clip_subtract(&clip, p, m, false);
            add(&covers, p, m);
        }
        double area = bst_polygon_uncovered_area(&covers, whole, n);
        if (area < 0.0) {
            given_up++;
            continue;
        }
        bst_assert_close(area, bst_polygon_clip_area(&clip), 1e-13); /* of areas about 1 */
        partial += area > 1e-9 && area < bst_polygon_area(whole, n) - 1e-9;
    }
    assert_true(partial > 500);
    assert_true(given_up > 0 && given_up < 1000);
    bst_polygon_covers_free(&covers);
    bst_polygon_clip_free(&clip);
}

/* Adds a polygon of many corners that another half plane cuts, with its corners or without. */
static void add_round(bst_polygon_covers *covers, const bst_point2 *points, int count,
                      bst_half_plane cut, bool with_corners) {
    bst_half_planes blocks[16];
    assert_true(bst_half_planes_of(points, count, blocks) <= 16);
    for (int i = 0; i < count; i++) {
        const bst_half_planes *b = &blocks[i / BST_HALF_PLANES];
        int k = i % BST_HALF_PLANES;
        assert_true(bst_polygon_covers_add(covers, (bst_half_plane){b->u[k], b->v[k], b->w[k]}));
    }
    bst_point2 *to = with_corners ? bst_polygon_covers_corners(covers, count) : NULL;
    assert_true(to || !with_corners);
    for (int i = 0; i < count && to; i++) {
        to[i] = points[i];
    }
    assert_true(bst_polygon_covers_add(covers, cut));
}

/* Sets of many sides are cut by the polygon, if their corners are known, in place of the other way
 * round. */
static void corners_of_sets_change_no_area(void **state) {
    enum { CORNERS = 48, SETS = 3 };
    (void)state;
    bst_ctx ctx = {0};
    bst_polygon_covers with, without;
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &with));
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &without));
    uint64_t random = 6;
    int partial = 0;
    for (int i = 0; i < 500; i++) {
        bst_point2 whole[20], round[CORNERS], other[CORNERS];
        int n = random_polygon(&random, whole);
        bst_polygon_covers_clear(&with);
        bst_polygon_covers_clear(&without);
        for (int set = 0; set < SETS; set++) {
            double x = 2.0 * bst_test_uniform(&random), y = 2.0 * bst_test_uniform(&random);
            double radius = 0.1 + 0.6 * bst_test_uniform(&random);
            double angle = 2.0 * BST_PI * bst_test_uniform(&random);
            for (int k = 0; k < CORNERS; k++) {
                double a = 2.0 * BST_PI * k / CORNERS + angle;
                round[k] = (bst_point2){x + radius * cos(a), y + 0.7 * radius * sin(a)};
                other[k] = (bst_point2){round[k].x + 0.5, round[k].y};
            }
            const bst_half_plane cut = {cos(angle), sin(angle),
                                        0.3 * radius - x * cos(angle) - y * sin(angle)};
            add_round(&with, other, CORNERS, cut, true);
            bst_polygon_covers_restart(&with); /* forgets the corners, too */
            add_round(&with, round, CORNERS, cut, set != 1);
            add_round(&without, round, CORNERS, cut, false);
            assert_true(bst_polygon_covers_end(&with));
            assert_true(bst_polygon_covers_end(&without));
        }
        double area = bst_polygon_uncovered_area(&with, whole, n);
        /* sums of a few areas about 1 */
        bst_assert_close(area, bst_polygon_uncovered_area(&without, whole, n), 1e-13);
        partial += area > 1e-9 && area < bst_polygon_area(whole, n) - 1e-9;
    }
    assert_true(partial > 200);
    bst_polygon_covers_free(&with);
    bst_polygon_covers_free(&without);
}

/* A cut through a corner leaves two corners within rounding, with a side of a random direction,
 * which must not cut the set that is cut by the polygon. */
static void cuts_through_corners_change_no_area(void **state) {
    enum { CORNERS = 48 };
    (void)state;
    bst_ctx ctx = {0};
    bst_polygon_covers covers[2]; /* with and without corners */
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &covers[0]));
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &covers[1]));
    uint64_t random = 7;
    int partial = 0;
    for (int i = 0; i < 10000; i++) {
        bst_point2 whole[3], round[CORNERS], middle = {0.0, 0.0};
        double turn = 2.0 * BST_PI * bst_test_uniform(&random), area[2];
        for (int k = 0; k < 3; k++) {
            double a = turn + 2.0 * BST_PI * (k + 0.6 * bst_test_uniform(&random)) / 3.0;
            whole[k] = (bst_point2){0.5 + cos(a), 0.3 + sin(a)};
            middle.x += whole[k].x / 3.0;
            middle.y += whole[k].y / 3.0;
        }
        double x = 0.2 + 0.6 * bst_test_uniform(&random), y = 0.6 * bst_test_uniform(&random);
        double radius = 0.3 + 1.2 * bst_test_uniform(&random);
        double angle = 2.0 * BST_PI * bst_test_uniform(&random);
        for (int k = 0; k < CORNERS; k++) {
            double a = 2.0 * BST_PI * k / CORNERS + angle;
            round[k] = (bst_point2){x + radius * cos(a), y + 0.7 * radius * sin(a)};
        }
        const bst_point2 corner = whole[i % 3];
        double tilt = 0.4 * (bst_test_uniform(&random) - 0.5), cut = 2.0 * BST_PI * tilt / 0.4;
        double dx = middle.x - corner.x, dy = middle.y - corner.y, length = 0.3 + tilt + 0.2;
        double u = dx * cos(tilt) - dy * sin(tilt), v = dx * sin(tilt) + dy * cos(tilt);
        const bst_point2 from = {corner.x - length * v, corner.y + length * u};
        double ex = corner.x - from.x, ey = corner.y - from.y;
        const bst_half_plane through = {-ey, ex, ey * from.x - ex * from.y};
        const bst_half_plane across = {cos(cut), sin(cut),
                                       0.2 - cos(cut) * middle.x - sin(cut) * middle.y};
        for (int k = 0; k < 2; k++) {
            bst_polygon_covers_clear(&covers[k]);
            add_round(&covers[k], round, CORNERS, across, k == 0);
            assert_true(bst_polygon_covers_end(&covers[k]));
            assert_true(bst_polygon_covers_add(&covers[k], through));
            assert_true(bst_polygon_covers_add(&covers[k], across));
            assert_true(bst_polygon_covers_end(&covers[k]));
            area[k] = bst_polygon_uncovered_area(&covers[k], whole, 3);
        }
        /* half planes of coordinates about 1; a side that is left out is below 1e-12 long */
        bst_assert_close(area[0], area[1], 1e-9);
        partial += area[0] > 1e-9 && area[0] < bst_polygon_area(whole, 3) - 1e-9;
    }
    assert_true(partial > 5000);
    bst_polygon_covers_free(&covers[0]);
    bst_polygon_covers_free(&covers[1]);
}

/* Half planes that do not cross a polygon do not change the area. */
static void crossing_sides_suffice(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_polygon_covers covers;
    bst_assert_ok(&ctx, bst_polygon_covers_create(&ctx, &covers));
    uint64_t random = 9;
    int apart = 0, within = 0, fewer = 0;
    for (int i = 0; i < 4000; i++) {
        bst_point2 p[20], whole[20];
        bst_half_planes blocks[8];
        bst_half_plane sides[32];
        int n = random_polygon(&random, whole), m = random_polygon(&random, p), crossing[32];
        double bounds[4] = {INFINITY, -INFINITY, INFINITY, -INFINITY};
        for (int k = 0; k < n; k++) {
            whole[k].x = 1.0 + 0.3 * (whole[k].x - 1.0);
            whole[k].y = 1.0 + 0.3 * (whole[k].y - 1.0);
            bounds[0] = fmin(bounds[0], whole[k].x), bounds[1] = fmax(bounds[1], whole[k].x);
            bounds[2] = fmin(bounds[2], whole[k].y), bounds[3] = fmax(bounds[3], whole[k].y);
        }
        bst_polygon_covers_clear(&covers);
        add(&covers, p, m);
        double right = bst_polygon_uncovered_area(&covers, whole, n);
        (void)sides_of(p, m, sides);
        int found = bst_half_planes_crossing(blocks, bst_half_planes_of(p, m, blocks), whole, n,
                                             bounds, crossing);
        bst_polygon_covers_clear(&covers);
        for (int k = 0; k < found; k++) {
            assert_true(bst_polygon_covers_add(&covers, sides[crossing[k]]));
        }
        if (found >= 0) {
            assert_true(bst_polygon_covers_end(&covers));
        }
        /* rounding of areas about 1 */
        bst_assert_close(bst_polygon_uncovered_area(&covers, whole, n), right, 1e-14);
        apart += found < 0;
        within += found == 0;
        fewer += found > 0 && found < m;
    }
    assert_true(apart > 100 && within > 100 && fewer > 1000);
    bst_polygon_covers_free(&covers);
}

#define SATELLITE                                                                              \
    "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], \"parts\": ["                      \
    "{\"name\": \"bus\", \"kind\": \"box\", \"size_m\": [2, 2, 3], \"material\": \"w\"}, "     \
    "{\"name\": \"mast\", \"kind\": \"cylinder\", \"radius_m\": 0.2, \"length_m\": 2, "        \
    "\"position_m\": [0.5, 0.4, 2.51], \"material\": \"w\"}, "                                 \
    "{\"name\": \"cone\", \"kind\": \"cone\", \"radius_m\": 0.5, \"top_radius_m\": 0.1, "      \
    "\"length_m\": 2, \"position_m\": [0.6, -0.5, 1.7], \"material\": \"w\"}, "                \
    "{\"name\": \"wing\", \"kind\": \"plate\", \"size_m\": [1, 5, 1], \"position_m\": [0, 2, " \
    "0.5], \"rotation_deg\": [20, 30, 0], \"material\": \"w\"}, "                              \
    "{\"name\": \"dish\", \"kind\": \"dish\", \"radius_m\": 1, \"length_m\": 0.3, "            \
    "\"position_m\": [1.8, 0, 1], \"rotation_deg\": [0, -40, 0], \"material\": \"w\"}]}"

/* Bodies that intersect, and a shell. */
static void areas_agree_with_pieces(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(SATELLITE);
    uint64_t random = 11;
    int partial = 0;
    for (int i = 0; i < 240; i++) {
        bst_vec3 sun = bst_test_direction(&random), eye = bst_test_direction(&random);
        if (i % 2) { /* along the mast but for rounding: both of its ends have one outline */
            sun = (bst_vec3){1e-16 * sun.x, 1e-16 * sun.y, 1.0};
        }
        bst_pose_look(m.pose, 0, eye);
        bst_pose_look(m.pose, 1, sun);
        for (int f = 0; f < m.satellite->facet_count; f++) {
            if (bst_vec3_dot(m.pose->normals[f], sun) > 1e-6 &&
                bst_vec3_dot(m.pose->normals[f], eye) > 1e-6) {
                bool whole;
                double pieces = bst_pose_unshadowed(m.pose, f, 2, &whole);
                double area = bst_pose_unshadowed_area(m.pose, f, 2);
                /* corners of shadows at grazing angles keep ten digits */
                bst_assert_close(area, pieces, 1e-10);
                partial += area > 1e-6 && area < m.satellite->facets[f].area_m2 - 1e-6;
            }
        }
    }
    assert_true(partial > 500);
    bst_test_model_close(&m);
}

/* A double cone of 600 sides, whose silhouette has more corners than polygons may have, hides a
 * whole box behind it. */
static void many_corners_hide_a_whole_facet(void **state) {
    (void)state;
    enum { SIDES = 600 };
    bst_ctx ctx = {0};
    bst_satellite *s;
    bst_assert_ok(&ctx, bst_test_satellite(&ctx,
                                           "{\"materials\": [{\"name\": \"w\", \"diffuse\": 0.5}], "
                                           "\"parts\": [{\"name\": \"a\", \"size_m\": [1, 1, 1], "
                                           "\"material\": \"w\"}]}",
                                           &s));
    bst_part_place place = {
        .rotation = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, .position_m = {0, 0, 3}, .joint = -1};
    int first = s->facet_count, rim[SIDES], tip[2];
    bst_assert_ok(&ctx, bst_model_begin_occluder(&ctx, s));
    for (int i = 0; i < SIDES; i++) {
        double a = 2.0 * BST_PI * i / SIDES;
        bst_vec3 at = {2.0 * cos(a), 2.0 * sin(a), 0};
        bst_assert_ok(&ctx, bst_model_add_vertex(&ctx, s, &place, at, &rim[i]));
    }
    for (int k = 0; k < 2; k++) {
        bst_vec3 at = {0, 0, k ? 0.1 : -0.1};
        bst_assert_ok(&ctx, bst_model_add_vertex(&ctx, s, &place, at, &tip[k]));
    }
    for (int i = 0; i < 2 * SIDES; i++) {
        int from = rim[i / 2], to = rim[(i / 2 + 1) % SIDES];
        int corners[3] = {i % 2 ? from : to, i % 2 ? to : from, tip[i % 2]};
        bst_assert_ok(&ctx, bst_model_add_facet(&ctx, s, &place, corners, 3, 0, -1));
    }
    bst_assert_ok(&ctx, bst_model_end_occluder(&ctx, s, first));
    bst_test_model m = {.satellite = s};
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, s, &m.pose));
    const bst_point2 *outline;
    int lit = 0;
    bst_pose_look(m.pose, 0, bst_vec3_unit((bst_vec3){0.01, 0.02, 1}));
    assert_int_equal(bst_pose_outline(m.pose, 0, 1, &outline), SIDES);
    for (int f = 0; f < first; f++) {
        if (m.pose->normals[f].z > 0.5) {
            bst_assert_close(bst_pose_unshadowed_area(m.pose, f, 1), 0.0, 1e-12);
            lit++;
        }
    }
    assert_int_equal(lit, 1);
    bst_test_model_close(&m);
}

/* Silhouettes follow the edges; the hull of all corners is the truth. */
static void silhouettes_are_hulls(void **state) {
    (void)state;
    bst_test_model m = bst_test_model_open(SATELLITE);
    uint64_t random = 3;
    for (int i = 0; i < 200; i++) {
        bst_vec3 z = bst_test_direction(&random);
        bst_pose_look(m.pose, 0, z);
        for (int o = 0; o < m.satellite->occluder_count; o++) {
            const bst_occluder *body = &m.satellite->occluders[o];
            bst_point2 flat[512], hull[1024];
            for (int k = 0; k < body->vertex_count; k++) {
                bst_vec3 q = m.pose->vertices[body->first_vertex + k];
                flat[k] = (bst_point2){bst_vec3_dot(q, m.pose->views[0].x),
                                       bst_vec3_dot(q, m.pose->views[0].y)};
            }
            int corners = bst_polygon_hull(flat, body->vertex_count, hull);
            const bst_point2 *outline;
            int n = bst_pose_outline(m.pose, 0, o, &outline);
            assert_true(body->closed);
            /* rounding of areas of some square metres */
            bst_assert_close(bst_polygon_area(outline, n), bst_polygon_area(hull, corners), 1e-12);
        }
    }
    bst_test_model_close(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(squares_have_closed_forms),
        cmocka_unit_test(intersections_agree_with_pieces),
        cmocka_unit_test(corners_of_sets_change_no_area),
        cmocka_unit_test(cuts_through_corners_change_no_area),
        cmocka_unit_test(crossing_sides_suffice),
        cmocka_unit_test(areas_agree_with_pieces),
        cmocka_unit_test(many_corners_hide_a_whole_facet),
        cmocka_unit_test(silhouettes_are_hulls),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
