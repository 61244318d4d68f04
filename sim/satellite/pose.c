#include "sim/satellite/pose.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/separation.h"

static void free_view(bst_pose_view *v) {
    free(v->bounds);
    free(v->hiders);
    free(v->outline);
    free(v->outline_count);
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
        free(p->next);
        free(p->flat);
        free(p->front);
        free(p->front_hull);
        free(p->pairs);
        free(p->faces);
        free_view(&p->views[0]);
        free_view(&p->views[1]);
        bst_polygon_clip_free(&p->clip);
        free(p);
    }
}

/* Allocates a view. The grid of a model with many occluders has about one cell for each; an
 * occluder that covers many cells is in all of them, at most the capacity below. */
static bool make_view(const bst_satellite *s, bst_pose_view *v) {
    v->bounds = calloc((size_t)s->occluder_count + 1, sizeof *v->bounds);
    v->outline = calloc(2 * (size_t)s->vertex_count + 8, sizeof *v->outline);
    v->outline_count = calloc((size_t)s->occluder_count + 1, sizeof *v->outline_count);
    v->hiders = calloc((size_t)s->occluder_count + 1, sizeof *v->hiders);
    bool made = v->bounds && v->hiders && v->outline && v->outline_count;
    if (s->occluder_count > BST_SEPARATION_BODIES) {
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
    p->seen = calloc((size_t)s->occluder_count + 1, sizeof *p->seen);
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
    bool made = p->vertices && p->normals && p->rotation && p->origin && p->seen && p->next &&
                p->flat && p->front && p->front_hull && make_view(s, &p->views[0]) &&
                make_view(s, &p->views[1]) && make_pairs(p);
    bst_status status =
        made ? bst_polygon_clip_create(ctx, &p->clip)
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

/* Cell of a coordinate, clamped to the grid. */
static int cell_of(const bst_pose_view *v, int axis, double x) {
    double c = (x - v->origin[axis]) * v->step[axis];
    return c < 1.0 ? 0 : c >= v->cells ? v->cells - 1 : (int)c;
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
            int x0 = cell_of(v, 0, b[0]), x1 = cell_of(v, 0, b[1]);
            int y0 = cell_of(v, 1, b[2]), y1 = cell_of(v, 1, b[3]);
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

/* True if an occluder may hide a part of the facet. */
static bool may_hide(const double o[6], const double f[6]) {
    return o[0] < f[1] && o[1] > f[0] && o[2] < f[3] && o[3] > f[2] && o[5] > f[4];
}

static void start_bounds(double b[6]) {
    b[0] = b[2] = b[4] = INFINITY;
    b[1] = b[3] = b[5] = -INFINITY;
}

/* Extends bounds to a point. */
static void add_to_bounds(const bst_pose_view *v, bst_vec3 q, double b[6]) {
    double c[3] = {bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y), bst_vec3_dot(q, v->z)};
    for (int a = 0; a < 3; a++) {
        b[2 * a] = c[a] < b[2 * a] ? c[a] : b[2 * a];
        b[2 * a + 1] = c[a] > b[2 * a + 1] ? c[a] : b[2 * a + 1];
    }
}

/* Silhouette of a closed body: the edges between facets that face the view and others, in order.
 * Returned: number of corners; 0 if the edges form no single loop (facets seen edge-on). */
static int walk_outline(const bst_satellite_pose *p, const bst_pose_view *v, const bst_occluder *o,
                        bst_point2 *to) {
    int *next = p->next, edges = 0, start = -1, n = 0;
    memset(next, -1, (size_t)o->vertex_count * sizeof next[0]);
    for (int e = o->first_edge; e < o->first_edge + o->edge_count; e++) {
        const int *edge = p->satellite->edges[e];
        bool left = bst_vec3_dot(p->normals[edge[2]], v->z) > 0.0;
        bool right = bst_vec3_dot(p->normals[edge[3]], v->z) > 0.0;
        if (left != right) {
            start = (left ? edge[0] : edge[1]) - o->first_vertex;
            next[start] = (left ? edge[1] : edge[0]) - o->first_vertex;
            edges++;
        }
    }
    for (int at = start; at >= 0 && n < edges; n++) {
        bst_vec3 q = p->vertices[o->first_vertex + at];
        to[n] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
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
        for (int i = 0; i < o->vertex_count; i++) {
            bst_vec3 q = p->vertices[o->first_vertex + i];
            p->flat[i] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
        }
        v->outline_count[occluder] = bst_polygon_hull(p->flat, o->vertex_count, to);
    }
    *points = to;
    return v->outline_count[occluder];
}

int bst_pose_outline(bst_satellite_pose *p, int view, int occluder, const bst_point2 **points) {
    return outline_of(p, &p->views[view], occluder, points);
}

/* True if the silhouettes of two bodies overlap, which are not the same one. */
static bool silhouettes_meet(const bst_satellite_pose *p, bst_pose_view *v, int a, int b) {
    const bst_point2 *of_a, *of_b;
    int n = outline_of(p, v, a, &of_a), m = outline_of(p, v, b, &of_b);
    return !bst_polygon_is_separate(of_a, n, of_b, m);
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
        start_bounds(b);
        for (int i = 0; i < body->vertex_count; i++) {
            add_to_bounds(v, p->vertices[body->first_vertex + i], b);
        }
        v->outline_count[o] = -1;
    }
    if (v->cells > 0) {
        fill_grid(v, s->occluder_count);
        return;
    }
    for (int o = 0; o < s->occluder_count; o++) {
        v->hiders[o] = 0;
        for (int k = 0; k < s->occluder_count; k++) {
            bst_vec3 axis;
            /* a ray that does not advance along the axis leads away from the other body */
            if (may_hide(v->bounds[k], v->bounds[o]) &&
                (k == o || ((!bst_separation(p, o, k, &axis) || bst_vec3_dot(axis, v->z) > 1e-12) &&
                            silhouettes_meet(p, v, o, k)))) {
                v->hiders[o] |= (uint64_t)1 << k;
            }
        }
    }
}

/* The plane of a facet and the projection of a view onto it. */
typedef struct plane {
    bst_vec3 origin, normal, e1, e2;
    bst_point2 whole[BST_POLYGON_CORNERS_MAX]; /* the facet */
    int count;
    int body;              /* its occluder */
    bool mapped;           /* the three members below are those of the view */
    bst_point2 zero, x, y; /* from the view's coordinates: zero + u x + v y */
    double nearest_m;      /* largest coordinate of the facet along the view's direction */
} plane;

void bst_pose_facet_axes(const bst_satellite_pose *p, int facet, bst_vec3 *origin, bst_vec3 *e1,
                         bst_vec3 *e2) {
    const bst_facet *f = &p->satellite->facets[facet];
    *origin = p->vertices[p->satellite->corner[f->first]];
    *e1 = bst_vec3_perpendicular(p->normals[facet]);
    *e2 = bst_vec3_cross(p->normals[facet], *e1);
}

/* Coordinates in the facet's plane of a point moved along the view's direction into it. */
static bst_point2 drop(const plane *f, const bst_pose_view *v, bst_vec3 q) {
    bst_vec3 r = bst_vec3_sub(q, f->origin);
    double t = bst_vec3_dot(r, f->normal) / bst_vec3_dot(v->z, f->normal);
    r = bst_vec3_axpy(r, -t, v->z);
    return (bst_point2){bst_vec3_dot(r, f->e1), bst_vec3_dot(r, f->e2)};
}

/* True if rays from all corners of a facet along the view's direction, which goes out through the
 * rim's plane, pass within the circle that the polygon of the rim contains. */
static bool is_within_rim(const bst_satellite_pose *p, int facet, const bst_pose_view *v,
                          const bst_shell *shell, bst_vec3 axis) {
    const bst_facet *own = &p->satellite->facets[facet];
    bst_vec3 centre = bst_vec3_axpy(shell->apex_m, shell->depth_m, shell->axis);
    if (shell->joint >= 0) {
        centre = bst_vec3_add(p->origin[shell->joint],
                              bst_mat3_mul_vec(&p->rotation[shell->joint], centre));
    }
    double inner = shell->radius_m * cos(BST_PI / shell->rim_count),
           rate = bst_vec3_dot(axis, v->z);
    for (int i = 0; i < own->count; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[p->satellite->corner[own->first + i]], centre);
        r = bst_vec3_axpy(r, -bst_vec3_dot(r, axis) / rate, v->z);
        if (!(bst_vec3_dot(r, r) < inner * inner)) {
            return false;
        }
    }
    return true;
}

