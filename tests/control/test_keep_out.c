/* Ways round keep-out cones against closed forms on the sphere and a brute-force search. */
#include "boresight/rng.h"
#include "control/guidance/keep_out.h"
#include "tests/test_support.h"

#define DEG BST_DEG_RAD

static bst_vec3 at(double lon_deg, double lat_deg) {
    return bst_vec3_from_radec(lon_deg * DEG, lat_deg * DEG);
}
static bst_keep_out_zone cone(double lon_deg, double lat_deg, double half_deg) {
    return (bst_keep_out_zone){BST_ZONE_SUN, at(lon_deg, lat_deg), half_deg * DEG};
}

/* Greatest depth in a zone along a path (after the way out of one that it starts in), and that the
 * pieces join and their slopes are right. */
static double walk(const bst_keep_out_route *path, const bst_keep_out_zone *zones, int count,
                   bst_vec3 to) {
    enum { STEPS = 4000 };
    double worst = 0.0, first = 0.0;
    bst_vec3 before = path->arcs[0].from, tangent, bend, t2, b2;
    if (path->left_zone >= 0) {
        first = path->arcs[0].length_rad;
    }
    for (int k = 0; k <= STEPS; k++) {
        double s = path->length_rad * k / STEPS, depth;
        bst_vec3 d = bst_keep_out_route_at(path, s, &tangent, &bend);
        bst_assert_close(bst_vec3_norm(d), 1.0, 1e-14);
        /* the way between two samples is no longer than s: nothing jumps */
        assert_true(bst_vec3_angle(d, before) <= path->length_rad / STEPS * (1.0 + 1e-9) + 1e-12);
        if (s > first) {
            bst_keep_out_inside(zones, count, d, &depth);
            worst = fmax(worst, depth);
        }
        /* difference quotient over 2e-6: 1e-12 of truncation, 1e-10 of rounding; not over a joint
         */
        if (path->count == 1 && s > 1e-5 && s < path->length_rad - 1e-5) {
            bst_vec3 up = bst_keep_out_route_at(path, s + 1e-6, &t2, &b2);
            bst_vec3 down = bst_keep_out_route_at(path, s - 1e-6, &t2, &b2);
            bst_vec3 slope = bst_vec3_scale(bst_vec3_sub(up, down), 1.0 / 2e-6);
            assert_true(bst_vec3_norm(bst_vec3_sub(slope, tangent)) < 1e-9);
        }
        before = d;
    }
    if (path->target_zone < 0) {
        assert_true(bst_vec3_angle(before, to) < 1e-9);
    }
    return worst;
}

static void zones_of_navigation(void **state) {
    (void)state;
    bst_keep_out_zone zones[BST_ZONE_KINDS];
    double r = 7078137.0;
    bst_keep_out e = {.sun_rad = 30 * DEG,
                      .moon_rad = 10 * DEG,
                      .earth = true,
                      .earth_limb_rad = 5 * DEG,
                      .limb_altitude_m = 100e3};
    int n = bst_keep_out_zones(&e, (bst_vec3){0, 0, r}, (bst_vec3){1.5e11, 0, 0},
                               (bst_vec3){0, 3.8e8, 0}, zones);
    assert_int_equal(n, 3);
    bst_assert_close(bst_vec3_angle(zones[0].axis, (bst_vec3){1, 0, 0}), 0.0, 1e-15);
    bst_assert_close(zones[1].half_angle_rad, 10 * DEG, 1e-15);
    assert_int_equal(zones[2].kind, BST_ZONE_EARTH);
    bst_assert_close(zones[2].axis.z, -1.0, 1e-15);
    /* limb of a sphere of 6478.137 km from 7078.137 km: 66.24 degrees from the nadir */
    bst_assert_close(zones[2].half_angle_rad, asin(6478137.0 / r) + 5 * DEG, 1e-14);
    e = (bst_keep_out){.earth = true, .limb_altitude_m = 800e3};
    n = bst_keep_out_zones(&e, (bst_vec3){0, 0, r}, (bst_vec3){0}, (bst_vec3){0}, zones);
    assert_int_equal(n, 1);
    bst_assert_close(zones[0].half_angle_rad, BST_PI / 2, 1e-15); /* inside the air */
    assert_int_equal(bst_keep_out_zones(&(bst_keep_out){0}, (bst_vec3){0, 0, r},
                                        (bst_vec3){1, 0, 0}, (bst_vec3){1, 0, 0}, zones),
                     0);
}

/* Start and goal at 60 degrees from the axis, on opposite sides of a cone of 25: two tangents of
 * length acos(cos 60 / cos 25), and between them the edge over what the tangents' feet leave: the
 * right-angled triangle start - foot - axis has cos(its angle at the axis) = tan 25 / tan 60. */
