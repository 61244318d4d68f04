#include "sim/satellite/pose.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/pose_view.h"
#include "sim/satellite/separation.h"

static void free_view(bst_pose_view *v) {
    free(v->flat);
    free(v->depth_m);
    free(v->within_rim);
    free(v->bounds);
    free(v->hiders);
    free(v->outline);
    free(v->outline_count);
    free(v->sides);
    free(v->side_blocks);
    free(v->cell_first);
    free(v->cell_items);
}

void bst_satellite_pose_free(bst_satellite_pose *p) {
    if (p) {
        free(p->vertices);
        free(p->normals);
        free(p->rotation);
        free(p->origin);
        free(p->seen);
        free(p->hiders);
        free(p->curved);
        free(p->next);
        free(p->flat);
        free(p->front);
        free(p->front_hull);
        free(p->facing);
        free(p->pairs);
        free(p->faces);
        free(p->plane);
        free(p->plane_corner);
        free(p->sides);
        free_view(&p->views[0]);
        free_view(&p->views[1]);
        bst_polygon_clip_free(&p->clip);
        bst_polygon_covers_free(&p->covers);
        free(p);
    }
}

/* First block of half planes of an occluder in a view: there is room for one at each vertex. */
static int first_block(const bst_satellite *s, int occluder) {
    int vertex =
        occluder < s->occluder_count ? s->occluders[occluder].first_vertex : s->vertex_count;
    return vertex / BST_HALF_PLANES + occluder;
}

/* Allocates a view. The grid of a model with many occluders has about one cell for each; an
 * occluder that covers many cells is in all of them, at most the capacity below. */
static bool make_view(const bst_satellite *s, bst_pose_view *v) {
    v->flat = calloc((size_t)s->vertex_count + 1, sizeof *v->flat);
    v->depth_m = calloc((size_t)s->vertex_count + 1, sizeof *v->depth_m);
    v->within_rim = calloc((size_t)s->vertex_count + 1, sizeof *v->within_rim);
    v->bounds = calloc((size_t)s->occluder_count + 1, sizeof *v->bounds);
    v->outline = calloc(2 * (size_t)s->vertex_count + 8, sizeof *v->outline);
    v->outline_count = calloc((size_t)s->occluder_count + 1, sizeof *v->outline_count);
    v->hiders = calloc((size_t)s->occluder_count + 1, sizeof *v->hiders);
    bool made = v->flat && v->depth_m && v->within_rim && v->bounds && v->hiders && v->outline &&
                v->outline_count;
    if (s->occluder_count <= BST_SEPARATION_BODIES) {
        int blocks = first_block(s, s->occluder_count);
        v->sides = calloc((size_t)blocks + 1, sizeof *v->sides);
        v->side_blocks = calloc((size_t)s->occluder_count + 1, sizeof *v->side_blocks);
        made = made && v->sides && v->side_blocks;
    } else {
        v->cells = (int)fmin(sqrt((double)s->occluder_count), 256.0);
        v->cell_item_capacity = 32 * s->occluder_count + v->cells * v->cells;
        v->cell_first = calloc((size_t)(v->cells * v->cells) + 2, sizeof *v->cell_first);
        v->cell_items = calloc((size_t)v->cell_item_capacity, sizeof *v->cell_items);
        made = made && v->cell_first && v->cell_items;
    }
    return made;
}

/* Lists the plane faces of the bodies. False: out of memory. */
static bool make_pairs(bst_satellite_pose *p) {
    const bst_satellite *s = p->satellite;
    int n = s->occluder_count;
    if (n > BST_SEPARATION_BODIES) {
        return true;
    }
    p->pairs = calloc((size_t)(n * n) + 1, sizeof *p->pairs);
    p->faces = malloc(((size_t)n + 1) * sizeof *p->faces);
    if (!p->pairs || !p->faces) {
        return false;
    }
    memset(p->faces, -1, ((size_t)n + 1) * sizeof *p->faces);
    for (int f = 0; f < s->facet_count; f++) {
        int *faces = p->faces[s->facets[f].occluder], k = 0;
        while (k < BST_SEPARATION_FACES && faces[k] >= 0) {
            k++;
        }
        if (k < BST_SEPARATION_FACES && s->facets[f].curved < 0) {
            faces[k] = f;
        }
    }
    return true;
}

/* Coordinates of the corners of a facet along the edges of the triangle of its corners 0, a and b.
 * Returned: the area of the triangle over that of the facet. */
