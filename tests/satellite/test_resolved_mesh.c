/* Light of meshes by areas, whose facets hide and shade each other, against cells by cuts. */
#include <stdlib.h>
#include <unistd.h>

#include "sim/core/simd.h"
#include "sim/satellite/facet_layers.h"
#include "sim/satellite/facet_net.h"
#include "sim/satellite/resolved_image.h"
#include "tests/satellite/satellite_support.h"

enum { AROUND = 24, UP = 17 };

/* Loads a mesh that is written as OBJ. */
static bst_satellite *load_mesh(void (*write)(FILE *f)) {
    bst_ctx ctx = {0};
    bst_satellite *satellite = NULL;
    char path[BST_TEST_PATH];
    bst_test_template(path, "mesh");
    int file = mkstemp(path); /* the name is ours: with the suffix, too */
    assert_true(file >= 0);
    close(file);
    remove(path);
    strcat(path, ".obj");
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    write(f);
    assert_int_equal(fclose(f), 0);
    bst_assert_ok(&ctx, bst_satellite_load(&ctx, path, &satellite));
    unlink(path);
    return satellite;
}

/* Writes a sphere of 1 m with deep bumps. */
static void write_bumps(FILE *f) {
    int first = (UP - 1) * AROUND;
    for (int k = 1; k < UP; k++) {
        for (int i = 0; i < AROUND; i++) {
            double a = 2.0 * BST_PI * i / AROUND, b = BST_PI * (k / (double)UP - 0.5);
            double r = 0.7 + 0.25 * cos(5.0 * a) * cos(b) + 0.05 * sin(7.0 * b);
            fprintf(f, "v %.9f %.9f %.9f\n", r * cos(b) * cos(a), r * cos(b) * sin(a), r * sin(b));
        }
    }
    fprintf(f, "v 0 0 -0.7\nv 0 0 0.7\n");
    for (int i = 0; i < AROUND; i++) {
        int n = (i + 1) % AROUND, last = first - AROUND;
        fprintf(f, "f %d %d %d\nf %d %d %d\n", n + 1, i + 1, first + 1, last + i + 1, last + n + 1,
                first + 2);
        for (int k = 0; k + 2 < UP; k++) {
            int low = k * AROUND + 1, high = low + AROUND;
            fprintf(f, "f %d %d %d\nf %d %d %d\n", low + i, low + n, high + n, low + i, high + n,
                    high + i);
        }
    }
}

/* The same, and a triangle cuts through it. */
static void write_sunk_bumps(FILE *f) {
    write_bumps(f);
    fprintf(f, "v 0.2 -1.4 0.1\nv 0.9 1.3 -0.5\nv -0.6 0.9 1.2\nf -3 -2 -1\n");
}

static bst_satellite *bumpy_sphere(bool sunk) {
    return load_mesh(sunk ? write_sunk_bumps : write_bumps);
}

/* An image by cuts, by areas, or by areas of blurred poses. */
typedef enum way { BY_CUTS, BY_AREAS, BY_BLURRED_AREAS } way;

/* Draws the image without a share of its width and height at the low sides, and half of that at the
 * others. */
static bst_resolved *draw_within(bst_satellite_pose *pose, const bst_resolved_view *view,
                                 const bst_resolved_light *light, way by, double left_out) {
    bst_ctx ctx = {0};
    bst_resolved *r = NULL;
    double low[2], high[2];
    assert_true(bst_resolved_box(pose, view, low, high));
    for (int i = 0; i < 2; i++) {
        double across = high[i] - low[i];
        low[i] += left_out * across;
        high[i] -= 0.5 * left_out * across;
    }
    bst_assert_ok(&ctx, bst_resolved_create(&ctx, pose->satellite, &r));
    bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r, low, high, 1.0));
    if (by == BY_CUTS) {
        bst_assert_ok(&ctx, bst_resolved_add(&ctx, r, pose, view, light, 1.0, NULL));
        return r;
    }
    bst_assert_ok(&ctx, bst_resolved_begin_light(&ctx, r, by == BY_BLURRED_AREAS));
    bst_assert_ok(&ctx, bst_resolved_add_light(&ctx, r, pose, view, light, 1.0));
    bst_resolved_end_light(r, view->scale_rad);
    return r;
}

static bst_resolved *draw(bst_satellite_pose *pose, const bst_resolved_view *view,
                          const bst_resolved_light *light, way by) {
    return draw_within(pose, view, light, by, 0.0);
}

