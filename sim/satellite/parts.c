/* Parametric parts: box, plate, cylinder, cone, sphere, dish. */
#include "sim/satellite/model_build.h"

enum { SEGMENTS_MAX = 96 };

/* Radius of the polygon of n corners that has the area of a circle, over the circle's radius. */
static double polygon_radius(int n) {
    return sqrt(2.0 * BST_PI / (n * sin(2.0 * BST_PI / n)));
}

static bst_status add_box(bst_ctx *ctx, bst_satellite *s, const double size[3],
                          const bst_part_place *place) {
    static const int faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    int v[8], first = s->facet_count;
    BST_TRY(bst_model_begin_occluder(ctx, s));
    for (int i = 0; i < 8; i++) {
        bst_vec3 p = {(i & 1 ? 0.5 : -0.5) * size[0], (i & 2 ? 0.5 : -0.5) * size[1],
                      (i & 4 ? 0.5 : -0.5) * size[2]};
        BST_TRY(bst_model_add_vertex(ctx, s, place, p, &v[i]));
    }
    for (int f = 0; f < 6; f++) {
        int c[4] = {v[faces[f][0]], v[faces[f][1]], v[faces[f][2]], v[faces[f][3]]};
        BST_TRY(bst_model_add_facet(ctx, s, place, c, 4, place->material, -1));
    }
    return bst_model_end_occluder(ctx, s, first);
}

static bst_status add_plate(bst_ctx *ctx, bst_satellite *s, const double size[3],
                            const bst_part_place *place) {
    static const double x[4] = {-0.5, 0.5, 0.5, -0.5}, y[4] = {-0.5, -0.5, 0.5, 0.5};
    int v[4], first = s->facet_count;
    BST_TRY(bst_model_begin_occluder(ctx, s));
    for (int i = 0; i < 4; i++) {
        bst_vec3 p = {x[i] * size[0], y[i] * size[1], 0.0};
        BST_TRY(bst_model_add_vertex(ctx, s, place, p, &v[i]));
    }
    int back[4] = {v[3], v[2], v[1], v[0]};
    BST_TRY(bst_model_add_facet(ctx, s, place, v, 4, place->material, -1));
    BST_TRY(bst_model_add_facet(ctx, s, place, back, 4, place->back_material, -1));
    return bst_model_end_occluder(ctx, s, first);
}

/* A ring of vertices about z. */
static bst_status add_ring(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place, int n,
                           double radius_m, double z_m, int *v) {
    for (int i = 0; i < n; i++) {
        double a = 2.0 * BST_PI * (i + 0.5) / n, r = radius_m * polygon_radius(n);
        bst_vec3 p = {r * cos(a), r * sin(a), z_m};
        BST_TRY(bst_model_add_vertex(ctx, s, place, p, &v[i]));
    }
    return BST_OK;
}

/* The curved surface of a part that starts at a height on its axis. */
static bst_curved curved_of(const bst_part_place *place, double base_m, double radius_m,
                            double top_radius_m, double length_m) {
    const bst_mat3 *r = &place->rotation;
    return (bst_curved){
        .material = place->material,
        .joint = place->joint,
        .x = {r->m[0][0], r->m[1][0], r->m[2][0]},
        .y = {r->m[0][1], r->m[1][1], r->m[2][1]},
        .z = {r->m[0][2], r->m[1][2], r->m[2][2]},
        .base_m = bst_vec3_add(bst_mat3_mul_vec(r, (bst_vec3){0, 0, base_m}), place->position_m),
        .radius_m = radius_m,
        .top_radius_m = top_radius_m,
        .length_m = length_m,
        .side = 1.0};
}

