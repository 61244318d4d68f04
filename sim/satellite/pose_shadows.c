/* What the bodies of a model hide of its facets. */
#include <string.h>

#include "sim/satellite/polygon_cut.h"
#include "sim/satellite/pose_target.h"
#include "sim/satellite/separation.h"

/* Room for the corners of a silhouette that was cut at faces: each cut adds at most one. */
enum { SHADOW_CORNERS = 2 * BST_POLYGON_CORNERS_MAX };

void bst_pose_facet_axes(const bst_satellite_pose *p, int facet, bst_vec3 *origin, bst_vec3 *e1,
                         bst_vec3 *e2) {
    const bst_facet *f = &p->satellite->facets[facet];
    *origin = p->vertices[p->satellite->corner[f->first]];
    *e1 = bst_vec3_perpendicular(p->normals[facet]);
    *e2 = bst_vec3_cross(p->normals[facet], *e1);
}

/* Sets the plane of the facet and starts with all of it. */
static void start(bst_satellite_pose *p, bst_pose_target *t) {
    const bst_satellite *s = p->satellite;
    const bst_facet *facet = &s->facets[t->facet];
    bst_point2 corners[BST_POLYGON_CORNERS_MAX];
    t->whole = false;
    t->normal = p->normals[t->facet];
    bst_pose_facet_axes(p, t->facet, &t->origin, &t->e1, &t->e2);
    for (int i = 0; i < facet->count; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[s->corner[facet->first + i]], t->origin);
        corners[i] = (bst_point2){bst_vec3_dot(r, t->e1), bst_vec3_dot(r, t->e2)};
    }
    bst_polygon_clip_start(&p->clip, corners, facet->count);
}

/* Removes all. */
static void remove_all(bst_satellite_pose *p, bst_pose_target *t) {
    t->whole = false;
    p->clip.piece_count = 0;
}

static bool is_gone(const bst_satellite_pose *p, const bst_pose_target *t) {
    return !t->whole &&
           (t->pieces ? bst_polygon_clip_is_empty(&p->clip) : t->left_count == 0 || t->overflow);
}

/* Coordinates in the facet's plane of a point moved along the view's direction into it. */
static bst_point2 drop(const bst_pose_target *t, const bst_pose_view *v, bst_vec3 q) {
    bst_vec3 r = bst_vec3_sub(q, t->origin);
    double way = bst_vec3_dot(r, t->normal) / bst_vec3_dot(v->z, t->normal);
    r = bst_vec3_axpy(r, -way, v->z);
    return (bst_point2){bst_vec3_dot(r, t->e1), bst_vec3_dot(r, t->e2)};
}

/* Moves a polygon from the view's plane to that of the facet; the projection is affine. */
static void move_to_plane(bst_pose_target *t, const bst_pose_view *v, const bst_point2 *from,
                          int count, bst_point2 *to) {
    if (!t->mapped) {
        bst_point2 x = drop(t, v, v->x), y = drop(t, v, v->y);
        t->zero = drop(t, v, (bst_vec3){0});
        t->x = (bst_point2){x.x - t->zero.x, x.y - t->zero.y};
        t->y = (bst_point2){y.x - t->zero.x, y.y - t->zero.y};
        t->mapped = true;
    }
    const bst_point2 a = t->zero, x = t->x, y = t->y;
    for (int i = 0; i < count; i++) {
        to[i].x = a.x + from[i].x * x.x + from[i].y * y.x;
        to[i].y = a.y + from[i].x * x.y + from[i].y * y.y;
    }
}

/* Subtracts the part of an occluder, which need not be closed, that is in front of the facet's
 * plane.
 *
 * Given:     outline  [corners] its silhouette in the plane */
static void subtract_front(bst_satellite_pose *p, bst_pose_target *t, const bst_pose_view *v,
                           int occluder, const bst_point2 *outline, int corners) {
    const bst_point2 *hull;
    bst_point2 moved[BST_POLYGON_CORNERS_MAX];
    int count = bst_pose_front(p, v, occluder, t->origin, t->normal, &hull);
    if (count == BST_POSE_ALL_IN_FRONT) {
        bst_polygon_clip_subtract(&p->clip, outline, corners, false);
    } else if (count > 0) {
        move_to_plane(t, v, hull, count, moved);
        bst_polygon_clip_subtract(&p->clip, moved, count, false);
    }
}