/* Largest difference of light and first moments, over the light of the brightest cell. */
static double difference(const bst_resolved_image *a, const bst_resolved_image *b) {
    double worst = 0.0, brightest = 0.0;
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (int i = 0; i < a->width * a->height; i++) {
        const bst_resolved_cell *c = &a->cells[i], *d = &b->cells[i];
        brightest = fmax(brightest, (double)c->light);
        worst = fmax(worst, fabs((double)c->light - (double)d->light));
        worst = fmax(worst, fabs((double)c->moment_x - (double)d->moment_x));
        worst = fmax(worst, fabs((double)c->moment_y - (double)d->moment_y));
    }
    assert_true(brightest > 0.0);
    return worst / brightest;
}

/* Draws a mesh from several sides. Returned: largest difference of light by areas from that by
 * cuts. */
static double compare_sides(bst_satellite *satellite, double left_out) {
    bst_ctx ctx = {0};
    bst_satellite_pose *pose;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    double worst = 0.0;
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    assert_true(bst_resolved_may_add_light(satellite));
    for (int n = 0; n < 4; n++) {
        double a = 0.4 + 1.7 * n;
        bst_vec3 from = {cos(a), sin(a), 0.3 * n - 0.5};
        bst_vec3 sun = {cos(a + 1.1), sin(a + 1.1), 0.4 - 0.2 * n};
        bst_resolved_light light = {.sun = bst_vec3_unit(sun), .gain = gain};
        bst_resolved_view view = {bst_quat_look(bst_vec3_scale(from, -1.0), (bst_vec3){0, 0, 1}),
                                  {0, 0, 20.0},
                                  0.0025 + 0.001 * n,
                                  0.0,
                                  0.0,
                                  NULL};
        bst_resolved *cuts = draw_within(pose, &view, &light, BY_CUTS, left_out);
        bst_resolved *areas = draw_within(pose, &view, &light, BY_AREAS, left_out);
        worst = fmax(worst, difference(bst_resolved_image_of(cuts), bst_resolved_image_of(areas)));
        bst_resolved_free(cuts);
        bst_resolved_free(areas);
    }
    bst_satellite_pose_free(pose);
    return worst;
}

/* Bumps hide and shade each other: facets that a border crosses, and others that are whole or
 * hidden as their middle is. */
static void test_bumps(void **state) {
    (void)state;
    bst_satellite *satellite = bumpy_sphere(false);
    /* both are exact; the light of cells by cuts is stored and summed in single precision */
    bst_assert_close(compare_sides(satellite, 0.0), 0.0, 1e-5);
    bst_satellite_free(satellite);
}

/* Facets partly beside the image: borders there do not tell what is hidden within it. */
static void test_beside_the_image(void **state) {
    (void)state;
    bst_satellite *satellite = bumpy_sphere(false);
    for (int n = 0; n < 4; n++) {
        bst_assert_close(compare_sides(satellite, 0.11 + 0.06 * n), 0.0, 1e-5); /* see above */
    }
    bst_satellite_free(satellite);
    satellite = bumpy_sphere(true);
    for (int n = 0; n < 4; n++) {
        bst_assert_close(compare_sides(satellite, 0.11 + 0.06 * n), 0.0, 1e-5);
    }
    bst_satellite_free(satellite);
}

/* Writes two rings through each other. */
static void write_rings(FILE *f) {
    enum { LONG = 30, ROUND = 12 };
    for (int n = 0; n < 2 * LONG * ROUND; n++) {
        int k = n % (LONG * ROUND);
        double a = 2.0 * BST_PI * (k / ROUND) / LONG, b = 2.0 * BST_PI * (k % ROUND) / ROUND;
        double r = 1.0 + 0.3 * cos(b), x = r * cos(a), y = r * sin(a), z = 0.3 * sin(b);
        fprintf(f, "v %.9f %.9f %.9f\n", n == k ? x : x + 1.0, n == k ? y : z, n == k ? z : y);
    }
    for (int n = 0; n < 2 * LONG * ROUND; n++) {
        int base = n / (LONG * ROUND) * LONG * ROUND + 1, k = n % (LONG * ROUND);
        int i = k / ROUND, next = (i + 1) % LONG, j = k % ROUND, up = (j + 1) % ROUND;
        int a = base + i * ROUND + j, b = base + next * ROUND + j, c = base + next * ROUND + up;
        int d = base + i * ROUND + up;
        if (base == 1) {
            fprintf(f, "f %d %d %d\nf %d %d %d\n", a, b, c, a, c, d);
        } else { /* mirrored */
            fprintf(f, "f %d %d %d\nf %d %d %d\n", c, b, a, d, c, a);
        }
    }
}