/* Facets between two rings of n vertices; a ring of radius 0 is a point, its vertices coincide. */
static bst_status add_band(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place, int n,
                           const int *low, const int *high, int curved) {
    for (int i = 0; i < n; i++) {
        int k = (i + 1) % n;
        if (low[0] == low[1]) {
            int c[3] = {low[0], high[k], high[i]};
            BST_TRY(bst_model_add_facet(ctx, s, place, c, 3, place->material, curved));
        } else if (high[0] == high[1]) {
            int c[3] = {low[i], low[k], high[0]};
            BST_TRY(bst_model_add_facet(ctx, s, place, c, 3, place->material, curved));
        } else {
            int c[4] = {low[i], low[k], high[k], high[i]};
            BST_TRY(bst_model_add_facet(ctx, s, place, c, 4, place->material, curved));
        }
    }
    return BST_OK;
}

/* A ring, or n times the same vertex if its radius is 0. */
static bst_status add_ring_or_tip(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                                  int n, double radius_m, double z_m, int *v) {
    if (radius_m > 0.0) {
        return add_ring(ctx, s, place, n, radius_m, z_m, v);
    }
    BST_TRY(bst_model_add_vertex(ctx, s, place, (bst_vec3){0, 0, z_m}, &v[0]));
    for (int i = 1; i < n; i++) {
        v[i] = v[0];
    }
    return BST_OK;
}

/* A cylinder or cone. */
static bst_status add_cone(bst_ctx *ctx, bst_satellite *s, const bst_satellite_part_config *c,
                           double top_m, const bst_part_place *place) {
    int n = (int)c->segments, low[SEGMENTS_MAX], high[SEGMENTS_MAX], index;
    int first = s->facet_count;
    double half = 0.5 * c->length_m;
    BST_TRY(bst_model_begin_occluder(ctx, s));
    BST_TRY(add_ring_or_tip(ctx, s, place, n, c->radius_m, -half, low));
    BST_TRY(add_ring_or_tip(ctx, s, place, n, top_m, half, high));
    bst_curved curved = curved_of(place, -half, c->radius_m, top_m, c->length_m);
    BST_TRY(bst_model_add_curved(ctx, s, &curved, &index));
    BST_TRY(add_band(ctx, s, place, n, low, high, index));
    if (!c->open && c->radius_m > 0.0) {
        int reversed[SEGMENTS_MAX];
        for (int i = 0; i < n; i++) {
            reversed[i] = low[n - 1 - i];
        }
        BST_TRY(bst_model_add_facet(ctx, s, place, reversed, n, place->material, -1));
    }
    if (!c->open && top_m > 0.0) {
        BST_TRY(bst_model_add_facet(ctx, s, place, high, n, place->material, -1));
    }
    return bst_model_end_occluder(ctx, s, first);
}

static bst_status add_sphere(bst_ctx *ctx, bst_satellite *s, const bst_satellite_part_config *c,
                             const bst_part_place *place) {
    int n = (int)c->segments, rows = n / 2, ring[2][SEGMENTS_MAX], index;
    int first = s->facet_count;
    /* circles of latitude on a sphere whose meridians have the area of the circle */
    double radius = c->radius_m * polygon_radius(2 * rows);
    BST_TRY(bst_model_begin_occluder(ctx, s));
    bst_curved curved = curved_of(place, 0.0, c->radius_m, 0.0, 0.0);
    curved.sphere = true;
    BST_TRY(bst_model_add_curved(ctx, s, &curved, &index));
    BST_TRY(add_ring_or_tip(ctx, s, place, n, 0.0, -radius, ring[0]));
    for (int r = 1; r <= rows; r++) {
        double latitude = BST_PI * ((double)r / rows - 0.5);
        BST_TRY(add_ring_or_tip(ctx, s, place, n, r < rows ? radius * cos(latitude) : 0.0,
                                radius * sin(latitude), ring[r % 2]));
        BST_TRY(add_band(ctx, s, place, n, ring[(r + 1) % 2], ring[r % 2], index));
    }
    return bst_model_end_occluder(ctx, s, first);
}

