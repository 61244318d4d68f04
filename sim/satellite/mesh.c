/* Triangle meshes as parts: connected pieces, closed or open, convex or not. */
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/model_build.h"

enum { CONVEX_VERTICES_MAX = 256 };

void bst_mesh_free(bst_mesh *mesh) {
    free(mesh->vertices);
    free(mesh->triangles);
    free(mesh->triangle_material);
    free(mesh->materials);
    *mesh = (bst_mesh){0};
}

bst_status bst_mesh_add_vertex(bst_ctx *ctx, bst_mesh *mesh, bst_vec3 v) {
    if (!(fabs(v.x) <= 1e7 && fabs(v.y) <= 1e7 && fabs(v.z) <= 1e7)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "vertex (%g, %g, %g) (allowed: finite numbers within 1e7)", v.x, v.y, v.z);
    }
    const int most = 4 * BST_SATELLITE_FACETS_MAX;
    if (mesh->vertex_count == most) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "more than %d vertices (allowed: %d); simplify the mesh", most, most);
    }
    if (mesh->vertex_count == mesh->vertex_capacity) {
        int capacity = mesh->vertex_capacity ? 2 * mesh->vertex_capacity : 256;
        bst_vec3 *grown = realloc(mesh->vertices, (size_t)capacity * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d vertices", capacity);
        }
        mesh->vertices = grown;
        mesh->vertex_capacity = capacity;
    }
    mesh->vertices[mesh->vertex_count++] = v;
    return BST_OK;
}

bst_status bst_mesh_add_triangle(bst_ctx *ctx, bst_mesh *mesh, const int64_t vertices[3],
                                 int material) {
    for (int k = 0; k < 3; k++) {
        if (vertices[k] < 0 || vertices[k] >= mesh->vertex_count) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "triangle %d uses vertex %lld (allowed: one of %d vertices)",
                            mesh->triangle_count, (long long)vertices[k], mesh->vertex_count);
        }
    }
    if (mesh->triangle_count >= BST_SATELLITE_FACETS_MAX) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "more than %d triangles (allowed: %d); simplify the mesh",
                        mesh->triangle_count, BST_SATELLITE_FACETS_MAX);
    }
    if (mesh->triangle_count == mesh->triangle_capacity) {
        int capacity = mesh->triangle_capacity ? 2 * mesh->triangle_capacity : 256;
        void *triangles = realloc(mesh->triangles, (size_t)capacity * sizeof *mesh->triangles);
        mesh->triangles = triangles ? triangles : mesh->triangles;
        int *materials = realloc(mesh->triangle_material, (size_t)capacity * sizeof *materials);
        mesh->triangle_material = materials ? materials : mesh->triangle_material;
        if (!triangles || !materials) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a mesh of %d triangles", capacity);
        }
        mesh->triangle_capacity = capacity;
    }
    for (int k = 0; k < 3; k++) {
        mesh->triangles[mesh->triangle_count][k] = (int)vertices[k];
    }
    mesh->triangle_material[mesh->triangle_count++] = material;
    return BST_OK;
}

bst_status bst_mesh_add_material(bst_ctx *ctx, bst_mesh *mesh, const bst_material *material,
                                 int *index) {
    if (mesh->material_count >= BST_SATELLITE_MATERIALS_MAX - 1) {
        return bst_fail(ctx, BST_ERR_FORMAT, "more than %d materials (allowed: %d)",
                        mesh->material_count, BST_SATELLITE_MATERIALS_MAX - 1);
    }
    if (!mesh->materials) {
        mesh->materials = calloc(BST_SATELLITE_MATERIALS_MAX, sizeof *mesh->materials);
        if (!mesh->materials) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for materials");
        }
    }
    mesh->materials[mesh->material_count] = *material;
    *index = mesh->material_count++;
    return BST_OK;
}

/* A vertex with its index, for sorting. */
typedef struct placed {
    bst_vec3 v;
    int index;
} placed;

static int compare_placed(const void *a, const void *b) {
    const bst_vec3 *p = &((const placed *)a)->v, *q = &((const placed *)b)->v;
    if (p->x != q->x) {
        return p->x < q->x ? -1 : 1;
    }
    if (p->y != q->y) {
        return p->y < q->y ? -1 : 1;
    }
    return (p->z > q->z) - (p->z < q->z);
}

/* An edge: its welded vertices in ascending order, its triangle, and its sense. */
typedef struct mesh_edge {
    int a, b, triangle;
    bool forward;
} mesh_edge;

static int compare_edges(const void *a, const void *b) {
    const mesh_edge *p = a, *q = b;
    return p->a != q->a ? (p->a > q->a) - (p->a < q->a) : (p->b > q->b) - (p->b < q->b);
}