/* A border leaves what is behind it between the middles of two rows: beside one of its ends there
 * is a second layer, at the middle of the row there is none. */
static void test_border_across_border(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_satellite *satellite = load_mesh(write_rings);
    bst_satellite_pose *pose;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    bst_resolved_light light = {.sun = {0.0, 0.0, 1.0}, .gain = gain};
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    double range_m = 30.0 * satellite->radius_m;
    for (int n = 0; n < 12; n++) {
        bst_vec3 from = bst_vec3_unit((bst_vec3){-0.639, 0.499 + 0.004 * n, 0.586});
        bst_resolved_view view = {
            bst_quat_look(bst_vec3_scale(from, -1.0), (bst_vec3){0.1, 0.2, 0.97}),
            {0, 0, range_m},
            2.0 / 30.0 / 140.0,
            0.0,
            0.0,
            NULL};
        bst_resolved *cuts = draw(pose, &view, &light, BY_CUTS);
        bst_resolved *areas = draw(pose, &view, &light, BY_AREAS);
        bst_assert_close(difference(bst_resolved_image_of(cuts), bst_resolved_image_of(areas)), 0.0,
                         1e-5);
        bst_resolved_free(cuts);
        bst_resolved_free(areas);
    }
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
}

/* Where a triangle goes through other facets there is no border, but the planes cross. */
static void test_facets_through_others(void **state) {
    (void)state;
    bst_satellite *satellite = bumpy_sphere(true);
    bst_assert_close(compare_sides(satellite, 0.0), 0.0, 1e-5);
    bst_satellite_free(satellite);
}

/* Writes a block with a curved top of SIDE x SIDE cells, and another one whose plane top passes it
 * along a line of its vertices. */
static void write_blocks(FILE *f) {
    enum { SIDE = 8, ROW = SIDE + 1, TOP = ROW * ROW };
    int rim[4 * SIDE];
    for (int n = 0; n < TOP; n++) {
        double x = n % ROW / 4.0 - 1.0, y = n / ROW / 4.0 - 1.0;
        fprintf(f, "v %.9f %.9f %.9f\n", x, y, y * (0.2 + 0.3 * x + 0.1 * x * x + 0.15 * y));
    }
    for (int n = 0; n < SIDE * SIDE; n++) {
        int low = n / SIDE * ROW + n % SIDE + 1, high = low + ROW;
        fprintf(f, "f %d %d %d\nf %d %d %d\n", low, low + 1, high + 1, low, high + 1, high);
    }
    for (int n = 0; n < SIDE; n++) { /* counter-clockwise from above */
        rim[n] = n;
        rim[SIDE + n] = n * ROW + SIDE;
        rim[2 * SIDE + n] = TOP - 1 - n;
        rim[3 * SIDE + n] = (SIDE - n) * ROW;
    }
    for (int n = 0; n < 4 * SIDE; n++) {
        fprintf(f, "v %.9f %.9f -6\n", rim[n] % ROW / 4.0 - 1.0, rim[n] / ROW / 4.0 - 1.0);
    }
    fprintf(f, "v 0 0 -6\n");
    for (int n = 0; n < 4 * SIDE; n++) {
        int next = (n + 1) % (4 * SIDE), low = TOP + 1 + n, low_next = TOP + 1 + next;
        fprintf(f, "f %d %d %d %d\nf %d %d %d\n", rim[n] + 1, low, low_next, rim[next] + 1,
                low_next, low, TOP + 4 * SIDE + 1);
    }
    fprintf(f,
            "v -3 -2 -2\nv 3 -2 -2\nv 3 2 2\nv -3 2 2\nv -3 -2 -5\nv 3 -2 -5\nv 3 2 -1\n"
            "v -3 2 -1\nf -8 -7 -6 -5\nf -1 -2 -3 -4\nf -8 -4 -3 -7\nf -7 -3 -2 -6\n"
            "f -6 -2 -1 -5\nf -5 -1 -4 -8\n");
}

/* Facets on both sides of that line share edges and no border is near, yet the plane is before
 * those of one side only. */