/* Cuts a polygon of the facet's plane at a face of an occluder that faces the light: what is beyond
 * the face sees the light.
 *
 * Given:     q, n  a point and the normal of the face
 * Returned:  *count  corners that are left, 0: all of the facet is beyond the face
 *            true if the polygon was cut */
static bool cut_at_face(const bst_satellite_pose *p, const bst_pose_target *t, bst_vec3 q,
                        bst_vec3 n, bst_point2 *polygon, int *count) {
    const bst_satellite *s = p->satellite;
    const bst_facet *facet = &s->facets[t->facet];
    double face = bst_vec3_dot(q, n), low = INFINITY, high = -INFINITY, margin = 1e-9 * s->radius_m;
    for (int i = 0; i < facet->count; i++) {
        double d = bst_vec3_dot(p->vertices[s->corner[facet->first + i]], n) - face;
        low = d < low ? d : low;
        high = d > high ? d : high;
    }
    if (low >= -margin) {
        *count = 0;
        return true;
    }
    if (high <= 0.0) {
        return false;
    }
    bst_point2 slope = {bst_vec3_dot(t->e1, n), bst_vec3_dot(t->e2, n)};
    double level = bst_vec3_dot(t->origin, n) - face,
           length2 = slope.x * slope.x + slope.y * slope.y;
    /* a point of the line, and one along it with the inside to its left */
    bst_point2 a = {-level * slope.x / length2, -level * slope.y / length2};
    bst_point2 b = {a.x - slope.y, a.y + slope.x};
    *count = bst_polygon_cut(polygon, *count, a, b, SHADOW_CORNERS);
    return true;
}

/* Subtracts an occluder that may be in front of and behind the facet's plane. A ray from a point
 * within its silhouette meets it unless the point is beyond one of its faces that face the light:
 * the ray leaves the body last through one of them. */
static void subtract_by_faces(bst_satellite_pose *p, bst_pose_target *t, const bst_pose_view *v,
                              const bst_occluder *o, bst_polygon_place place, bst_point2 *polygon,
                              int count) {
    const bst_satellite *s = p->satellite;
    bool cut = false;
    for (int f = o->first_facet; f < o->first_facet + o->facet_count && count > 0; f++) {
        if (!s->facets[f].inside && bst_vec3_dot(p->normals[f], v->z) > 0.0) {
            bst_vec3 q = p->vertices[s->corner[s->facets[f].first]];
            cut |= cut_at_face(p, t, q, p->normals[f], polygon, &count);
        }
    }
    if (count > 0 && o->shell >= 0) {
        bst_vec3 axis = bst_pose_shell_axis(p, o->shell);
        if (bst_vec3_dot(axis, v->z) > 0.0) {
            bst_vec3 q = p->vertices[s->shells[o->shell].first_rim];
            cut |= cut_at_face(p, t, q, axis, polygon, &count);
        }
    }
    if (!cut && place == BST_POLYGON_WITHIN) {
        remove_all(p, t);
    } else if (count >= 3) {
        bst_polygon_clip_subtract(&p->clip, polygon, count, false);
    }
}

/* Subtracts an occluder's silhouette from the facet. */
static void subtract(bst_satellite_pose *p, bst_pose_target *t, int view, int occluder) {
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    const bst_occluder *o = &s->occluders[occluder];
    const bst_point2 *outline;
    int n = bst_pose_outline(p, view, occluder, &outline), corners = s->facets[t->facet].count;
    bst_polygon_place place = bst_polygon_place_of(t->seen, corners, outline, n);
    if (place == BST_POLYGON_APART) {
        return;
    }
    bst_vec3 axis;
    /* where bodies are separate, the ray leads toward this one: see bst_pose_look; all of what is
     * nearer to the light than the whole facet is in front of it, where it matters */
    bool front =
        v->bounds[occluder][4] >= t->bounds[5] || bst_separation(p, t->body, occluder, &axis);
    if (front && place == BST_POLYGON_WITHIN) {
        remove_all(p, t);
        return;
    }
    if (t->whole) {
        start(p, t);
    }
    bst_point2 moved[SHADOW_CORNERS];
    if (n > BST_POLYGON_CORNERS_MAX) {
        return; /* more corners than polygons may have: it casts no partial shadow */
    }
    move_to_plane(t, v, outline, n, moved);
    if (front) {
        bst_polygon_clip_subtract(&p->clip, moved, n, false);
    } else if (o->closed || o->vertex_count > BST_POLYGON_CORNERS_MAX) {
        subtract_by_faces(p, t, v, o, place, moved, n);
    } else {
        subtract_front(p, t, v, occluder, moved, n);
    }
}

