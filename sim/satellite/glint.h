/* Times at which surfaces of a satellite glint: mirror normals that pass the half vector. */
#ifndef BST_SATELLITE_GLINT_H
#define BST_SATELLITE_GLINT_H

#include "sim/satellite/pose.h"

/* Surfaces for which glints are sought, at most, and the widest lobe that counts as a glint, rad.
 */
enum { BST_GLINT_SURFACES = 256, BST_GLINTS_MAX = 256 };
#define BST_GLINT_WIDEST_RAD 0.3

/* Facets with the same normal, or a cylinder or cone, whose normals make one angle with its axis.
 */
typedef struct bst_glint_surface {
    int joint;       /* -1: the body */
    bst_vec3 axis;   /* unit, frame of the joint: the normal, or the axis of revolution */
    double angle;    /* between the axis and the normals, rad */
    double lobe_rad; /* bst_brdf_lobe_rad of the material */
    double area_m2;
} bst_glint_surface;

/* Finds the surfaces of a model with a narrow lobe. Spheres are left out: they glint at all times.
 *
 * Returned:  surfaces[BST_GLINT_SURFACES]  the largest, if there are more
 * Value:     their number */
int bst_glint_surfaces(const bst_satellite *satellite, bst_glint_surface *surfaces);

/* Angle between the half vector and the nearest normal of a surface, rad.
 *
 * Given:     pose  turned by bst_satellite_pose_turn
 *            half  unit, body frame: middle of the directions to the light and the observer */
double bst_glint_offset(const bst_glint_surface *surface, const bst_satellite_pose *pose,
                        bst_vec3 half);

/* A glint: the time of least offset, and the time in which the offset then changes by the width of
 * the lobe; both as fractions of the span. */
typedef struct bst_glint {
    double u, per;
} bst_glint;

/* Offsets of all surfaces at one time.
 *
 * Returned:  offsets  by surface, rad */
typedef void (*bst_glint_course)(void *user, double u, double *offsets);

/* Finds the glints in [0, 1]: places of least offset within five widths of the lobe.
 *
 * Given:     surfaces, count
 *            widen_rad  added to each lobe: what the Sun's disc adds
 *            steps      of the first scan; offsets may have one minimum in two steps
 *            course     offsets of all surfaces at a time
 * Returned:  glints     u may be up to a step outside of [0, 1]
 * Value:     their number; more than BST_GLINTS_MAX are left out, the latest first */
int bst_glint_find(const bst_glint_surface *surfaces, int count, double widen_rad, int steps,
                   bst_glint_course course, void *user, bst_glint glints[BST_GLINTS_MAX]);

/* Finds the times around which a light curve must be sampled densely: those of bst_glint_find, and
 * times at fractions of the lobe's width around them.
 *
 * Given:     as bst_glint_find; most: room in `times`
 * Returned:  times      unordered, within (0, 1)
 * Value:     their number; glints without room are left out, the latest first */
int bst_glint_times(const bst_glint_surface *surfaces, int count, double widen_rad, int steps,
                    bst_glint_course course, void *user, double *times, int most);

#endif