static void test_plane_along_edges(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_satellite *satellite = load_mesh(write_blocks);
    bst_satellite_pose *pose;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    bst_resolved_light light = {.sun = bst_vec3_unit((bst_vec3){0.3, -0.4, 1.0}), .gain = gain};
    bst_resolved_view view = {bst_quat_look((bst_vec3){0.05, 0.02, -1.0}, (bst_vec3){1, 0, 0}),
                              {0, 0, 60.0},
                              0.001,
                              0.0,
                              0.0,
                              NULL};
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    bst_resolved *cuts = draw(pose, &view, &light, BY_CUTS);
    bst_resolved *areas = draw(pose, &view, &light, BY_AREAS);
    /* exact; see test_bumps */
    bst_assert_close(difference(bst_resolved_image_of(cuts), bst_resolved_image_of(areas)), 0.0,
                     1e-5);
    bst_resolved_free(cuts);
    bst_resolved_free(areas);
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
}

/* Writes two blocks, one beside the other, whose sides are TILES x TILES squares of two triangles
 * in one plane. */
static void write_tiles(FILE *f) {
    enum { TILES = 6, ROW = TILES + 1, SIDE = ROW * ROW };
    for (int n = 0; n < 12 * SIDE; n++) {
        int side = n / SIDE % 6, axis = side / 2, sign = side % 2 ? -1 : 1;
        double at[3], u = 2.0 * (n % ROW) / TILES - 1.0, v = 2.0 * (n % SIDE / ROW) / TILES - 1.0;
        at[axis] = sign;
        at[(axis + 1) % 3] = sign * u;
        at[(axis + 2) % 3] = v;
        double off = n < 6 * SIDE ? 0.0 : 2.3;
        fprintf(f, "v %.9f %.9f %.9f\n", at[0] + off, 0.4 * at[1] - 0.3 * off, at[2] + 0.4 * off);
    }
    for (int n = 0; n < 12 * TILES * TILES; n++) {
        int low = n / (TILES * TILES) * SIDE + n / TILES % TILES * ROW + n % TILES + 1;
        fprintf(f, "f %d %d %d\nf %d %d %d\n", low, low + 1, low + ROW + 1, low, low + ROW + 1,
                low + ROW);
    }
}

/* Facets in one plane do not hide each other, and hide and shade those of the other block. */
static void test_tiles(void **state) {
    (void)state;
    bst_satellite *satellite = load_mesh(write_tiles);
    bst_assert_close(compare_sides(satellite, 0.0), 0.0, 1e-5); /* exact; see test_bumps */
    bst_satellite_free(satellite);
}

/* Two facets: the corners of each, m, and what the first one is to the second one. */
typedef struct two_facets {
    int count[2];
    bst_vec3 p[8];
    uint8_t apart;
} two_facets;

static uint8_t find_apart(const two_facets *t) {
    bst_ctx ctx = {0};
    bst_facet_net net;
    bst_vec3 vertices[8];
    int joint[8], corner[8], first[2] = {0, t->count[0]};
    bst_facet facets[2];
    bst_satellite s = {.vertices = vertices,
                       .vertex_joint = joint,
                       .corner = corner,
                       .facets = facets,
                       .vertex_count = t->count[0] + t->count[1],
                       .corner_count = t->count[0] + t->count[1],
                       .facet_count = 2,
                       .radius_m = 5.0};
    for (int i = 0; i < s.vertex_count; i++) {
        vertices[i] = t->p[i];
        corner[i] = i;
        joint[i] = -1;
    }
    for (int f = 0; f < 2; f++) {
        const bst_vec3 *p = &t->p[first[f]];
        facets[f] = (bst_facet){.first = first[f], .count = t->count[f], .joint = -1};
        facets[f].normal =
            bst_vec3_unit(bst_vec3_cross(bst_vec3_sub(p[1], p[0]), bst_vec3_sub(p[2], p[1])));
    }
    bst_assert_ok(&ctx, bst_facet_net_make(&ctx, &s, &net));
    uint8_t apart[2] = {net.apart[0], net.apart[1]};
    bst_facet_net_free(&net);
    assert_int_equal(apart[0] != 0, apart[1] != 0);
    return apart[0];
}

/* Facets that go through each other, also where they do so from corner to corner: no edge goes
 * through a facet between its ends. Those that only touch, or whose planes cross beside them, are
 * apart; they are free but for one that stands on the other with a side. */