static double set_plane(bst_satellite_pose *p, int index, int a, int b) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    const int *corner = s->corner + f->first;
    bst_vec3 origin = s->vertices[corner[0]];
    bst_vec3 x = bst_vec3_sub(s->vertices[corner[a]], origin);
    bst_vec3 y = bst_vec3_sub(s->vertices[corner[b]], origin), n = bst_vec3_cross(x, y);
    double n2 = bst_vec3_dot(n, n);
    for (int i = 0; i < f->count; i++) {
        bst_vec3 r = bst_vec3_sub(s->vertices[corner[i]], origin);
        p->plane[f->first + i] = (bst_point2){bst_vec3_dot(bst_vec3_cross(r, y), n) / n2,
                                              bst_vec3_dot(bst_vec3_cross(x, r), n) / n2};
    }
    p->plane_corner[index][0] = a;
    p->plane_corner[index][1] = b;
    return 0.5 * sqrt(n2) / f->area_m2;
}

/* Sets the planes of all facets. */
static bool make_planes(bst_satellite_pose *p) {
    const bst_satellite *s = p->satellite;
    p->plane = calloc((size_t)s->corner_count + 1, sizeof *p->plane);
    p->plane_corner = calloc((size_t)s->facet_count + 1, sizeof *p->plane_corner);
    p->sides = calloc(BST_POLYGON_CORNERS_MAX / BST_HALF_PLANES + 1, sizeof *p->sides);
    for (int f = 0; f < s->facet_count && p->plane && p->plane_corner; f++) {
        int n = s->facets[f].count, best[2] = {1, 2};
        /* a third of a regular polygon's corners apart; else the largest triangle */
        if (set_plane(p, f, n / 3, 2 * n / 3) > 0.1) {
            continue;
        }
        double most = 0.0;
        for (int a = 1; a < n; a++) {
            for (int b = a + 1; b < n; b++) {
                double share = set_plane(p, f, a, b);
                if (share > most) {
                    most = share;
                    best[0] = a;
                    best[1] = b;
                }
            }
        }
        (void)set_plane(p, f, best[0], best[1]);
    }
    return p->plane && p->plane_corner && p->sides;
}

static bst_status make_polygons(bst_ctx *ctx, bst_satellite_pose *p) {
    BST_TRY(bst_polygon_clip_create(ctx, &p->clip));
    return bst_polygon_covers_create(ctx, &p->covers);
}

bst_status bst_satellite_pose_create(bst_ctx *ctx, const bst_satellite *s,
                                     bst_satellite_pose **out) {
    bst_satellite_pose *p = *out = calloc(1, sizeof *p);
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pose of a satellite");
    }
    p->satellite = s;
    p->stamp = 1;
    p->vertices = calloc((size_t)s->vertex_count + 1, sizeof *p->vertices);
    p->normals = calloc((size_t)s->facet_count + 1, sizeof *p->normals);
    p->rotation = calloc((size_t)s->joint_count + 1, sizeof *p->rotation);
    p->origin = calloc((size_t)s->joint_count + 1, sizeof *p->origin);
    p->facing = calloc((size_t)s->facet_count + 1, sizeof *p->facing);
    p->seen = calloc((size_t)s->occluder_count + 1, sizeof *p->seen);
    p->hiders = calloc(2 * (size_t)s->occluder_count + 1, sizeof *p->hiders);
    p->curved = calloc((size_t)s->curved_count + 1, sizeof *p->curved);
    int most = 0, both = 0;
    for (int o = 0; o < s->occluder_count; o++) {
        int vertices = s->occluders[o].vertex_count, edges = s->occluders[o].edge_count;
        most = vertices > most ? vertices : most;
        both = vertices + edges > both ? vertices + edges : both;
    }
    p->front = calloc((size_t)both + 1, sizeof *p->front);
    p->front_hull = calloc(2 * (size_t)both + 2, sizeof *p->front_hull);
    p->next = calloc((size_t)most + 1, sizeof *p->next);
    p->flat = calloc((size_t)most + 1, sizeof *p->flat);
    bool made = p->vertices && p->normals && p->rotation && p->origin && p->seen && p->hiders &&
                p->curved && p->next && p->flat && p->front && p->front_hull && p->facing &&
                make_view(s, &p->views[0]) && make_view(s, &p->views[1]) && make_pairs(p) &&
                make_planes(p);
    bst_status status =
        made ? make_polygons(ctx, p)
             : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pose of a satellite of %d facets",
                        s->facet_count);
    if (status != BST_OK) {
        bst_satellite_pose_free(p);
        *out = NULL;
        return status;
    }
    /* what does not turn is placed once */
    memcpy(p->vertices, s->vertices, (size_t)s->vertex_count * sizeof *p->vertices);
    for (int f = 0; f < s->facet_count; f++) {
        p->normals[f] = s->facets[f].normal;
    }
    return BST_OK;
}

