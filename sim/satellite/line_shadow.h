/* What the bodies of a pose hide of a straight line. Internal to sim/satellite. */
#ifndef BST_SATELLITE_LINE_SHADOW_H
#define BST_SATELLITE_LINE_SHADOW_H

#include "sim/satellite/pose.h"

enum { BST_LINE_BANDS_MAX = 64, BST_LINE_CORNERS_MAX = 40 };

/* A truncated cone or a sphere in a view: the hull of two ellipses, in coordinates in which both
 * are circles. */
typedef struct bst_round_band {
    bst_point2 centre, along; /* centre of the first one in the view; unit, from it to the second */
    double scale;             /* on the coordinate along */
    double radius_m[2], apart; /* apart: of the centres, in these coordinates */
    double sine, cosine;       /* of the angle between the tangents and the axis */
    bool tangents;             /* neither circle is within the other */
} bst_round_band;

/* The bodies that may hide some of another one from the Sun or the observer. */
typedef struct bst_line_shadow {
    bst_satellite_pose *pose;
    int body;     /* that lines are on */
    int first[3]; /* of view k: pose->hiders[first[k]] to pose->hiders[first[k + 1] - 1], each with
                     its first band; -1: by its polygon */
    bst_round_band bands[BST_LINE_BANDS_MAX];
    int band_count;
    bst_round_band rim[2]; /* of the body itself, for its inside, in both views */
} bst_line_shadow;

/* A straight line in the body frame, with the light of a piece at both ends. */
typedef struct bst_light_line {
    bst_vec3 from, to, normal;
    double from_weight, to_weight;
} bst_light_line;

/* A circle in the body frame; a point has the radius 0. */
typedef struct bst_line_ring {
    bst_vec3 centre, axis; /* axis: unit; 0: the ring is a sphere */
    double radius_m;
} bst_line_ring;

/* Lists the bodies that may hide some of a surface.
 *
 * Given:     pose    bst_pose_look has prepared view 0 toward the observer and view 1 toward the
 *                    Sun
 *            body    the occluder that the surface belongs to
 *            inside  it is the inside of a shell
 *            rings   [ring_count] whose hull contains the surface
 * Returned:  false: there are none; and *shadow */
bool bst_line_shadow_make(bst_satellite_pose *pose, int body, bool inside,
                          const bst_line_ring *rings, int ring_count, bst_line_shadow *shadow);

/* Light of a line, its length taken as 1, that is hidden from the Sun or from the observer.
 *
 * Notes:     what a convex body hides is one interval. It is exact for bodies with plane faces and
 *            for round ones, except that round bodies have the model's facets where lines may be
 *            both in front of and behind them. */
double bst_line_shadow_lost(const bst_line_shadow *shadow, const bst_light_line *line);

/* Corners of a hider's silhouette, or of a polygon about it if it is round.
 *
 * Given:     view, index  of the list
 * Returned:  point  [BST_LINE_CORNERS_MAX] along the view's x and y, in order around it; the number
 *                   is the return value
 * Notes:     of silhouettes with more corners some are left out. Polygons about round bodies are up
 *            to 8 % wider, about the bottom of shells more. */
int bst_line_shadow_corners(const bst_line_shadow *shadow, int view, int index, bst_point2 *point);

/* The two straight sides of a round hider's silhouette.
 *
 * Given:     index  of the list
 * Returned:  tangent  the ends of each, along the view's x and y
 *            false: it has none, or the hider is not round */
bool bst_line_shadow_tangents(const bst_line_shadow *shadow, int index, bst_point2 tangent[2][2]);

#endif
