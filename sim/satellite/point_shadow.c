#include "sim/satellite/point_shadow.h"

#include <math.h>

#include "sim/satellite/separation.h"

/* True if a point is within a convex polygon, counter-clockwise. */
static bool is_within(const bst_point2 *p, int count, double x, double y) {
    for (int i = 0; i < count; i++) {
        bst_point2 a = p[i], b = p[i + 1 < count ? i + 1 : 0];
        if ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x) < 0.0) {
            return false;
        }
    }
    return count >= 3;
}

/* True if a plane face of a body shows that a ray from a point leads away from it. */
static bool leads_away(const bst_satellite_pose *p, int body, bst_vec3 point, bst_vec3 direction) {
    for (int i = 0; p->faces && i < BST_SEPARATION_FACES && p->faces[body][i] >= 0; i++) {
        int face = p->faces[body][i];
        bst_vec3 n = p->normals[face];
        bst_vec3 corner = p->vertices[p->satellite->corner[p->satellite->facets[face].first]];
        double before_m = bst_vec3_dot(n, bst_vec3_sub(point, corner));
        if (before_m > -1e-9 * p->satellite->radius_m && bst_vec3_dot(n, direction) > 0.0) {
            return true;
        }
    }
    return false;
}

bool bst_point_is_shadowed(bst_satellite_pose *p, int view, int own, bst_vec3 point) {
    const bst_satellite *s = p->satellite;
    const bst_pose_view *v = &p->views[view];
    double x = bst_vec3_dot(point, v->x), y = bst_vec3_dot(point, v->y);
    double z = bst_vec3_dot(point, v->z);
    bool few = s->occluder_count <= BST_SEPARATION_BODIES;
    for (int o = 0; o < s->occluder_count; o++) {
        const double *b = v->bounds[o];
        if (o == own || (few && !(v->hiders[own] >> o & 1)) || x < b[0] || x > b[1] || y < b[2] ||
            y > b[3] || z > b[5]) {
            continue;
        }
        const bst_point2 *outline;
        bst_vec3 axis;
        int n = bst_pose_outline(p, view, o, &outline);
        /* where bodies are separate, rays lead toward this one: see bst_pose_look */
        if (is_within(outline, n, x, y) &&
            (bst_separation(p, own, o, &axis) || !leads_away(p, o, point, v->z))) {
            return true;
        }
    }
    return false;
}