void bst_satellite_pose_set(bst_satellite_pose *p, const bst_satellite_aim *aim) {
    const bst_satellite *s = p->satellite;
    if (s->joint_count == 0) {
        return;
    }
    p->stamp++;
    bst_satellite_pose_turn(p, aim);
    for (int i = 0; i < s->vertex_count; i++) {
        int j = s->vertex_joint[i];
        if (j >= 0) {
            p->vertices[i] =
                bst_vec3_add(p->origin[j], bst_mat3_mul_vec(&p->rotation[j], s->vertices[i]));
        }
    }
    for (int f = 0; f < s->facet_count; f++) {
        int j = s->facets[f].joint;
        if (j >= 0) {
            p->normals[f] = bst_mat3_mul_vec(&p->rotation[j], s->facets[f].normal);
        }
    }
}

/* Sorts the occluders into the cells of the view's grid; without a grid if they need too much
 * room. */
static void fill_grid(bst_pose_view *v, int occluders) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int o = 0; o < occluders; o++) {
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], v->bounds[o][2 * a]);
            high[a] = fmax(high[a], v->bounds[o][2 * a + 1]);
        }
    }
    for (int a = 0; a < 2; a++) {
        v->origin[a] = low[a];
        v->step[a] = high[a] > low[a] ? v->cells / (high[a] - low[a]) : 0.0;
    }
    int n = v->cells * v->cells;
    memset(v->cell_first, 0, ((size_t)n + 2) * sizeof *v->cell_first);
    v->cell_item_count = -1;
    int64_t room = v->cell_item_capacity;
    for (int pass = 0; pass < 2; pass++) {
        for (int o = 0; o < occluders; o++) {
            const double *b = v->bounds[o];
            int x0 = bst_pose_cell(v, 0, b[0]), x1 = bst_pose_cell(v, 0, b[1]);
            int y0 = bst_pose_cell(v, 1, b[2]), y1 = bst_pose_cell(v, 1, b[3]);
            room -= pass == 0 ? (x1 - x0 + 1) * (y1 - y0 + 1) : 0;
            if (room < 0) {
                return;
            }
            for (int y = y0; y <= y1; y++) {
                for (int x = x0; x <= x1; x++) {
                    int c = y * v->cells + x;
                    if (pass == 0) {
                        v->cell_first[c + 2]++;
                    } else {
                        v->cell_items[v->cell_first[c + 1]++] = o;
                    }
                }
            }
        }
        if (pass == 0) {
            for (int c = 0; c < n; c++) {
                v->cell_first[c + 2] += v->cell_first[c + 1];
            }
        }
    }
    v->cell_item_count = v->cell_first[n];
}

/* Silhouette of a closed body: the edges between facets that face the view and others, in order.
 * Returned: number of corners; 0 if the edges form no single loop (facets seen edge-on). */
static int walk_outline(const bst_satellite_pose *p, const bst_pose_view *v, const bst_occluder *o,
                        bst_point2 *to) {
    int *next = p->next, edges = 0, start = -1, n = 0;
    for (int f = o->first_facet; f < o->first_facet + o->facet_count; f++) {
        p->facing[f] = bst_vec3_dot(p->normals[f], v->z) > 0.0;
    }
    bool rim = o->shell >= 0 && bst_vec3_dot(bst_pose_shell_axis(p, o->shell), v->z) > 0.0;
    memset(next, -1, (size_t)o->vertex_count * sizeof next[0]);
    for (int e = o->first_edge; e < o->first_edge + o->edge_count; e++) {
        const int *edge = p->satellite->edges[e];
        bool left = edge[2] >= 0 ? p->facing[edge[2]] : rim;
        bool right = edge[3] >= 0 ? p->facing[edge[3]] : rim;
        if (left != right) {
            start = (left ? edge[0] : edge[1]) - o->first_vertex;
            next[start] = (left ? edge[1] : edge[0]) - o->first_vertex;
            edges++;
        }
    }
    for (int at = start; at >= 0 && n < edges; n++) {
        to[n] = v->flat[o->first_vertex + at];
        at = next[at];
        if (at == start) {
            return n + 1 == edges ? edges : 0;
        }
    }
    return 0;
}