static void round_one_cone(void **state) {
    (void)state;
    bst_keep_out_zone zone = cone(0, 0, 25);
    for (int k = 0; k < 12; k++) {
        double turn = 30.0 * k;
        bst_vec3 axis = zone.axis;
        bst_vec3 side = bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(axis, turn * DEG)),
                                        (bst_vec3){0, 1, 0});
        bst_vec3 from =
            bst_vec3_add(bst_vec3_scale(axis, cos(60 * DEG)), bst_vec3_scale(side, sin(60 * DEG)));
        /* 170 degrees round the axis from the start */
        bst_vec3 other =
            bst_quat_rotate(bst_quat_from_rotvec(bst_vec3_scale(axis, 170 * DEG)), side);
        bst_vec3 to =
            bst_vec3_add(bst_vec3_scale(axis, cos(60 * DEG)), bst_vec3_scale(other, sin(60 * DEG)));
        bst_keep_out_route path;
        assert_true(bst_keep_out_path(&zone, 1, from, to, &path));
        double tangent = acos(cos(60 * DEG) / cos(25 * DEG));
        double at_axis = acos(tan(25 * DEG) / tan(60 * DEG));
        double edge = (170 * DEG - 2 * at_axis) * sin(25 * DEG);
        bst_assert_close(path.length_rad, 2 * tangent + edge, 1e-9);
        assert_int_equal(path.count, 3);
        assert_true(walk(&path, &zone, 1, to) < 1e-8);
    }
}

static void nothing_in_the_way(void **state) {
    (void)state;
    bst_keep_out_route path;
    bst_keep_out_zone zone = cone(0, 60, 20);
    assert_true(bst_keep_out_path(&zone, 1, at(-70, 0), at(70, 0), &path));
    bst_assert_close(path.length_rad, 140 * DEG, 1e-14);
    assert_int_equal(path.count, 1);
    assert_true(bst_keep_out_path(&zone, 1, at(20, 5), at(20, 5), &path)); /* zero length */
    assert_int_equal(path.count, 0);
    bst_vec3 t, b;
    assert_true(bst_vec3_angle(bst_keep_out_route_at(&path, 0.3, &t, &b), at(20, 5)) < 1e-15);
    /* 180 degrees, exactly, with the Sun on one way and the Earth on the other */
    bst_keep_out_zone two[2] = {cone(0, 0, 50), cone(180, 0, 70)};
    assert_true(bst_keep_out_path(two, 2, at(0, 90), at(0, -90), &path));
    bst_assert_close(path.length_rad, BST_PI, 1e-9);
    assert_true(walk(&path, two, 2, at(0, -90)) < 1e-8);
    /* a cone of more than half the sky: the rest is convex */
    bst_keep_out_zone wide = cone(180, 0, 110);
    assert_true(bst_keep_out_path(&wide, 1, at(-69, 0), at(0, 69), &path));
    assert_int_equal(path.count, 1);
    assert_true(walk(&path, &wide, 1, at(0, 69)) < 1e-8);
}

/* On the axis of a cone all ways out are as long: it is left on the side of another direction. */
static void out_of_the_middle(void **state) {
    (void)state;
    const bst_keep_out_zone two[2] = {cone(40, -25, 30), cone(-130, 60, 12)};
    for (int k = 0; k < 24; k++) {
        const int i = k % 2;
        bst_vec3 axis = two[i].axis, towards = at(15.0 * k + 3.0, 5.0 * k - 55.0), out;
        bst_vec3 side = bst_vec3_cross(bst_vec3_cross(axis, towards), axis);
        bst_vec3 wanted = bst_vec3_axpy(bst_vec3_scale(axis, cos(two[i].half_angle_rad)),
                                        sin(two[i].half_angle_rad), bst_vec3_unit(side));
        assert_true(bst_keep_out_nearest(&two[i], 1, axis, towards, &out));
        assert_true(bst_vec3_norm(bst_vec3_sub(out, wanted)) < 1e-13);
        assert_true(bst_keep_out_nearest(two, 2, axis, towards, &out));
        assert_true(bst_vec3_norm(bst_vec3_sub(out, wanted)) < 1e-13);
    }
}