/* Keeps what light reaches through the rim of a shell. */
static void look_through_rim(bst_satellite_pose *p, int facet, const plane *f,
                             const bst_pose_view *v, const bst_shell *shell) {
    bst_point2 rim[BST_POLYGON_CORNERS_MAX];
    bst_vec3 axis = shell->axis;
    if (shell->joint >= 0) {
        axis = bst_mat3_mul_vec(&p->rotation[shell->joint], axis);
    }
    if (!(bst_vec3_dot(axis, v->z) > 0.0)) {
        p->clip.piece_count = 0;
        return;
    }
    if (is_within_rim(p, facet, v, shell, axis)) {
        return;
    }
    for (int i = 0; i < shell->rim_count; i++) {
        rim[i] = drop(f, v, p->vertices[shell->first_rim + i]);
    }
    bst_polygon_clip_intersect(&p->clip, rim, shell->rim_count);
}

/* True if the middle of a facet is inside a shell. */
static bool is_inside(const bst_satellite_pose *p, const bst_facet *facet, const bst_shell *shell) {
    bst_vec3 middle = {0};
    for (int i = 0; i < facet->count; i++) {
        bst_vec3 q = p->vertices[p->satellite->corner[facet->first + i]];
        middle = bst_vec3_axpy(middle, 1.0 / facet->count, q);
    }
    if (shell->joint >= 0) {
        middle = bst_mat3_transpose_mul_vec(&p->rotation[shell->joint],
                                            bst_vec3_sub(middle, p->origin[shell->joint]));
    }
    bst_vec3 r = bst_vec3_sub(middle, shell->apex_m);
    double z = bst_vec3_dot(r, shell->axis);
    double across2 = bst_vec3_dot(r, r) - z * z;
    return z < shell->depth_m && z > shell->depth_m * across2 / (shell->radius_m * shell->radius_m);
}