/* Silhouette of an occluder in a view. */
static int outline_of(const bst_satellite_pose *p, bst_pose_view *v, int occluder,
                      const bst_point2 **points) {
    const bst_occluder *o = &p->satellite->occluders[occluder];
    bst_point2 *to = v->outline + 2 * o->first_vertex;
    if (v->outline_count[occluder] < 0 && o->closed) {
        int n = walk_outline(p, v, o, to);
        v->outline_count[occluder] = n >= 3 ? n : -1;
    }
    if (v->outline_count[occluder] < 0) {
        memcpy(p->flat, v->flat + o->first_vertex, (size_t)o->vertex_count * sizeof *p->flat);
        v->outline_count[occluder] = bst_polygon_hull(p->flat, o->vertex_count, to);
    }
    *points = to;
    return v->outline_count[occluder];
}

int bst_pose_outline(bst_satellite_pose *p, int view, int occluder, const bst_point2 **points) {
    return outline_of(p, &p->views[view], occluder, points);
}

int bst_pose_sides(bst_satellite_pose *p, int view, int occluder, const bst_half_planes **sides) {
    bst_pose_view *v = &p->views[view];
    bool kept = v->side_blocks != NULL;
    *sides = kept ? v->sides + first_block(p->satellite, occluder) : p->sides;
    if (kept && v->side_blocks[occluder] >= 0) {
        return v->side_blocks[occluder];
    }
    const bst_point2 *outline;
    int n = outline_of(p, v, occluder, &outline);
    int blocks = n <= BST_POLYGON_CORNERS_MAX
                     ? bst_half_planes_of(outline, n, (bst_half_planes *)*sides)
                     : 0;
    if (kept) {
        v->side_blocks[occluder] = blocks;
    }
    return blocks;
}

/* True if the silhouettes of two bodies overlap, which are not the same one. */
static bool silhouettes_meet(const bst_satellite_pose *p, bst_pose_view *v, int a, int b) {
    const bst_point2 *of_a, *of_b;
    int n = outline_of(p, v, a, &of_a), m = outline_of(p, v, b, &of_b);
    return !bst_polygon_is_separate(of_a, n, of_b, m);
}

/* True if body k may hide some of body o, by bounds and planes between them. */
static bool may_hide_body(bst_satellite_pose *p, const bst_pose_view *v, int k, int o) {
    bst_vec3 axis;
    /* a ray that does not advance along the axis leads away from the other body */
    return bst_pose_may_hide(v->bounds[k], v->bounds[o]) &&
           (!bst_separation(p, o, k, &axis) || bst_vec3_dot(axis, v->z) > 1e-12);
}

/* Marks the vertices of a shell from which rays along the view's direction leave it through its
 * rim. Those of the rim itself do. */
static void mark_within_rim(const bst_satellite_pose *p, bst_pose_view *v, const bst_occluder *o) {
    const bst_shell *shell = &p->satellite->shells[o->shell];
    bst_pose_rim rim = bst_pose_rim_of(p, v, o->shell);
    for (int i = o->first_vertex; i < o->first_vertex + o->vertex_count; i++) {
        v->within_rim[i] = bst_pose_is_within_rim(v, &rim, p->vertices[i]);
    }
    for (int i = shell->first_rim; i < shell->first_rim + shell->rim_count; i++) {
        v->within_rim[i] = rim.rate > 0.0;
    }
}

void bst_pose_look(bst_satellite_pose *p, int view, bst_vec3 direction) {
    const bst_satellite *s = p->satellite;
    bst_pose_view *v = &p->views[view];
    v->z = direction;
    v->x = bst_vec3_perpendicular(direction);
    v->y = bst_vec3_cross(v->z, v->x);
    for (int o = 0; o < s->occluder_count; o++) {
        const bst_occluder *body = &s->occluders[o];
        double *b = v->bounds[o];
        bst_pose_start_bounds(b);
        for (int i = body->first_vertex; i < body->first_vertex + body->vertex_count; i++) {
            bst_vec3 q = p->vertices[i];
            v->flat[i] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
            v->depth_m[i] = bst_vec3_dot(q, v->z);
            bst_pose_add_to_bounds(v, i, b);
        }
        v->outline_count[o] = -1;
        if (v->side_blocks) {
            v->side_blocks[o] = -1;
        }
        if (body->shell >= 0) {
            mark_within_rim(p, v, body);
        }
    }
    if (v->cells > 0) {
        fill_grid(v, s->occluder_count);
        return;
    }
    for (int o = 0; o < s->occluder_count; o++) {
        v->hiders[o] = (uint64_t)1 << o;
        for (int k = 0; k < o; k++) {
            bool of_o = may_hide_body(p, v, k, o), of_k = may_hide_body(p, v, o, k);
            if ((of_o || of_k) && silhouettes_meet(p, v, o, k)) {
                v->hiders[o] |= of_o ? (uint64_t)1 << k : 0;
                v->hiders[k] |= of_k ? (uint64_t)1 << o : 0;
            }
        }
    }
}
