/* The code of four stars: a signature of their figure that shift, rotation and scale leave alone.
 */
#ifndef BST_IMGPROC_IDENTIFY_STAR_QUAD_H
#define BST_IMGPROC_IDENTIFY_STAR_QUAD_H

#include <stdbool.h>

#include "boresight/vec.h"

/* A and B are the two stars furthest apart. In the tangent plane of the four, with A at 0 and B at
 * 1 of the complex plane, the code is the places of C and D. A mirrored figure has another code. */
typedef struct bst_star_quad {
    double code[4];  /* Re C, Im C, Re D, Im D; Re C <= Re D and Re C + Re D <= 1 */
    double size_rad; /* distance of A and B in the tangent plane */
    int order[4];    /* which of the given stars are A, B, C, D */
} bst_star_quad;

/* Code of four stars.
 *
 * Given:     v  four unit vectors in any frame, all within one hemisphere
 * Returned:  false: two of the stars coincide, or the four do not fit one tangent plane
 * Reference: Lang et al. 2010, AJ 139, 1782 (section 2.2) */
bool bst_star_quad_make(const bst_vec3 v[4], bst_star_quad *out);

/* Alternative forms of a code that lies within a tolerance of its ordering rules: A and B
 * exchanged, C and D exchanged.
 *
 * Returned:  out  up to three alternatives
 *            the number of them */
int bst_star_quad_alternatives(const bst_star_quad *quad, double tolerance, bst_star_quad out[3]);

#endif