/* Moves an outline from the view's plane into the facet's. */
static void map_outline(plane *f, const bst_pose_view *v, const bst_point2 *outline, int count,
                        bst_point2 *moved) {
    if (!f->mapped) { /* the projection of the view's plane onto the facet's is affine */
        bst_point2 x = drop(f, v, v->x), y = drop(f, v, v->y);
        f->zero = drop(f, v, (bst_vec3){0});
        f->x = (bst_point2){x.x - f->zero.x, x.y - f->zero.y};
        f->y = (bst_point2){y.x - f->zero.x, y.y - f->zero.y};
        f->mapped = true;
    }
    const bst_point2 a = f->zero, x = f->x, y = f->y;
    for (int i = 0; i < count; i++) {
        moved[i].x = a.x + outline[i].x * x.x + outline[i].y * y.x;
        moved[i].y = a.y + outline[i].x * x.y + outline[i].y * y.y;
    }
}

/* Subtracts an occluder's silhouette from the facet. */
static void subtract(bst_satellite_pose *p, plane *f, bst_pose_view *v, int occluder) {
    bst_vec3 axis;
    /* where bodies are separate, the ray leads toward this one: see bst_pose_look */
    bool apart = bst_separation(p, f->body, occluder, &axis);
    bst_point2 moved[BST_POLYGON_CORNERS_MAX];
    const bst_point2 *outline;
    int n = outline_of(p, v, occluder, &outline);
    n = n <= BST_POLYGON_CORNERS_MAX ? n : 0;
    map_outline(f, v, outline, n, moved);
    if (bst_polygon_is_separate(f->whole, f->count, moved, n)) {
        return;
    }
    /* all of what is nearer to the light than the whole facet is in front of it, where it matters
     */
    bool overlaps = true;
    if (!apart && v->bounds[occluder][4] < f->nearest_m) {
        int front = bst_pose_front(p, v, occluder, f->origin, f->normal, &outline);
        if (front == 0) {
            return;
        }
        if (front != BST_POSE_ALL_IN_FRONT) {
            n = front;
            map_outline(f, v, outline, n, moved);
            overlaps = false;
        }
    }
    bst_polygon_clip_subtract(&p->clip, moved, n, overlaps);
}

