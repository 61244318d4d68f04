/* Bounds of bodies and facets in a view of a pose. Internal to sim/satellite. */
#ifndef BST_SATELLITE_POSE_VIEW_H
#define BST_SATELLITE_POSE_VIEW_H

#include "sim/satellite/pose.h"

/* Cell of a coordinate, clamped to the view's grid. */
static inline int bst_pose_cell(const bst_pose_view *v, int axis, double x) {
    double c = (x - v->origin[axis]) * v->step[axis];
    return c < 1.0 ? 0 : c >= v->cells ? v->cells - 1 : (int)c;
}

/* True if an occluder may hide a part of a facet, by the bounds of both. One branch for all
 * comparisons: none of them is likely. */
static inline bool bst_pose_may_hide(const double occluder[6], const double facet[6]) {
    return (occluder[0] < facet[1]) & (occluder[1] > facet[0]) & (occluder[2] < facet[3]) &
           (occluder[3] > facet[2]) & (occluder[5] > facet[4]);
}

/* Empty bounds. */
static inline void bst_pose_start_bounds(double b[6]) {
    b[0] = b[2] = b[4] = INFINITY;
    b[1] = b[3] = b[5] = -INFINITY;
}

/* Extends bounds to a vertex. */
static inline void bst_pose_add_to_bounds(const bst_pose_view *v, int vertex, double b[6]) {
    double c[3] = {v->flat[vertex].x, v->flat[vertex].y, v->depth_m[vertex]};
    for (int a = 0; a < 3; a++) {
        b[2 * a] = c[a] < b[2 * a] ? c[a] : b[2 * a];
        b[2 * a + 1] = c[a] > b[2 * a + 1] ? c[a] : b[2 * a + 1];
    }
}

/* Half planes of an occluder's silhouette in a view, along its x and y. Returned: number of blocks
 * (bst_half_planes_of); 0: too many corners. They belong to the pose, for a model with many
 * occluders until the next call. */
int bst_pose_sides(bst_satellite_pose *pose, int view, int occluder, const bst_half_planes **sides);

/* A direction in a joint's frame, turned to the body frame; joint below 0: they are one. */
static inline bst_vec3 bst_pose_turned(const bst_satellite_pose *p, int joint, bst_vec3 direction) {
    return joint >= 0 ? bst_mat3_mul_vec(&p->rotation[joint], direction) : direction;
}

/* Likewise a direction in the body frame, turned to the joint's. */
static inline bst_vec3 bst_pose_turned_back(const bst_satellite_pose *p, int joint,
                                            bst_vec3 direction) {
    return joint >= 0 ? bst_mat3_transpose_mul_vec(&p->rotation[joint], direction) : direction;
}

/* Likewise a point in a joint's frame, moved to the body frame. */
static inline bst_vec3 bst_pose_moved(const bst_satellite_pose *p, int joint, bst_vec3 point) {
    return joint >= 0 ? bst_vec3_add(p->origin[joint], bst_mat3_mul_vec(&p->rotation[joint], point))
                      : point;
}

/* Middle of a facet's corners. */
bst_vec3 bst_pose_middle_of(const bst_satellite_pose *pose, const bst_facet *facet);

/* True if a point of the body frame is inside a shell. */
bool bst_pose_is_inside_shell(const bst_satellite_pose *pose, bst_vec3 point,
                              const bst_shell *shell);

/* Axis of a shell, body frame. */
static inline bst_vec3 bst_pose_shell_axis(const bst_satellite_pose *p, int shell) {
    const bst_shell *s = &p->satellite->shells[shell];
    return bst_pose_turned(p, s->joint, s->axis);
}

/* The rim of a shell in a view. */
typedef struct bst_pose_rim {
    bst_vec3 centre, axis; /* body frame; axis: unit, outward */
    double rate;           /* scalar product of axis and view: above 0 if rays leave by the rim */
    double inner_m;        /* radius of the circle within the rim's polygon */
} bst_pose_rim;

static inline bst_pose_rim bst_pose_rim_of(const bst_satellite_pose *p, const bst_pose_view *v,
                                           int index) {
    const bst_shell *shell = &p->satellite->shells[index];
    bst_vec3 centre = bst_vec3_axpy(shell->apex_m, shell->depth_m, shell->axis);
    bst_pose_rim rim = {.centre = bst_pose_moved(p, shell->joint, centre),
                        .axis = bst_pose_shell_axis(p, index)};
    rim.rate = bst_vec3_dot(rim.axis, v->z);
    rim.inner_m = shell->radius_m * cos(BST_PI / shell->rim_count);
    return rim;
}

/* True if a ray from a point along the view's direction passes within the inner circle. */
static inline bool bst_pose_is_within_rim(const bst_pose_view *v, const bst_pose_rim *rim,
                                          bst_vec3 point) {
    bst_vec3 r = bst_vec3_sub(point, rim->centre);
    r = bst_vec3_axpy(r, -bst_vec3_dot(r, rim->axis) / rim->rate, v->z);
    return rim->rate > 0.0 && bst_vec3_dot(r, r) < rim->inner_m * rim->inner_m;
}

#endif