static void inside_of_cones(void **state) {
    (void)state;
    bst_keep_out_route path;
    bst_vec3 out;
    double depth;
    bst_keep_out_zone zone = cone(0, 0, 30);
    assert_int_equal(bst_keep_out_inside(&zone, 1, at(20, 0), &depth), 0);
    bst_assert_close(depth, 10 * DEG, 1e-12);
    /* out by the shortest way, then on */
    assert_true(bst_keep_out_path(&zone, 1, at(20, 0), at(90, 0), &path));
    assert_int_equal(path.left_zone, 0);
    bst_assert_close(path.length_rad, 70 * DEG, 1e-9);
    assert_true(bst_keep_out_path(&zone, 1, at(20, 0), at(-90, 0), &path));
    /* 10 degrees out, along the edge (a half turn less what the tangent from 90 degrees leaves:
     * cos 90 / cos 30 = 0, a quarter of the sky long, foot 90 degrees round the axis), and on */
    bst_assert_close(path.length_rad, 10 * DEG + 90 * DEG * sin(30 * DEG) + 90 * DEG, 1e-9);
    assert_true(walk(&path, &zone, 1, at(-90, 0)) < 1e-8);
    /* two that overlap, deep in both: by the corner where their edges cross */
    bst_keep_out_zone two[2] = {cone(-10, 0, 30), cone(10, 0, 30)};
    double corner = acos(cos(30 * DEG) / cos(10 * DEG));
    assert_true(bst_keep_out_nearest(two, 2, at(0, 1), at(0, 0), &out));
    bst_assert_close(bst_vec3_angle(out, at(0, corner / DEG)), 0.0, 1e-9);
    /* the target is inside: as near to it as can be, and said */
    assert_true(bst_keep_out_path(&zone, 1, at(90, 0), at(10, 0), &path));
    assert_int_equal(path.target_zone, 0);
    bst_assert_close(path.length_rad, 60 * DEG, 1e-9);
    /* cue and Sun parallel: any way out is the shortest, that towards the start is taken */
    assert_true(bst_keep_out_path(&zone, 1, at(0, 80), at(0, 0), &path));
    bst_assert_close(path.length_rad, 50 * DEG, 1e-9);
    assert_true(bst_keep_out_path(&zone, 1, at(0, 0), at(0, 80), &path)); /* start on the Sun */
    bst_assert_close(path.length_rad, 80 * DEG, 1e-9);
    /* nowhere to go */
    bst_keep_out_zone all[2] = {cone(0, 0, 100), cone(180, 0, 100)};
    assert_false(bst_keep_out_path(all, 2, at(0, 0), at(90, 0), &path));
    assert_int_equal(path.count, 0);
    /* a wall: two cones close a ring between start and goal */
    bst_keep_out_zone ring[4] = {cone(0, 0, 46), cone(90, 0, 46), cone(180, 0, 46),
                                 cone(270, 0, 46)};
    assert_false(bst_keep_out_path(ring, 4, at(0, 90), at(0, -90), &path));
}

/* Random cones and ends, against the shortest way over a grid of 2 degrees with moves of up to 3
 * cells: longer by up to 1.3 % from its directions and by the cells that cones' edges cut, shorter
 * by what chords between its cells cut off a cone. */
#define CELL 2.0
#define GX 180
#define GY 91
static double grid_cost[GY * GX];
static bst_vec3 grid_place[GY * GX];
static bool grid_free[GY * GX];
static int heap[GY * GX * 48];
static double heap_cost[GY * GX * 48];
static int heap_count;

