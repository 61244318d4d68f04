/* One ephemeris of all objects and observers of a world, shared by all views.
 *
 * SGP4 orbits without burns are evaluated at knots t = k * step (seconds after the epoch, step a
 * power of two for each orbit), once, and interpolated by the polynomial through the ten knots
 * around t. The result depends on the orbit and the time alone: it is the same to the bit for any
 * earlier queries and any number of threads. */
#ifndef BST_WORLD_ORBIT_EPHEMERIS_H
#define BST_WORLD_ORBIT_EPHEMERIS_H

#include "sim/world/world_internal.h"

typedef struct bst_ephemeris bst_ephemeris;

/* Objects and observers that are nearer to each other are evaluated directly, both. */
#define BST_EPHEMERIS_NEAREST_M 1e4

/* Prepares the ephemeris of the world's orbits, which must outlive it. Positions differ from direct
 * evaluation by less than a thousandth of a pixel of the world's sharpest camera at
 * BST_EPHEMERIS_NEAREST_M, but not by less than the 20 um that SGP4 itself is rounded to. */
bst_status bst_ephemeris_create(bst_ctx *ctx, const bst_world *world,
                                bst_ephemeris **out) BST_MUST_CHECK;
void bst_ephemeris_free(bst_ephemeris *ephemeris); /* NULL allowed */

/* Gives the work on whole tables of objects to `threads` threads (0: one per processor) where there
 * is enough of it, and fills the knots around the epoch. Optional. */
bst_status bst_ephemeris_prepare(bst_ctx *ctx, bst_ephemeris *ephemeris,
                                 int threads) BST_MUST_CHECK;

/* Position and velocity (the derivative of the position) of a body at `seconds`:
 * object index, or the number of objects plus observer index. False, and nothing written, when the
 * body is to be evaluated directly: another kind of orbit, no orbit then (decayed), or a place that
 * the polynomial would miss. Any number of threads may call. */
bool bst_ephemeris_at(bst_ephemeris *ephemeris, int body, double seconds, bst_vec3 *position_m,
                      bst_vec3 *velocity_mps);

/* A cone of directions from a place, and how far in time and space the objects may be off. */
typedef struct bst_ephemeris_cone {
    bst_vec3 apex_m;       /* GCRF */
    bst_vec3 axis;         /* unit */
    double half_angle_rad; /* apparent directions: aberration and light time are allowed for */
    double half_span_s;    /* objects that are in the cone at any time so far from `seconds`... */
    double apex_span_m;    /* ...while the apex is anywhere in this distance from apex_m */
} bst_ephemeris_cone;

/* Indices (ascending) of the objects that may be in the cone: all that are, and few others. Objects
 * that are not interpolated are always among them. `indices` has room for all objects. */
int bst_ephemeris_near(bst_ephemeris *ephemeris, double seconds, const bst_ephemeris_cone *cone,
                       int *indices);

/* Geocentric places (m, GCRF) of all objects at the whole multiple of 8 s nearest to `seconds`,
 * which is returned, to BST_EPHEMERIS_PLACES_M. NAN: to be evaluated directly; all 0: no orbit. */
#define BST_EPHEMERIS_PLACES_M 1e3

/* Positions of all objects at the node of the ephemeris that is nearest to a time.
 *
 * Given:     seconds  since the epoch
 * Returned:  time of the node, s since the epoch
 *            x_m, y_m, z_m  [number of objects] GCRF, m
 * Notes:     any thread. */
double bst_ephemeris_places(bst_ephemeris *ephemeris, double seconds, double *x_m, double *y_m,
                            double *z_m);

#endif
