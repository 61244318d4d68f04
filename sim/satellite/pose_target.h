/* A facet of which shadows are removed. Internal to sim/satellite. */
#ifndef BST_SATELLITE_POSE_TARGET_H
#define BST_SATELLITE_POSE_TARGET_H

#include "sim/satellite/pose_view.h"

/* A facet, and what is left of it. */
typedef struct bst_pose_target {
    int facet, body; /* body: its occluder */
    bool pieces;     /* pose->clip has what is left; else `left` outside of pose->covers */
    bool whole;      /* nothing was removed, and nothing of what is left is set */
    bool overflow;   /* without pieces: pose->covers has no room for what hides the facet */
    bst_vec3 origin, normal;
    bst_vec3 e1, e2; /* with pieces: axes of the plane */
    /* without pieces: corners in the coordinates of pose->plane, of the facet or of what rims leave
     * of it */
    bst_point2 left[2 * BST_POLYGON_CORNERS_MAX];
    int left_count;
    /* of the current view: */
    bst_point2 seen[BST_POLYGON_CORNERS_MAX]; /* corners of the facet */
    double bounds[6];
    bool mapped;           /* the three members below are known */
    bst_point2 zero, x, y; /* from the view's coordinates to the plane: zero + u x + v y */
} bst_pose_target;

/* Removes an occluder's shadow of one view from a target without pieces. */
void bst_pose_area_subtract(bst_satellite_pose *pose, bst_pose_target *target, int view,
                            int occluder);

/* Keeps what light of a view reaches through the rim of a shell, without pieces.
 *
 * Given:     free  all corners of the facet are known to be reached */
void bst_pose_area_through_rim(bst_satellite_pose *pose, bst_pose_target *target, int view,
                               int shell, bool free);

/* Area of what is left of a target without pieces, m^2; below 0: pieces have to do. */
double bst_pose_area_left(const bst_satellite_pose *pose, const bst_pose_target *target);

#endif
