#include "sim/satellite/separation.h"

#include "sim/satellite/pose_view.h"

/* Lowest and highest coordinate of a body along an axis. */
static void range_of(const bst_satellite_pose *p, const bst_occluder *o, bst_vec3 axis, double *low,
                     double *high) {
    *low = INFINITY;
    *high = -INFINITY;
    for (int i = 0; i < o->vertex_count; i++) {
        double x = bst_vec3_dot(p->vertices[o->first_vertex + i], axis);
        *low = x < *low ? x : *low;
        *high = x > *high ? x : *high;
    }
}

/* True if an axis separates two bodies; turns it so that it leads from a to b. */
static bool separates(const bst_satellite_pose *p, int a, int b, bst_vec3 *axis) {
    const bst_satellite *s = p->satellite;
    double a_low, a_high, b_low, b_high, margin = 1e-9 * s->radius_m;
    range_of(p, &s->occluders[a], *axis, &a_low, &a_high);
    range_of(p, &s->occluders[b], *axis, &b_low, &b_high);
    if (b_high <= a_low + margin) {
        *axis = bst_vec3_scale(*axis, -1.0);
        return true;
    }
    return a_high <= b_low + margin;
}

static bst_vec3 centre_of(const bst_satellite_pose *p, const bst_occluder *o) {
    bst_vec3 sum = {0};
    for (int i = 0; i < o->vertex_count; i++) {
        sum = bst_vec3_axpy(sum, 1.0 / o->vertex_count, p->vertices[o->first_vertex + i]);
    }
    return sum;
}

/* Tries the faces of a body, and the axis of a shell. */
static bool try_faces(const bst_satellite_pose *p, int of, int a, int b, bst_vec3 *axis) {
    const bst_satellite *s = p->satellite;
    for (int i = 0; i < BST_SEPARATION_FACES && p->faces[of][i] >= 0; i++) {
        *axis = p->normals[p->faces[of][i]];
        if (separates(p, a, b, axis)) {
            return true;
        }
    }
    int shell = s->occluders[of].shell;
    if (shell >= 0) {
        *axis = bst_pose_shell_axis(p, shell);
        return separates(p, a, b, axis);
    }
    return false;
}

bool bst_separation(bst_satellite_pose *p, int a, int b, bst_vec3 *axis) {
    const bst_satellite *s = p->satellite;
    int n = s->occluder_count;
    if (!p->pairs) {
        return false;
    }
    bst_pose_pair *pair = &p->pairs[a * n + b];
    int a_joint = s->vertex_joint[s->occluders[a].first_vertex];
    int b_joint = s->vertex_joint[s->occluders[b].first_vertex];
    bool known = a_joint == b_joint && a_joint < 0 ? pair->stamp > 0 : pair->stamp == p->stamp;
    if (!known) {
        bst_vec3 line =
            bst_vec3_sub(centre_of(p, &s->occluders[b]), centre_of(p, &s->occluders[a]));
        pair->stamp = p->stamp;
        pair->separate = try_faces(p, a, a, b, &pair->axis) || try_faces(p, b, a, b, &pair->axis);
        if (!pair->separate && bst_vec3_norm(line) > 0.0) {
            pair->axis = bst_vec3_unit(line);
            pair->separate = separates(p, a, b, &pair->axis);
        }
    }
    *axis = pair->axis;
    return pair->separate;
}
