/* What of a body is in front of a plane, as seen in a view. */
#include <math.h>

#include "sim/satellite/pose.h"

int bst_pose_front(bst_satellite_pose *p, const bst_pose_view *v, int occluder, bst_vec3 point,
                   bst_vec3 normal, const bst_point2 **hull) {
    const bst_satellite *s = p->satellite;
    const bst_occluder *o = &s->occluders[occluder];
    double low = INFINITY, high = -INFINITY, margin_m = 1e-9 * s->radius_m;
    int n = 0;
    for (int i = 0; i < o->vertex_count; i++) {
        bst_vec3 q = p->vertices[o->first_vertex + i];
        double height = bst_vec3_dot(normal, bst_vec3_sub(q, point));
        low = height < low ? height : low;
        high = height > high ? height : high;
        if (height >= 0.0) {
            p->front[n++] = v->flat[o->first_vertex + i];
        }
    }
    if (high <= margin_m) {
        return 0;
    }
    if (low >= -margin_m) {
        return BST_POSE_ALL_IN_FRONT;
    }
    for (int e = 0; e < o->edge_count; e++) {
        const int *edge = s->edges[o->first_edge + e];
        bst_vec3 from = p->vertices[edge[0]], to = p->vertices[edge[1]];
        double a = bst_vec3_dot(normal, bst_vec3_sub(from, point));
        double b = bst_vec3_dot(normal, bst_vec3_sub(to, point));
        if ((a < 0.0) != (b < 0.0)) {
            bst_vec3 q = bst_vec3_axpy(from, a / (a - b), bst_vec3_sub(to, from));
            p->front[n++] = (bst_point2){bst_vec3_dot(q, v->x), bst_vec3_dot(q, v->y)};
        }
    }
    int corners = bst_polygon_hull(p->front, n, p->front_hull);
    *hull = p->front_hull;
    return corners >= 3 && corners <= BST_POLYGON_CORNERS_MAX ? corners : 0;
}
