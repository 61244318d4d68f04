/* Interpolated ephemeris of all objects and observers of a world, shared by all views.
 *
 * SGP4 orbits without burns are evaluated at knots t = k * step (seconds after the epoch, step a
 * power of two for each orbit), once, and interpolated by the polynomial through the ten knots
 * around t. The result depends only on orbit and time: earlier queries and the number of threads do
 * not change a bit. */
#ifndef BST_WORLD_ORBIT_EPHEMERIS_H
#define BST_WORLD_ORBIT_EPHEMERIS_H

#include "sim/world/world_internal.h"

typedef struct bst_ephemeris bst_ephemeris;

/* range below which both bodies are evaluated directly */
#define BST_EPHEMERIS_NEAREST_M 1e4

/* Creates the ephemeris of the world's orbits, which must outlive it. The interpolation error is
 * below 0.001 px of the sharpest camera at BST_EPHEMERIS_NEAREST_M, or below 20 um, the rounding of
 * SGP4. */
bst_status bst_ephemeris_create(bst_ctx *ctx, const bst_world *world,
                                bst_ephemeris **out) BST_MUST_CHECK;
void bst_ephemeris_free(bst_ephemeris *ephemeris); /* NULL allowed */

/* Optional: computes the knots around the epoch, and starts `threads` threads (0: one per
 * processor) for tables of many objects. */
bst_status bst_ephemeris_prepare(bst_ctx *ctx, bst_ephemeris *ephemeris,
                                 int threads) BST_MUST_CHECK;

/* Knots of the polynomial of a body, those for its error estimate included; bodies of which a
 * reader keeps them. */
enum { BST_EPHEMERIS_KNOTS = 12, BST_EPHEMERIS_KEPT = 8 };

/* The last polynomial of a body. */
typedef struct bst_ephemeris_knots {
    bool known, accurate; /* accurate: within the error of the ephemeris */
    int body;
    int64_t first; /* knot */
    double place_m[3][BST_EPHEMERIS_KNOTS];
} bst_ephemeris_knots;

/* What one thread last read. The ephemeris itself keeps 16 knots a body: threads at different
 * times, such as those of a light curve, would drive each other's knots out of it at each call.
 * Starts with all members 0; for one ephemeris. */
typedef struct bst_ephemeris_reader {
    bst_ephemeris_knots kept[BST_EPHEMERIS_KEPT]; /* by body, modulo their number */
} bst_ephemeris_reader;

/* Interpolated position and velocity (derivative of the position) of a body at `seconds` after the
 * epoch.
 *
 * Given:     reader  of this thread; NULL: none
 *            body    object index, or number of objects + observer index
 * Returned:  false, and nothing written, if the body must be evaluated directly: another
 *            kind of orbit, decayed, or a time where the polynomial is not accurate
 * Notes:     any number of threads may call it, each with a reader of its own */
bool bst_ephemeris_at(bst_ephemeris *ephemeris, bst_ephemeris_reader *reader, int body,
                      double seconds, bst_vec3 *position_m, bst_vec3 *velocity_mps);

/* Number of knots that calls of bst_ephemeris_at had to compute so far. */
int64_t bst_ephemeris_knots_made(bst_ephemeris *ephemeris);
/* Number of tables of all objects' positions computed so far. The last 32 are kept. */
int64_t bst_ephemeris_tables_made(bst_ephemeris *ephemeris);

/* A cone of directions from an observer, with tolerances in time and position. */
typedef struct bst_ephemeris_cone {
    bst_vec3 apex_m;       /* GCRF */
    bst_vec3 axis;         /* unit */
    double half_angle_rad; /* of apparent directions; aberration and light time are included */
    double half_span_s;    /* tolerance: objects in the cone at any time within +- half_span_s */
    double apex_span_m;    /* tolerance: the apex is anywhere within this distance of apex_m */
} bst_ephemeris_cone;

/* Finds the objects that may be in a cone: all that are, and few others; objects without
 * interpolation always. `indices`: ascending, with room for all objects. */
int bst_ephemeris_near(bst_ephemeris *ephemeris, double seconds, const bst_ephemeris_cone *cone,
                       int *indices);

/* Maximum error of bst_ephemeris_places, m. NAN in its result: evaluate the object directly; all 0:
 * no orbit. */
#define BST_EPHEMERIS_PLACES_M 1e3

/* Positions of all objects at the multiple of 8 s that is nearest to a time.
 *
 * Given:     seconds  since the epoch
 * Returned:  the multiple of 8 s, s since the epoch
 *            x_m, y_m, z_m  [number of objects] GCRF, m
 * Notes:     any thread. */
double bst_ephemeris_places(bst_ephemeris *ephemeris, double seconds, double *x_m, double *y_m,
                            double *z_m);

/* That multiple of 8 s. Positions of the same one have the same bits. */
double bst_ephemeris_places_time(double seconds);

#endif