static void test_crossing_facets(void **state) {
    (void)state;
    static const two_facets of[] = {
        /* a diamond through a panel that holds two of its corners, or one, or none */
        {{4, 4},
         {{1, 0, 0},
          {0, 0, 1},
          {-1, 0, 0},
          {0, 0, -3},
          {3, 3, 0},
          {-3, 3, 0},
          {-3, -3, 0},
          {3, -3, 0}},
         0},
        {{4, 4},
         {{1, 0, 0},
          {0, 0, 1},
          {-1, 0, 0},
          {0, 0, -3},
          {3, 3, 0},
          {0, 3, 0},
          {0, -3, 0},
          {3, -3, 0}},
         0},
        {{4, 4},
         {{3, 0, 0},
          {0, 0, 1},
          {-3, 0, 0},
          {0, 0, -3},
          {1, 1, 0},
          {-1, 1, 0},
          {-1, -1, 0},
          {1, -1, 0}},
         0},
        /* triangles that share the line between a corner of each */
        {{3, 3}, {{0, 0, 0}, {2, 0, -1}, {2, 0, 1}, {1, 0, 0}, {-1, 1, 0}, {-1, -1, 0}}, 0},
        /* from a common corner along the same line */
        {{3, 3}, {{0, 0, 0}, {2, 0, -1}, {2, 0, 1}, {0, 0, 0}, {1, -1, 0}, {1, 1, 0}}, 0},
        /* to opposite sides of a common corner, and of two beside each other */
        {{3, 3},
         {{0, 0, 0}, {2, 0, -1}, {2, 0, 1}, {0, 0, 0}, {-1, 1, 0}, {-1, -1, 0}},
         BST_NET_FREE},
        {{3, 3},
         {{1, 0, 0}, {2, 0, -1}, {2, 0, 1}, {0, 0, 0}, {-1, 1, 0}, {-1, -1, 0}},
         BST_NET_FREE},
        /* in one plane: halves of a square, beside each other with a common corner or a part of a
         * side, and over each other */
        {{3, 3}, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}}, BST_NET_FREE},
        {{3, 3},
         {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {-1, 1, 0}, {-1, 0, 0}},
         BST_NET_APART},
        {{3, 3},
         {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 0, 0}, {1, -1, 0}, {3, 0, 0}},
         BST_NET_APART},
        {{3, 3}, {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 0, 0}, {3, 0, 0}, {1, 2, 0}}, 0},
        {{3, 3}, {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 0, 0}, {1, 2, 0}, {3, 0, 0}}, 0},
        /* a panel on a panel */
        {{3, 3},
         {{0, 0, 0}, {2, 0, 0}, {2, 0, 1}, {3, 3, 0}, {-3, 3, 0}, {-3, -3, 0}},
         BST_NET_APART},
    };
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        uint8_t apart = find_apart(&of[i]);
        if (apart != of[i].apart) {
            fail_msg("facets %zu: found %d, not %d", i, apart, of[i].apart);
        }
    }
}

/* A triangle that a quadrilateral crosses along x = 14: what of it lies beyond is hidden, 24 of 216
 * cells. At the triangle's middle there is one layer, and the only border across it, x = 12, is
 * behind it. */
static void test_hidden_by_crossing_facet(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const bst_point2 at[7] = {{2, 4}, {2, 28}, {20, 16}, {12, 2}, {12, 30}, {40, 30}, {40, 2}};
    const double near[7] = {0, 0, 0, -2, -2, 26, 26};
    int vertex[7] = {0, 1, 2, 3, 4, 5, 6}, first[3] = {0, 3, 7}, corner[7] = {0, 1, 2, 3, 4, 5, 6},
        beside[7] = {2, 2, 2, 2, 2, 2, 2};
    bst_net_edge edges[7];
    for (int i = 0; i < 7; i++) {
        edges[i] =
            i < 3 ? (bst_net_edge){i, (i + 1) % 3, 0, 2} : (bst_net_edge){i, 3 + (i - 2) % 4, 1, 2};
    }
    uint8_t apart[3] = {0}, wanted[3] = {1, 1, 0};
    const bst_satellite satellite = {.facet_count = 2, .radius_m = 30.0};
    const bst_facet_net net = {.satellite = &satellite,
                               .vertex = vertex,
                               .first = first,
                               .corner = corner,
                               .beside = beside,
                               .edges = edges,
                               .apart = apart,
                               .vertex_count = 7,
                               .edge_count = 7};
    bst_facet_layers layers = {0};
    bst_assert_ok(&ctx, bst_facet_layers_begin(&ctx, &layers, &net, 48, 32));
    memcpy(layers.at, at, sizeof at);
    memcpy(layers.near, near, sizeof near);
    layers.facing[0] = layers.facing[1] = 1;
    layers.facing[2] = 0;
    layers.same = 1e-5;
    bst_assert_ok(&ctx, bst_facet_layers_find(&ctx, &layers, wanted));
    assert_true(layers.doubtful[0]);
    assert_false(bst_facet_layers_cut(&layers, 0));
    bst_assert_close(bst_polygon_clip_area(&layers.clip), 192.0, 1e-9);
    bst_facet_layers_free(&layers);
}

