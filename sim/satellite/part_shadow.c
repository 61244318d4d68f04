#include "sim/satellite/part_shadow.h"

#include <math.h>

#include "sim/satellite/pose_view.h"
#include "sim/satellite/separation.h"

/* Parts reach beyond the corners of their facet by less than this share of the facet's size. */
static const double BEYOND = 0.1;
/* Sides of the polygon with the area of a rim's circle. */
enum { RIM_SIDES = 96 };
/* Corners of parts at a rim are beyond its circle by this share at most: of parts of 0.05 rad, so
 * that their polygon has the area of the circle, by 2.1e-4. */
static const double BESIDE_RIM = 3e-4;

bool bst_part_shadow_hiders(bst_satellite_pose *p, int view, int facet, uint64_t *hiders) {
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    const bst_facet *f = &s->facets[facet];
    *hiders = 0;
    if (s->occluder_count > BST_SEPARATION_BODIES) {
        return false;
    }
    double e[6]; /* bounds of the facet */
    bst_pose_start_bounds(e);
    for (int i = 0; i < f->count; i++) {
        bst_pose_add_to_bounds(v, s->corner[f->first + i], e);
    }
    double room = fmax(fmax(e[1] - e[0], e[3] - e[2]), e[5] - e[4]) * BEYOND;
    for (int o = 0; o < s->occluder_count; o++) {
        const double *b = v->bounds[o];
        if (!(v->hiders[f->occluder] >> o & 1) || (o == f->occluder && !f->inside) ||
            b[0] > e[1] + room || b[1] < e[0] - room || b[2] > e[3] + room || b[3] < e[2] - room ||
            b[5] < e[4] - room) {
            continue;
        }
        bst_vec3 axis;
        if (o != f->occluder && s->occluders[o].shell >= 0 &&
            !bst_separation(p, f->occluder, o, &axis)) {
            return false;
        }
        *hiders |= (uint64_t)1 << o;
    }
    return true;
}

/* Keeps what light reaches through the rim of the shell that the part is in: a circle, as the parts
 * are those of the round surface. The rim of the model's facets would take from parts beside it. */
static void look_through_rim(bst_satellite_pose *p, const bst_pose_view *v, int index,
                             const bst_vec3 *corner, int count) {
    bst_pose_rim rim = bst_pose_rim_of(p, v, index);
    double radius_m = p->satellite->shells[index].radius_m;
    bool within = rim.rate > 0.0;
    rim.inner_m = (1.0 + BESIDE_RIM) * radius_m;
    for (int i = 0; i < count && within; i++) {
        within = bst_pose_is_within_rim(v, &rim, corner[i]);
    }
    if (within) {
        return;
    }
    if (!(rim.rate > 0.0)) {
        p->clip.piece_count = 0;
        return;
    }
    bst_point2 circle[RIM_SIDES];
    bst_vec3 x = bst_vec3_perpendicular(rim.axis), y = bst_vec3_cross(rim.axis, x);
    double side = 2.0 * BST_PI / RIM_SIDES, r = radius_m * sqrt(side / sin(side));
    for (int i = 0; i < RIM_SIDES; i++) {
        bst_vec3 q = bst_vec3_axpy(rim.centre, r * cos(side * i), x);
        q = bst_vec3_axpy(q, r * sin(side * i), y);
        circle[i] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
    }
    bst_polygon_clip_intersect(&p->clip, circle, RIM_SIDES);
}

double bst_part_shadow_lit(bst_satellite_pose *p, int view, int facet, uint64_t hiders,
                           const bst_vec3 *corner, int count, bst_point2 *flat) {
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    const bst_facet *f = &s->facets[facet];
    bst_point2 start[BST_POLYGON_CORNERS_MAX];
    int left = 0, quarter = count / 4;
    for (int i = 0; i < count; i++) {
        flat[i] = (bst_point2){bst_vec3_dot(corner[i], v->x), bst_vec3_dot(corner[i], v->y)};
    }
    double area = bst_polygon_area(flat, count);
    for (int i = 0; i < count; i++) { /* counter-clockwise, without corners that are the same */
        bst_point2 q = flat[area < 0.0 ? count - 1 - i : i];
        if (left == 0 || q.x != start[left - 1].x || q.y != start[left - 1].y) {
            start[left++] = q;
        }
    }
    bst_vec3 normal = bst_vec3_cross(bst_vec3_sub(corner[2 * quarter], corner[0]),
                                     bst_vec3_sub(corner[3 * quarter], corner[quarter]));
    normal = bst_vec3_dot(normal, v->z) < 0.0 ? bst_vec3_scale(normal, -1.0) : normal;
    bst_polygon_clip_start(&p->clip, start, left);
    for (int o = 0; o < s->occluder_count && hiders >> o > 0; o++) {
        if (!(hiders >> o & 1)) {
            continue;
        }
        if (o == f->occluder) {
            look_through_rim(p, v, s->occluders[o].shell, corner, count);
            continue;
        }
        /* where bodies are separate, rays lead toward this one: see bst_pose_look */
        bst_vec3 axis;
        const bst_point2 *outline = NULL;
        int n = BST_POSE_ALL_IN_FRONT;
        if (!bst_separation(p, f->occluder, o, &axis)) {
            n = bst_pose_front(p, v, o, corner[0], normal, &outline);
        }
        n = n == BST_POSE_ALL_IN_FRONT ? bst_pose_outline(p, view, o, &outline) : n;
        bst_polygon_clip_subtract(&p->clip, outline, n <= BST_POLYGON_CORNERS_MAX ? n : 0, false);
    }
    double lit = bst_polygon_clip_area(&p->clip), whole = fabs(area);
    return lit > (1.0 - 1e-9) * whole ? 1.0 : lit > 1e-9 * whole ? lit / whole : 0.0;
}