/* A triangle in the order of its connected piece. */
typedef struct ordered {
    int piece, triangle;
} ordered;

static int compare_ordered(const void *a, const void *b) {
    const ordered *p = a, *q = b;
    return p->piece != q->piece ? (p->piece > q->piece) - (p->piece < q->piece)
                                : (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

/* Topology of a mesh. */
typedef struct topology {
    int *weld;   /* by vertex: the first vertex at that place */
    int *parent; /* by vertex: union-find forest of connected vertices */
    bool *open;  /* by root vertex: an edge without exactly one opposite edge */
    ordered *order;
    placed *sorted;
    mesh_edge *edges;
    int *local;     /* by vertex: vertex of the model, or -1 */
    int first, end; /* the piece that is looked at: order[first] to order[end - 1] */
} topology;

static void free_topology(topology *t) {
    free(t->weld);
    free(t->parent);
    free(t->open);
    free(t->order);
    free(t->sorted);
    free(t->edges);
    free(t->local);
}

static int root_of(int *parent, int i) {
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

/* Welds vertices at the same place. */
static void weld(const bst_mesh *mesh, topology *t) {
    for (int i = 0; i < mesh->vertex_count; i++) {
        t->sorted[i] = (placed){mesh->vertices[i], i};
        t->parent[i] = i;
        t->local[i] = -1;
    }
    qsort(t->sorted, (size_t)mesh->vertex_count, sizeof *t->sorted, compare_placed);
    for (int i = 0; i < mesh->vertex_count; i++) {
        bool same = i > 0 && compare_placed(&t->sorted[i - 1], &t->sorted[i]) == 0;
        t->weld[t->sorted[i].index] = same ? t->weld[t->sorted[i - 1].index] : t->sorted[i].index;
    }
}

/* Finds the connected pieces and which of them are open. */
static void connect(const bst_mesh *mesh, topology *t) {
    int edges = 0;
    for (int i = 0; i < mesh->triangle_count; i++) {
        for (int k = 0; k < 3; k++) {
            int a = t->weld[mesh->triangles[i][k]], b = t->weld[mesh->triangles[i][(k + 1) % 3]];
            t->parent[root_of(t->parent, a)] = root_of(t->parent, b);
            t->edges[edges++] = (mesh_edge){a < b ? a : b, a < b ? b : a, i, a < b};
        }
    }
    qsort(t->edges, (size_t)edges, sizeof *t->edges, compare_edges);
    for (int i = 0; i < edges;) {
        int end = i + 1;
        while (end < edges && compare_edges(&t->edges[i], &t->edges[end]) == 0) {
            end++;
        }
        if (end - i != 2 || t->edges[i].forward == t->edges[i + 1].forward) {
            t->open[root_of(t->parent, t->edges[i].a)] = true;
        }
        i = end;
    }
    for (int i = 0; i < mesh->triangle_count; i++) {
        t->order[i] = (ordered){root_of(t->parent, t->weld[mesh->triangles[i][0]]), i};
    }
    qsort(t->order, (size_t)mesh->triangle_count, sizeof *t->order, compare_ordered);
}

static bst_vec3 corner_of(const bst_mesh *mesh, int triangle, int k) {
    return mesh->vertices[mesh->triangles[triangle][k]];
}

/* True if a closed piece has its normals outward. */
static bool is_outward(const bst_mesh *mesh, const topology *t) {
    double volume = 0.0;
    bst_vec3 middle = corner_of(mesh, t->order[t->first].triangle, 0);
    for (int i = t->first; i < t->end; i++) {
        bst_vec3 v[3];
        for (int k = 0; k < 3; k++) {
            v[k] = bst_vec3_sub(corner_of(mesh, t->order[i].triangle, k), middle);
        }
        volume += bst_vec3_dot(v[0], bst_vec3_cross(v[1], v[2]));
    }
    return volume > 0.0;
}

/* True if a closed piece is convex, with its normals outward, and
 * small enough for one body. */
static bool is_convex(const bst_mesh *mesh, const topology *t) {
    if (t->end - t->first > 2 * CONVEX_VERTICES_MAX - 4 || t->open[t->order[t->first].piece]) {
        return false;
    }
    double size = 0.0;
    bst_vec3 middle = corner_of(mesh, t->order[t->first].triangle, 0);
    for (int i = t->first; i < t->end; i++) {
        for (int k = 0; k < 3; k++) {
            bst_vec3 r = bst_vec3_sub(corner_of(mesh, t->order[i].triangle, k), middle);
            size = fmax(size, bst_vec3_norm(r));
        }
    }
    for (int i = t->first; i < t->end; i++) {
        bst_vec3 a = corner_of(mesh, t->order[i].triangle, 0);
        bst_vec3 n = bst_vec3_unit(
            bst_vec3_cross(bst_vec3_sub(corner_of(mesh, t->order[i].triangle, 1), a),
                           bst_vec3_sub(corner_of(mesh, t->order[i].triangle, 2), a)));
        for (int j = t->first; j < t->end; j++) {
            for (int k = 0; k < 3; k++) {
                bst_vec3 r = bst_vec3_sub(corner_of(mesh, t->order[j].triangle, k), a);
                if (bst_vec3_dot(r, n) > 1e-6 * size) {
                    return false;
                }
            }
        }
    }
    return is_outward(mesh, t);
}

static bst_status add_convex(bst_ctx *ctx, bst_satellite *s, const bst_mesh *mesh, topology *t,
                             double scale, const bst_part_place *place) {
    int first_facet = s->facet_count;
    BST_TRY(bst_model_begin_occluder(ctx, s));
    for (int i = t->first; i < t->end; i++) {
        int corners[3], triangle = t->order[i].triangle;
        for (int k = 0; k < 3; k++) {
            int w = t->weld[mesh->triangles[triangle][k]];
            if (t->local[w] < 0) {
                BST_TRY(bst_model_add_vertex(
                    ctx, s, place, bst_vec3_scale(mesh->vertices[w], scale), &t->local[w]));
            }
            corners[k] = t->local[w];
        }
        BST_TRY(
            bst_model_add_facet(ctx, s, place, corners, 3, mesh->triangle_material[triangle], -1));
    }
    return bst_model_end_occluder(ctx, s, first_facet);
}

/* Adds each triangle of a piece as a body of its own. */
static bst_status add_triangles(bst_ctx *ctx, bst_satellite *s, const bst_mesh *mesh,
                                const topology *t, double scale, const bst_part_place *place) {
    bool two_sided = t->open[t->order[t->first].piece] || !is_outward(mesh, t);
    for (int i = t->first; i < t->end; i++) {
        int corners[3], triangle = t->order[i].triangle, first_facet = s->facet_count;
        BST_TRY(bst_model_begin_occluder(ctx, s));
        for (int k = 0; k < 3; k++) {
            BST_TRY(bst_model_add_vertex(
                ctx, s, place, bst_vec3_scale(corner_of(mesh, triangle, k), scale), &corners[k]));
        }
        int back[3] = {corners[2], corners[1], corners[0]};
        int material = mesh->triangle_material[triangle];
        BST_TRY(bst_model_add_facet(ctx, s, place, corners, 3, material, -1));
        if (two_sided) {
            BST_TRY(bst_model_add_facet(ctx, s, place, back, 3, material, -1));
        }
        BST_TRY(bst_model_end_occluder(ctx, s, first_facet));
    }
    return BST_OK;
}

bst_status bst_model_add_mesh(bst_ctx *ctx, bst_satellite *s, const bst_mesh *mesh, double scale,
                              const bst_part_place *place) {
    size_t vertices = (size_t)mesh->vertex_count + 1, triangles = (size_t)mesh->triangle_count + 1;
    topology t = {.weld = calloc(vertices, sizeof *t.weld),
                  .parent = calloc(vertices, sizeof *t.parent),
                  .open = calloc(vertices, sizeof *t.open),
                  .order = calloc(triangles, sizeof *t.order),
                  .sorted = calloc(vertices, sizeof *t.sorted),
                  .edges = calloc(3 * triangles, sizeof *t.edges),
                  .local = calloc(vertices, sizeof *t.local)};
    bst_status status = BST_OK;
    if (!t.weld || !t.parent || !t.open || !t.order || !t.sorted || !t.edges || !t.local) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for a mesh of %d triangles",
                          mesh->triangle_count);
    } else if (mesh->triangle_count == 0) {
        status = bst_fail(ctx, BST_ERR_FORMAT, "the mesh has no triangles");
    } else {
        weld(mesh, &t);
        connect(mesh, &t);
    }
    for (int i = 0; i < mesh->triangle_count && status == BST_OK;) {
        int end = i + 1;
        while (end < mesh->triangle_count && t.order[end].piece == t.order[i].piece) {
            end++;
        }
        t.first = i;
        t.end = end;
        status = is_convex(mesh, &t) ? add_convex(ctx, s, mesh, &t, scale, place)
                                     : add_triangles(ctx, s, mesh, &t, scale, place);
        i = end;
    }
    free_topology(&t);
    return status;
}
