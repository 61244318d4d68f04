/* Areas of what is left of facets in shadow, without its pieces.
 *
 * Each facet has coordinates of its own: its corner 0 is the origin, and two others are (1, 0) and
 * (0, 1). A parallel projection is affine, so that the half planes of a silhouette in a view become
 * half planes in these coordinates by three products each. Of a silhouette of some fifty sides only
 * the few count that cross the facet. */
#include <string.h>

#include "sim/satellite/pose_target.h"
#include "sim/satellite/separation.h"

/* Sides of a silhouette that cross a facet, at most. */
enum { SIDES = BST_POLYGON_CORNERS_MAX + BST_HALF_PLANES };

/* Starts with all of the facet. */
static void start(bst_satellite_pose *p, bst_pose_target *t) {
    const bst_facet *facet = &p->satellite->facets[t->facet];
    t->whole = false;
    t->left_count = facet->count;
    memcpy(t->left, p->plane + facet->first, (size_t)facet->count * sizeof *t->left);
    bst_polygon_covers_clear(&p->covers);
}

static void remove_all(bst_satellite_pose *p, bst_pose_target *t) {
    t->whole = false;
    t->left_count = 0;
    bst_polygon_covers_clear(&p->covers);
}

/* A half plane of the view in the coordinates of the facet. */
static bst_half_plane in_plane(const bst_satellite_pose *p, const bst_pose_target *t,
                               const bst_half_planes *sides, int index) {
    const bst_half_planes *s = &sides[index / BST_HALF_PLANES];
    int lane = index % BST_HALF_PLANES;
    double u = s->u[lane], v = s->v[lane];
    bst_point2 a = t->seen[0], b = t->seen[p->plane_corner[t->facet][0]],
               c = t->seen[p->plane_corner[t->facet][1]];
    return (bst_half_plane){u * (b.x - a.x) + v * (b.y - a.y), u * (c.x - a.x) + v * (c.y - a.y),
                            u * a.x + v * a.y + s->w[lane]};
}

/* Adds half planes of the view to the next cover. */
static void add_sides(bst_satellite_pose *p, bst_pose_target *t, const bst_half_planes *sides,
                      const int *indices, int count) {
    for (int i = 0; i < count; i++) {
        t->overflow |= !bst_polygon_covers_add(&p->covers, in_plane(p, t, sides, indices[i]));
    }
}

/* Sides of a silhouette that cross a facet from which on its corners are worth moving. */
enum { MANY_SIDES = 12 };

/* Gives the next cover the corners of a silhouette, in the coordinates of the facet. */
static void add_corners(bst_satellite_pose *p, const bst_pose_target *t, int view, int occluder) {
    static const double EDGE_ON = 1e-6; /* area over that of the square of its sides */
    bst_point2 a = t->seen[0], b = t->seen[p->plane_corner[t->facet][0]],
               c = t->seen[p->plane_corner[t->facet][1]];
    double bx = b.x - a.x, by = b.y - a.y, cx = c.x - a.x, cy = c.y - a.y, area = bx * cy - by * cx;
    const bst_point2 *outline;
    int count = bst_pose_outline(p, view, occluder, &outline);
    if (!(area > EDGE_ON * (bx * bx + by * by + cx * cx + cy * cy))) {
        return;
    }
    bst_point2 *to = bst_polygon_covers_corners(&p->covers, count);
    double per_area = 1.0 / area;
    for (int i = 0; i < count && to; i++) {
        double x = outline[i].x - a.x, y = outline[i].y - a.y;
        to[i] = (bst_point2){(x * cy - y * cx) * per_area, (bx * y - by * x) * per_area};
    }
}

/* Limits the next cover to what is behind a face of an occluder that faces the light.
 *
 * Given:     q, n  a point and the normal of the face
 * Returned:  false: nothing of the facet is behind it */
static bool add_face(bst_satellite_pose *p, bst_pose_target *t, bst_vec3 q, bst_vec3 n) {
    const bst_satellite *s = p->satellite;
    const int *corner = s->corner + s->facets[t->facet].first;
    double face = bst_vec3_dot(q, n), low = INFINITY, high = -INFINITY;
    for (int i = 0; i < s->facets[t->facet].count; i++) {
        double d = bst_vec3_dot(p->vertices[corner[i]], n) - face;
        low = d < low ? d : low;
        high = d > high ? d : high;
    }
    if (low >= -1e-9 * s->radius_m) {
        return false;
    }
    if (high > 0.0) {
        const int *axis = p->plane_corner[t->facet];
        double zero = bst_vec3_dot(p->vertices[corner[0]], n) - face;
        double one = bst_vec3_dot(p->vertices[corner[axis[0]]], n) - face;
        double two = bst_vec3_dot(p->vertices[corner[axis[1]]], n) - face;
        t->overflow |=
            !bst_polygon_covers_add(&p->covers, (bst_half_plane){zero - one, zero - two, -zero});
    }
    return true;
}

/* Limits the next cover to what is behind all faces of an occluder that may be in front of and
 * behind the facet's plane. A ray from a point within its silhouette meets it unless the point is
 * beyond one of its faces that face the light: the ray leaves the body last through one of them.
 * False: nothing of the facet is. */
