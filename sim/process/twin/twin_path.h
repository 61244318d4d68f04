/* Path of the line of sight during one exposure: a rotation vector that is a B-spline of time. */
#ifndef BST_PROCESS_TWIN_TWIN_PATH_H
#define BST_PROCESS_TWIN_TWIN_PATH_H

#include <stdbool.h>

#include "boresight/vec.h"

/* Most coefficients of an angle, and those that differ from zero at one time. */
enum { BST_TWIN_COEFFICIENTS = 68, BST_TWIN_SUPPORT = 4 };

/* q_cam_from_gcrf(t) = rotation by (x, y, z)(t) times q_reference; t from 0 to 1 over the exposure.
 * Rotations about x and y move the stars, rotation about z (the boresight) turns them. */
typedef struct bst_twin_path {
    bst_quat q_reference;
    int count[2];                                  /* coefficients of x and y; of z */
    double coefficients[3][BST_TWIN_COEFFICIENTS]; /* rad */
} bst_twin_path;

/* B-splines of degree 3 (less with fewer than 4 coefficients) with evenly spaced knots, clamped at
 * the ends.
 *
 * Given:     count  coefficients, 1 to BST_TWIN_COEFFICIENTS
 *            t      0 to 1
 * Returned:  value  of the splines `first` to first + BST_TWIN_SUPPORT - 1; 0 beyond the last
 *            first
 * Reference: de Boor, A Practical Guide to Splines (1978), chapter X */
int bst_twin_basis(int count, double t, double value[BST_TWIN_SUPPORT]);

/* Attitude at a time, unit. */
bst_quat bst_twin_path_attitude(const bst_twin_path *path, double t);

/* An attitude at a time. */
typedef struct bst_twin_attitude {
    double t;
    bst_quat q_cam_from_gcrf;
} bst_twin_attitude;

/* Path through attitudes, by least squares.
 *
 * Given:     path    q_reference and count set
 *            nodes, count  at least as many as coefficients of one angle
 * Returned:  *path   coefficients
 *            false: the attitudes do not determine them */
bool bst_twin_path_fit(bst_twin_path *path, const bst_twin_attitude *nodes, int count);

/* The same path with more coefficients; equal if the new knots contain the old ones. */
bool bst_twin_path_refine(bst_twin_path *path, int count_xy, int count_roll);

#endif