/* True if all corners of a facet of a shell are known to send light out through its rim. */
static bool is_free(const bst_satellite_pose *p, const bst_pose_target *t, const bst_pose_view *v,
                    int shell) {
    const bst_facet *facet = &p->satellite->facets[t->facet];
    bool free = p->satellite->occluders[t->body].shell == shell;
    for (int i = 0; i < facet->count && free; i++) {
        free = v->within_rim[p->satellite->corner[facet->first + i]];
    }
    return free;
}

/* Keeps what light reaches through the rim of a shell. */
static void look_through_rim(bst_satellite_pose *p, bst_pose_target *t, int view, int index) {
    const bst_shell *shell = &p->satellite->shells[index];
    const bst_pose_view *v = &p->views[view];
    const bst_facet *facet = &p->satellite->facets[t->facet];
    if (!(bst_vec3_dot(bst_pose_shell_axis(p, index), v->z) > 0.0)) {
        remove_all(p, t);
        return;
    }
    const bst_point2 *outline = v->flat + shell->first_rim;
    bst_polygon_place place =
        is_free(p, t, v, index)
            ? BST_POLYGON_WITHIN
            : bst_polygon_place_of(t->seen, facet->count, outline, shell->rim_count);
    if (place == BST_POLYGON_WITHIN) {
        return;
    }
    if (place == BST_POLYGON_APART) {
        remove_all(p, t);
        return;
    }
    if (t->whole) {
        start(p, t);
    }
    bst_point2 moved[BST_POLYGON_CORNERS_MAX];
    move_to_plane(t, v, outline, shell->rim_count, moved);
    bst_polygon_clip_intersect(&p->clip, moved, shell->rim_count);
}

bst_vec3 bst_pose_middle_of(const bst_satellite_pose *p, const bst_facet *facet) {
    bst_vec3 middle = {0};
    for (int i = 0; i < facet->count; i++) {
        bst_vec3 q = p->vertices[p->satellite->corner[facet->first + i]];
        middle = bst_vec3_axpy(middle, 1.0 / facet->count, q);
    }
    return middle;
}

bool bst_pose_is_inside_shell(const bst_satellite_pose *p, bst_vec3 point, const bst_shell *shell) {
    if (shell->joint >= 0) {
        point = bst_mat3_transpose_mul_vec(&p->rotation[shell->joint],
                                           bst_vec3_sub(point, p->origin[shell->joint]));
    }
    bst_vec3 r = bst_vec3_sub(point, shell->apex_m);
    double z = bst_vec3_dot(r, shell->axis);
    double across2 = bst_vec3_dot(r, r) - z * z;
    return z < shell->depth_m && z > shell->depth_m * across2 / (shell->radius_m * shell->radius_m);
}

/* Removes what an occluder hides, if its bounds meet those of the facet. */
static void try_occluder(bst_satellite_pose *p, bst_pose_target *t, int view, int occluder) {
    const bst_facet *own = &p->satellite->facets[t->facet];
    int shell = p->satellite->occluders[occluder].shell;
    if ((occluder == own->occluder && !own->inside) ||
        !bst_pose_may_hide(p->views[view].bounds[occluder], t->bounds)) {
        return;
    }
    bool rim = shell >= 0 && (occluder == own->occluder ||
                              bst_pose_is_inside_shell(p, bst_pose_middle_of(p, own),
                                                       &p->satellite->shells[shell]));
    if (rim && t->pieces) {
        look_through_rim(p, t, view, shell);
    } else if (rim) {
        bst_pose_area_through_rim(p, t, view, shell, is_free(p, t, &p->views[view], shell));
    } else if (t->pieces) {
        subtract(p, t, view, occluder);
    } else {
        bst_pose_area_subtract(p, t, view, occluder);
    }
}