/* Edges between facets of almost the same light change light and first moments not at all, second
 * ones by 0.016 of the difference of their light at most, which is a tenth of it. */
static void test_faint_edges(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_satellite *satellite = bumpy_sphere(false);
    bst_satellite_pose *pose;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    bst_resolved_light light = {.sun = bst_vec3_unit((bst_vec3){0.3, 0.2, 1.0}), .gain = gain};
    bst_resolved_view view = {bst_quat_look((bst_vec3){0, 0, -1.0}, (bst_vec3){1, 0, 0}),
                              {0, 0, 20.0},
                              0.001,
                              0.0,
                              0.0,
                              NULL};
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    bst_resolved *all = draw(pose, &view, &light, BY_AREAS);
    bst_resolved *faint = draw(pose, &view, &light, BY_BLURRED_AREAS);
    const bst_resolved_image *a = bst_resolved_image_of(all), *b = bst_resolved_image_of(faint);
    double worst = 0.0, brightest = 0.0;
    /* sums in another order, rounded to single precision */
    bst_assert_close(difference(a, b), 0.0, 1e-6);
    for (int i = 0; i < a->width * a->height; i++) {
        brightest = fmax(brightest, (double)a->cells[i].light);
        worst = fmax(worst, fabs((double)a->second[i].xx - (double)b->second[i].xx));
        worst = fmax(worst, fabs((double)a->second[i].yy - (double)b->second[i].yy));
    }
    assert_true(worst > 1e-6 * brightest); /* there are such edges */
    /* four edges at most cross most cells */
    bst_assert_close(worst / brightest, 0.0, 4.0 * 0.0016);
    bst_resolved_free(all);
    bst_resolved_free(faint);
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
}

/* Edges are added some rows at a time, more with wider vectors: the same bytes for all widths, with
 * second moments, without those of faint edges, and where the image ends within the body. */
static void test_vector_widths(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_satellite *satellite = bumpy_sphere(false);
    bst_satellite_pose *pose;
    bst_resolved_gain gain[1] = {{.sun = 1.0}};
    bst_resolved_light light = {.sun = bst_vec3_unit((bst_vec3){0.3, 0.2, -1.0}), .gain = gain};
    bst_resolved_view view = {bst_quat_look((bst_vec3){0.2, 0.1, 1.0}, (bst_vec3){1, 0.3, 0}),
                              {0, 0, 20.0},
                              0.0007,
                              0.0,
                              0.0,
                              NULL};
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    for (int n = 0; n < 4; n++) {
        way by = n % 2 == 0 ? BY_AREAS : BY_BLURRED_AREAS;
        bst_simd_limit(4);
        bst_resolved *narrow = draw_within(pose, &view, &light, by, n < 2 ? 0.0 : 0.3);
        bst_simd_limit(16);
        bst_resolved *wide = draw_within(pose, &view, &light, by, n < 2 ? 0.0 : 0.3);
        const bst_resolved_image *a = bst_resolved_image_of(narrow);
        const bst_resolved_image *b = bst_resolved_image_of(wide);
        size_t count = (size_t)a->width * (size_t)a->height;
        assert_true(count > 900 && b->width == a->width && b->height == a->height);
        assert_memory_equal(a->cells, b->cells, count * sizeof *a->cells);
        assert_memory_equal(a->second, b->second, count * sizeof *a->second);
        bst_resolved_free(narrow);
        bst_resolved_free(wide);
    }
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bumps),
                                       cmocka_unit_test(test_facets_through_others),
                                       cmocka_unit_test(test_plane_along_edges),
                                       cmocka_unit_test(test_tiles),
                                       cmocka_unit_test(test_beside_the_image),
                                       cmocka_unit_test(test_border_across_border),
                                       cmocka_unit_test(test_crossing_facets),
                                       cmocka_unit_test(test_hidden_by_crossing_facet),
                                       cmocka_unit_test(test_faint_edges),
                                       cmocka_unit_test(test_vector_widths)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