/* One band of a dish between two rings, with two sides. */
static bst_status add_dish_band(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                                const bst_curved *band, const int *low, const int *high, int n) {
    int side[2];
    bst_curved curved = *band;
    curved.material = place->back_material;
    BST_TRY(bst_model_add_curved(ctx, s, &curved, &side[0]));
    curved.material = place->material;
    curved.side = -1.0;
    BST_TRY(bst_model_add_curved(ctx, s, &curved, &side[1]));
    for (int i = 0; i < n; i++) {
        int k = (i + 1) % n, count = low[0] == low[1] ? 3 : 4;
        int v[4] = {low[i], count == 3 ? high[k] : low[k], count == 3 ? high[i] : high[k], high[i]};
        int back[4] = {v[count - 1], v[count - 2], v[count - 3], v[0]};
        BST_TRY(bst_model_add_facet(ctx, s, place, v, count, place->back_material, side[0]));
        BST_TRY(bst_model_add_facet(ctx, s, place, back, count, place->material, side[1]));
    }
    return BST_OK;
}

/* A paraboloid z = depth (r / radius)^2 as bands of cones. */
static bst_status add_dish(bst_ctx *ctx, bst_satellite *s, const bst_satellite_part_config *c,
                           const bst_part_place *place) {
    enum { BANDS = 4 };
    int n = (int)c->segments, ring[2][SEGMENTS_MAX], first = s->facet_count;
    double before_m = 0.0;
    BST_TRY(bst_model_begin_occluder(ctx, s));
    BST_TRY(add_ring_or_tip(ctx, s, place, n, 0.0, 0.0, ring[0]));
    for (int b = 1; b <= BANDS; b++) {
        double q = (double)b / BANDS, z_m = c->length_m * q * q;
        BST_TRY(add_ring_or_tip(ctx, s, place, n, c->radius_m * q, z_m, ring[b % 2]));
        bst_curved band = curved_of(place, before_m, c->radius_m * (b - 1) / BANDS, c->radius_m * q,
                                    z_m - before_m);
        BST_TRY(add_dish_band(ctx, s, place, &band, ring[(b + 1) % 2], ring[b % 2], n));
        before_m = z_m;
    }
    BST_TRY(bst_model_end_occluder(ctx, s, first));
    bst_curved frame = curved_of(place, 0.0, 0.0, 0.0, 0.0);
    bst_shell shell = {place->joint, place->position_m,  frame.z, c->radius_m,
                       c->length_m,  ring[BANDS % 2][0], n};
    return bst_model_set_shell(ctx, s, &shell);
}

/* Requires a positive length. */
static bst_status need(bst_ctx *ctx, const char *key, double value) {
    return value > 0.0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "%s: the part has no extent (found %g; allowed: above 0)", key, value);
}

bst_status bst_model_add_part(bst_ctx *ctx, bst_satellite *s, const bst_satellite_part_config *c,
                              const bst_part_place *place) {
    switch (c->kind) {
        case BST_PART_BOX:
        case BST_PART_PLATE:
            for (int i = 0; i < (c->kind == BST_PART_BOX ? 3 : 2); i++) {
                BST_TRY(need(ctx, "size_m", c->size_m[i]));
            }
            return c->kind == BST_PART_BOX ? add_box(ctx, s, c->size_m, place)
                                           : add_plate(ctx, s, c->size_m, place);
        case BST_PART_SPHERE:
            BST_TRY(need(ctx, "radius_m", c->radius_m));
            return add_sphere(ctx, s, c, place);
        case BST_PART_CYLINDER:
            BST_TRY(need(ctx, "radius_m", c->radius_m));
            BST_TRY(need(ctx, "length_m", c->length_m));
            return add_cone(ctx, s, c, c->radius_m, place);
        case BST_PART_CONE:
            BST_TRY(need(ctx, "radius_m", fmax(c->radius_m, c->top_radius_m)));
            BST_TRY(need(ctx, "length_m", c->length_m));
            return add_cone(ctx, s, c, c->top_radius_m, place);
        default:
            BST_TRY(need(ctx, "radius_m", c->radius_m));
            BST_TRY(need(ctx, "length_m", c->length_m));
            return add_dish(ctx, s, c, place);
    }
}