/* Corners and bounds of the facet in a view. */
static void set_view(const bst_satellite_pose *p, bst_pose_target *t, const bst_pose_view *v) {
    const bst_facet *facet = &p->satellite->facets[t->facet];
    double bounds[6]; /* apart from what is stored, so that they stay in registers */
    t->mapped = false;
    bst_pose_start_bounds(bounds);
    for (int i = 0; i < facet->count; i++) {
        int vertex = p->satellite->corner[facet->first + i];
        t->seen[i] = v->flat[vertex];
        bst_pose_add_to_bounds(v, vertex, bounds);
    }
    memcpy(t->bounds, bounds, sizeof bounds);
}

/* Tries the occluders of the cells of the view's grid that the facet meets. */
static void try_cells(bst_satellite_pose *p, bst_pose_target *t, int view) {
    const bst_pose_view *v = &p->views[view];
    int stamp = ++p->seen_stamp;
    int x0 = bst_pose_cell(v, 0, t->bounds[0]), x1 = bst_pose_cell(v, 0, t->bounds[1]);
    int y0 = bst_pose_cell(v, 1, t->bounds[2]), y1 = bst_pose_cell(v, 1, t->bounds[3]);
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            int c = y * v->cells + x;
            for (int i = v->cell_first[c]; i < v->cell_first[c + 1]; i++) {
                int o = v->cell_items[i];
                if (p->seen[o] != stamp && !is_gone(p, t)) {
                    try_occluder(p, t, view, o);
                }
                p->seen[o] = stamp;
            }
        }
    }
}

/* Removes what the first views do not see of a facet. */
static void remove_hidden(bst_satellite_pose *p, bst_pose_target *t, int views) {
    const bst_satellite *s = p->satellite;
    bool few = s->occluder_count <= BST_SEPARATION_BODIES;
    const bst_facet *facet = &s->facets[t->facet];
    for (int k = 0; k < views && !is_gone(p, t); k++) {
        const bst_pose_view *v = &p->views[k];
        uint64_t hiders = few ? v->hiders[facet->occluder] : 0;
        if (few && !facet->inside) {
            hiders &= ~((uint64_t)1 << facet->occluder);
        }
        if (few && hiders == 0) {
            continue;
        }
        set_view(p, t, v);
        if (!few && v->cell_item_count >= 0) {
            try_cells(p, t, k);
            continue;
        }
        for (int o = 0; few && hiders && !is_gone(p, t); o++, hiders >>= 1) {
            if (hiders & 1) {
                try_occluder(p, t, k, o);
            }
        }
        for (int o = 0; !few && o < s->occluder_count && !is_gone(p, t); o++) {
            try_occluder(p, t, k, o);
        }
    }
}

double bst_pose_unshadowed(bst_satellite_pose *p, int index, int views, bool *whole) {
    const bst_facet *facet = &p->satellite->facets[index];
    bst_pose_target t;
    t.facet = index;
    t.body = facet->occluder;
    t.pieces = t.whole = true;
    remove_hidden(p, &t, views);
    *whole = t.whole;
    return t.whole ? facet->area_m2 : bst_polygon_clip_area(&p->clip);
}

double bst_pose_unshadowed_area(bst_satellite_pose *p, int index, int views) {
    const bst_facet *facet = &p->satellite->facets[index];
    bst_pose_target t;
    t.facet = index;
    t.body = facet->occluder;
    t.pieces = t.overflow = false;
    t.whole = true;
    remove_hidden(p, &t, views);
    if (t.whole) {
        return facet->area_m2;
    }
    double area = t.overflow ? -1.0 : bst_pose_area_left(p, &t);
    bool whole;
    return area >= 0.0 ? area : bst_pose_unshadowed(p, index, views, &whole);
}