static bool add_faces(bst_satellite_pose *p, bst_pose_target *t, const bst_pose_view *v,
                      const bst_occluder *o) {
    const bst_satellite *s = p->satellite;
    for (int f = o->first_facet; f < o->first_facet + o->facet_count; f++) {
        if (!s->facets[f].inside && bst_vec3_dot(p->normals[f], v->z) > 0.0) {
            bst_vec3 q = p->vertices[s->corner[s->facets[f].first]];
            if (!add_face(p, t, q, p->normals[f])) {
                return false;
            }
        }
    }
    if (o->shell < 0) {
        return true;
    }
    bst_vec3 axis = bst_pose_shell_axis(p, o->shell);
    return !(bst_vec3_dot(axis, v->z) > 0.0) ||
           add_face(p, t, p->vertices[s->shells[o->shell].first_rim], axis);
}

/* Sides of the silhouette of what of an occluder, which need not be closed, is in front of the
 * facet's plane. Returned: number of blocks; 0: nothing is. */
static int front_sides(bst_satellite_pose *p, bst_pose_target *t, int view, int occluder,
                       const bst_half_planes **sides) {
    const bst_facet *facet = &p->satellite->facets[t->facet];
    bst_vec3 origin = p->vertices[p->satellite->corner[facet->first]];
    const bst_point2 *hull;
    int count = bst_pose_front(p, &p->views[view], occluder, origin, p->normals[t->facet], &hull);
    if (count == BST_POSE_ALL_IN_FRONT) {
        return bst_pose_sides(p, view, occluder, sides);
    }
    *sides = p->sides;
    return bst_half_planes_of(hull, count, p->sides);
}

void bst_pose_area_subtract(bst_satellite_pose *p, bst_pose_target *t, int view, int occluder) {
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    const bst_occluder *o = &s->occluders[occluder];
    const bst_half_planes *sides;
    int crossing[SIDES], blocks = bst_pose_sides(p, view, occluder, &sides);
    int corners = s->facets[t->facet].count;
    if (blocks == 0) {
        if (v->outline_count[occluder] > BST_POLYGON_CORNERS_MAX) {
            t->whole = false;
            t->overflow = true; /* more corners than half planes can be: pieces are used */
        }
        return;
    }
    int count = bst_half_planes_crossing(sides, blocks, t->seen, corners, t->bounds, crossing);
    if (count == BST_HALF_PLANES_APART) {
        return;
    }
    bst_vec3 axis;
    /* where bodies are separate, the ray leads toward this one: see bst_pose_look; all of what is
     * nearer to the light than the whole facet is in front of it, where it matters */
    bool front =
        v->bounds[occluder][4] >= t->bounds[5] || bst_separation(p, t->body, occluder, &axis);
    bool by_faces = !front && (o->closed || o->vertex_count > BST_POLYGON_CORNERS_MAX);
    if (!front && !by_faces) {
        blocks = front_sides(p, t, view, occluder, &sides);
        count = blocks == 0 ? BST_HALF_PLANES_APART
                            : bst_half_planes_crossing(sides, blocks, t->seen, corners, t->bounds,
                                                       crossing);
        if (count == BST_HALF_PLANES_APART) {
            return;
        }
    }
    if (t->whole) {
        start(p, t);
    }
    bst_polygon_covers_restart(&p->covers);
    add_sides(p, t, sides, crossing, count);
    if (count >= MANY_SIDES && (front || by_faces)) {
        add_corners(p, t, view, occluder);
    }
    if (by_faces && !add_faces(p, t, v, o)) {
        bst_polygon_covers_restart(&p->covers);
        return;
    }
    if (p->covers.pending == 0) {
        remove_all(p, t);
        return;
    }
    t->overflow |= !bst_polygon_covers_end(&p->covers);
}

void bst_pose_area_through_rim(bst_satellite_pose *p, bst_pose_target *t, int view, int index,
                               bool free) {
    const bst_shell *shell = &p->satellite->shells[index];
    const bst_pose_view *v = &p->views[view];
    const bst_facet *facet = &p->satellite->facets[t->facet];
    if (!(bst_vec3_dot(bst_pose_shell_axis(p, index), v->z) > 0.0)) {
        remove_all(p, t);
        return;
    }
    if (free) {
        return;
    }
    int crossing[SIDES];
    int blocks = bst_half_planes_of(v->flat + shell->first_rim, shell->rim_count, p->sides);
    int count =
        bst_half_planes_crossing(p->sides, blocks, t->seen, facet->count, t->bounds, crossing);
    if (count == BST_HALF_PLANES_APART) {
        remove_all(p, t);
        return;
    }
    if (count == 0) {
        return;
    }
    if (t->whole) {
        start(p, t);
    }
    if (t->left_count + count > 2 * BST_POLYGON_CORNERS_MAX) {
        t->overflow = true;
        return;
    }
    bst_half_plane kept[SIDES];
    bst_point2 out[2 * BST_POLYGON_CORNERS_MAX];
    bool cut;
    for (int i = 0; i < count; i++) {
        kept[i] = in_plane(p, t, p->sides, crossing[i]);
    }
    t->left_count = bst_polygon_keep(t->left, t->left_count, kept, count, out, &cut);
    memcpy(t->left, out, (size_t)t->left_count * sizeof *out);
}

double bst_pose_area_left(const bst_satellite_pose *p, const bst_pose_target *t) {
    const bst_facet *facet = &p->satellite->facets[t->facet];
    if (t->left_count == 0) {
        return 0.0;
    }
    double area = bst_polygon_uncovered_area(&p->covers, t->left, t->left_count);
    return area <= 0.0
               ? area
               : facet->area_m2 * (area / bst_polygon_area(p->plane + facet->first, facet->count));
}
