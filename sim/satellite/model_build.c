/* Adding vertices, convex bodies and facets to a model. */
#include "sim/satellite/model_build.h"

#include <assert.h>
#include <stdlib.h>

/* Grows an array by doubling. */
static bst_status grow(bst_ctx *ctx, void **items, int *capacity, int count, size_t bytes) {
    if (count < *capacity) {
        return BST_OK;
    }
    int wanted = *capacity ? 2 * *capacity : 64;
    void *grown = realloc(*items, (size_t)wanted * bytes);
    if (!grown) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a satellite of %d elements", wanted);
    }
    *items = grown;
    *capacity = wanted;
    return BST_OK;
}

bst_status bst_model_add_vertex(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                                bst_vec3 v, int *index) {
    int capacity = s->vertex_capacity;
    BST_TRY(grow(ctx, (void **)&s->vertex_joint, &capacity, s->vertex_count, sizeof(int)));
    BST_TRY(
        grow(ctx, (void **)&s->vertices, &s->vertex_capacity, s->vertex_count, sizeof(bst_vec3)));
    s->vertices[s->vertex_count] =
        bst_vec3_add(bst_mat3_mul_vec(&place->rotation, v), place->position_m);
    s->vertex_joint[s->vertex_count] = place->joint;
    *index = s->vertex_count++;
    return BST_OK;
}

bst_status bst_model_add_curved(bst_ctx *ctx, bst_satellite *s, const bst_curved *curved,
                                int *index) {
    BST_TRY(
        grow(ctx, (void **)&s->curved, &s->curved_capacity, s->curved_count, sizeof *s->curved));
    s->curved[s->curved_count] = *curved;
    s->curved[s->curved_count].occluder = s->occluder_count - 1;
    s->occluders[s->occluder_count - 1].curved_count++;
    *index = s->curved_count++;
    return BST_OK;
}

/* Area times normal of a polygon (Newell's sum from its first corner). */
static bst_vec3 area_vector(const bst_satellite *s, const int *corners, int count) {
    bst_vec3 sum = {0}, a = s->vertices[corners[0]];
    for (int i = 2; i < count; i++) {
        bst_vec3 b = bst_vec3_sub(s->vertices[corners[i - 1]], a);
        sum = bst_vec3_axpy(sum, 0.5, bst_vec3_cross(b, bst_vec3_sub(s->vertices[corners[i]], a)));
    }
    return sum;
}

bst_status bst_model_add_facet(bst_ctx *ctx, bst_satellite *s, const bst_part_place *place,
                               const int *corners, int count, int material, int curved) {
    assert(count >= 3 && s->occluder_count > 0);
    bst_vec3 area = area_vector(s, corners, count);
    double size = bst_vec3_norm(area);
    if (!(size > 1e-12)) { /* a micrometre squared */
        return BST_OK;
    }
    if (s->facet_count >= BST_SATELLITE_FACETS_MAX) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "the satellite has more than %d facets (allowed: %d); simplify the mesh",
                        s->facet_count, BST_SATELLITE_FACETS_MAX);
    }
    BST_TRY(grow(ctx, (void **)&s->facets, &s->facet_capacity, s->facet_count, sizeof *s->facets));
    s->facets[s->facet_count] = (bst_facet){.first = s->corner_count,
                                            .count = count,
                                            .part = place->part,
                                            .material = material,
                                            .joint = place->joint,
                                            .occluder = s->occluder_count - 1,
                                            .curved = curved,
                                            .inside = curved >= 0 && s->curved[curved].side < 0.0,
                                            .area_m2 = size,
                                            .normal = bst_vec3_scale(area, 1.0 / size)};
    for (int i = 0; i < count; i++) {
        BST_TRY(grow(ctx, (void **)&s->corner, &s->corner_capacity, s->corner_count, sizeof(int)));
        s->corner[s->corner_count++] = corners[i];
    }
    s->facet_count++;
    return BST_OK;
}

bst_status bst_model_begin_occluder(bst_ctx *ctx, bst_satellite *s) {
    BST_TRY(grow(ctx, (void **)&s->occluders, &s->occluder_capacity, s->occluder_count,
                 sizeof *s->occluders));
    s->occluders[s->occluder_count++] = (bst_occluder){.first_vertex = s->vertex_count,
                                                       .first_edge = s->edge_count,
                                                       .first_curved = s->curved_count,
                                                       .shell = -1};
    return BST_OK;
}

/* Edge of a body between two vertices; s->edge_count: none. */
static int find_edge(const bst_satellite *s, const bst_occluder *o, int a, int b) {
    int e = o->first_edge;
    while (e < s->edge_count && !(s->edges[e][0] == b && s->edges[e][1] == a) &&
           !(s->edges[e][0] == a && s->edges[e][1] == b)) {
        e++;
    }
    return e;
}

/* Gives the edges of a shell the facets of its convex side. */
static void close_shell(bst_satellite *s, bst_occluder *o) {
    for (int e = o->first_edge; e < o->first_edge + o->edge_count; e++) {
        s->edges[e][2] = s->edges[e][3] = -1;
    }
    for (int f = o->first_facet; f < o->first_facet + o->facet_count; f++) {
        const bst_facet *facet = &s->facets[f];
        for (int i = 0; i < facet->count && !facet->inside; i++) {
            int a = s->corner[facet->first + i];
            int b = s->corner[facet->first + (i + 1) % facet->count];
            int e = find_edge(s, o, a, b);
            if (s->edges[e][2] < 0) {
                s->edges[e][0] = a;
                s->edges[e][1] = b;
            }
            s->edges[e][s->edges[e][2] < 0 ? 2 : 3] = f;
        }
    }
    o->closed = true;
}

bst_status bst_model_set_shell(bst_ctx *ctx, bst_satellite *s, const bst_shell *shell) {
    BST_TRY(grow(ctx, (void **)&s->shells, &s->shell_capacity, s->shell_count, sizeof *s->shells));
    s->occluders[s->occluder_count - 1].shell = s->shell_count;
    s->shells[s->shell_count++] = *shell;
    close_shell(s, &s->occluders[s->occluder_count - 1]);
    return BST_OK;
}

bst_status bst_model_end_occluder(bst_ctx *ctx, bst_satellite *s, int first_facet) {
    bst_occluder *o = &s->occluders[s->occluder_count - 1];
    o->vertex_count = s->vertex_count - o->first_vertex;
    o->first_facet = first_facet;
    o->facet_count = s->facet_count - first_facet;
    for (int f = first_facet; f < s->facet_count; f++) {
        const bst_facet *facet = &s->facets[f];
        for (int i = 0; i < facet->count; i++) {
            int a = s->corner[facet->first + i];
            int b = s->corner[facet->first + (i + 1) % facet->count];
            /* each edge of a closed body is in two facets, once in each direction */
            int e = find_edge(s, o, a, b);
            if (e < s->edge_count) {
                bool second = s->edges[e][0] == b && s->edges[e][3] == -1;
                s->edges[e][3] = second ? f : -2;
                continue;
            }
            BST_TRY(
                grow(ctx, (void **)&s->edges, &s->edge_capacity, s->edge_count, sizeof *s->edges));
            s->edges[s->edge_count][0] = a;
            s->edges[s->edge_count][1] = b;
            s->edges[s->edge_count][2] = f;
            s->edges[s->edge_count++][3] = -1;
        }
    }
    o->edge_count = s->edge_count - o->first_edge;
    o->closed = true;
    for (int e = o->first_edge; e < s->edge_count; e++) {
        o->closed = o->closed && s->edges[e][3] >= 0;
    }
    return BST_OK;
}