static void push(int cell, double cost) {
    int i = heap_count++;
    while (i > 0 && heap_cost[(i - 1) / 2] > cost) {
        heap[i] = heap[(i - 1) / 2];
        heap_cost[i] = heap_cost[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    heap[i] = cell;
    heap_cost[i] = cost;
}
static int pop(double *cost) {
    int top = heap[0], last = heap[--heap_count], i = 0;
    *cost = heap_cost[0];
    double c = heap_cost[heap_count];
    for (;;) {
        int child = 2 * i + 1;
        if (child >= heap_count) {
            break;
        }
        if (child + 1 < heap_count && heap_cost[child + 1] < heap_cost[child]) {
            child++;
        }
        if (heap_cost[child] >= c) {
            break;
        }
        heap[i] = heap[child];
        heap_cost[i] = heap_cost[child];
        i = child;
    }
    heap[i] = last;
    heap_cost[i] = c;
    return top;
}

static bst_vec3 cell_place(int cell) {
    return at(CELL * (cell % GX), CELL * (cell / GX) - 90);
}
static void draw(bst_rng_key key, uint64_t n, uint64_t what, double out[4]) {
    for (uint64_t i = 0; i < 4; i++) {
        out[i] = bst_rng_uniform(key, n, 4 * what + i);
    }
}

static double brute_force(const bst_keep_out_zone *zones, int count, int from, int to) {
    double depth;
    for (int y = 0; y < GY; y++) {
        for (int x = 0; x < GX; x++) {
            grid_place[y * GX + x] = cell_place(y * GX + x);
            grid_free[y * GX + x] =
                bst_keep_out_inside(zones, count, grid_place[y * GX + x], &depth) < 0;
            grid_cost[y * GX + x] = INFINITY;
        }
    }
    heap_count = 0;
    grid_cost[from] = 0.0;
    push(from, 0.0);
    while (heap_count > 0) {
        double cost;
        int cell = pop(&cost);
        if (cell == to) {
            return cost;
        }
        if (cost > grid_cost[cell]) {
            continue;
        }
        for (int dy = -3; dy <= 3; dy++) {
            for (int dx = -3; dx <= 3; dx++) {
                int y = cell / GX + dy, x = (cell % GX + dx + GX) % GX;
                if (y < 0 || y >= GY || !grid_free[y * GX + x]) {
                    continue;
                }
                int next = y * GX + x;
                double c = cost + bst_vec3_angle(grid_place[cell], grid_place[next]);
                if (c < grid_cost[next] - 1e-12) {
                    grid_cost[next] = c;
                    push(next, c);
                }
            }
        }
    }
    return INFINITY;
}

static void against_brute_force(void **state) {
    (void)state;
    bst_rng_key key = bst_rng_make_key(5, 0, "test", "exclusion");
    int compared = 0, detours = 0;
    double worst = 0.0, least = INFINITY;
    for (uint64_t n = 0; compared < 12; n++) {
        double u[4], v[4];
        bst_keep_out_zone zones[3];
        int count = 1 + (int)(n % 3);
        for (int i = 0; i < count; i++) {
            draw(key, n, (uint64_t)i, u);
            /* within 50 degrees of latitude, where cells are not much longer than wide */
            zones[i] = cone(360 * u[0], 80 * u[1] - 40, 15 + 40 * u[2]);
        }
        draw(key, n, 10, v);
        int from = (int)(20 + 50 * v[0]) * GX + (int)(GX * v[1]);
        int to = (int)(20 + 50 * v[2]) * GX + (int)(GX * v[3]);
        bst_vec3 a = cell_place(from), b = cell_place(to);
        double depth;
        bst_keep_out_route path;
        if (bst_keep_out_inside(zones, count, a, &depth) >= 0 ||
            bst_keep_out_inside(zones, count, b, &depth) >= 0 || bst_vec3_angle(a, b) < 0.7) {
            continue;
        }
        bool found = bst_keep_out_path(zones, count, a, b, &path);
        if (found && path.count == 1) {
            continue; /* straight */
        }
        double brute = brute_force(zones, count, from, to);
        assert_true(found == isfinite(brute));
        compared++;
        if (!found) {
            continue;
        }
        detours++;
        assert_true(walk(&path, zones, count, b) < 1e-6);
        double ratio = path.length_rad / brute;
        worst = fmax(worst, ratio);
        least = fmin(least, ratio);
    }
    print_message("%d detours: length over the grid's %.4f to %.4f\n", detours, least, worst);
    assert_true(detours >= 8);
    assert_true(worst < 1.003);
    assert_true(least > 0.94);
}

/* Tangent and bend are the first and the second derivative of the path by its length, on great
 * circles and along a cone's edge. */
static void tangent_and_bend_are_derivatives(void **state) {
    (void)state;
    const bst_keep_out_zone zone = {BST_ZONE_SUN, {0, 0, 1}, 0.4};
    bst_keep_out_route path;
    bst_vec3 from = bst_vec3_unit((bst_vec3){1.0, 0.05, 0.9}),
             to = bst_vec3_unit((bst_vec3){-1.0, 0.1, 1.0});
    assert_true(bst_keep_out_path(&zone, 1, from, to, &path));
    assert_true(path.count == 3);
    double passed = 0.0;
    for (int i = 0; i < path.count; i++) {
        double s = passed + 0.4 * path.arcs[i].length_rad;
        const double h = 1e-4;
        bst_vec3 tangent, bend, none, unused;
        bst_vec3 here = bst_keep_out_route_at(&path, s, &tangent, &bend);
        bst_vec3 before = bst_keep_out_route_at(&path, s - h, &none, &unused);
        bst_vec3 after = bst_keep_out_route_at(&path, s + h, &none, &unused);
        bst_vec3 slope = bst_vec3_scale(bst_vec3_sub(after, before), 0.5 / h);
        bst_vec3 curve = bst_vec3_scale(
            bst_vec3_sub(bst_vec3_add(after, before), bst_vec3_scale(here, 2.0)), 1.0 / (h * h));
        /* h^2, and rounding of 1e-16 over h^2 */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(slope, tangent)), 0.0, 1e-6);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(curve, bend)), 0.0, 1e-5);
        passed += path.arcs[i].length_rad;
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tangent_and_bend_are_derivatives),
        cmocka_unit_test(zones_of_navigation),
        cmocka_unit_test(round_one_cone),
        cmocka_unit_test(nothing_in_the_way),
        cmocka_unit_test(out_of_the_middle),
        cmocka_unit_test(inside_of_cones),
        cmocka_unit_test(against_brute_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