/* Bounds of a facet in a view. */
static void facet_bounds(const bst_satellite_pose *p, const bst_facet *facet,
                         const bst_pose_view *v, double b[6]) {
    start_bounds(b);
    for (int i = 0; i < facet->count; i++) {
        add_to_bounds(v, p->vertices[p->satellite->corner[facet->first + i]], b);
    }
}

/* Sets the plane of a facet and starts the clip with the whole facet. */
static void start_clip(bst_satellite_pose *p, int index, plane *f) {
    const bst_satellite *s = p->satellite;
    const bst_facet *facet = &s->facets[index];
    f->count = facet->count;
    f->body = facet->occluder;
    f->normal = p->normals[index];
    bst_pose_facet_axes(p, index, &f->origin, &f->e1, &f->e2);
    for (int i = 0; i < facet->count; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[s->corner[facet->first + i]], f->origin);
        f->whole[i] = (bst_point2){bst_vec3_dot(r, f->e1), bst_vec3_dot(r, f->e2)};
    }
    bst_polygon_clip_start(&p->clip, f->whole, facet->count);
}

/* Subtracts from a facet, and starts the clip with the first one that may hide it. */
static void try_occluder(bst_satellite_pose *p, int facet, bst_pose_view *v, int occluder, plane *f,
                         bool *whole) {
    const bst_facet *own = &p->satellite->facets[facet];
    int shell = p->satellite->occluders[occluder].shell;
    if (occluder == own->occluder && !own->inside) {
        return;
    }
    if (*whole) {
        start_clip(p, facet, f);
        *whole = false;
    }
    if (shell >= 0 &&
        (occluder == own->occluder || is_inside(p, own, &p->satellite->shells[shell]))) {
        look_through_rim(p, facet, f, v, &p->satellite->shells[shell]);
    } else {
        subtract(p, f, v, occluder);
    }
}

double bst_pose_unshadowed(bst_satellite_pose *p, int index, int views, bool *whole) {
    const bst_satellite *s = p->satellite;
    const bst_facet *facet = &s->facets[index];
    plane f;
    *whole = true;
    for (int k = 0; k < views; k++) {
        bst_pose_view *v = &p->views[k];
        double b[6];
        bool few = s->occluder_count <= BST_SEPARATION_BODIES;
        uint64_t hiders = few ? v->hiders[facet->occluder] : 0;
        if (few && !facet->inside) {
            hiders &= ~((uint64_t)1 << facet->occluder);
        }
        if (few && hiders == 0) {
            continue;
        }
        facet_bounds(p, facet, v, b);
        f.nearest_m = b[5];
        f.mapped = false;
        bool gone = false;
        for (int o = 0; few && !gone && o < s->occluder_count; o++) {
            if ((hiders >> o & 1) && may_hide(v->bounds[o], b)) {
                try_occluder(p, index, v, o, &f, whole);
                gone = !*whole && bst_polygon_clip_is_empty(&p->clip);
            }
        }
        for (int o = 0; !few && v->cell_item_count < 0 && o < s->occluder_count; o++) {
            if (may_hide(v->bounds[o], b)) {
                try_occluder(p, index, v, o, &f, whole);
            }
        }
        if (!*whole && bst_polygon_clip_is_empty(&p->clip)) {
            return 0.0;
        }
        if (few || v->cell_item_count < 0) {
            continue;
        }
        int stamp = ++p->seen_stamp;
        int x0 = cell_of(v, 0, b[0]), x1 = cell_of(v, 0, b[1]);
        int y0 = cell_of(v, 1, b[2]), y1 = cell_of(v, 1, b[3]);
        for (int y = y0; y <= y1; y++) {
            for (int x = x0; x <= x1; x++) {
                int c = y * v->cells + x;
                for (int i = v->cell_first[c]; i < v->cell_first[c + 1]; i++) {
                    int o = v->cell_items[i];
                    if (p->seen[o] != stamp && may_hide(v->bounds[o], b)) {
                        try_occluder(p, index, v, o, &f, whole);
                    }
                    p->seen[o] = stamp;
                }
            }
        }
    }
    return *whole ? facet->area_m2 : bst_polygon_clip_area(&p->clip);
}
