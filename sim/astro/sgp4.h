/* SGP4/SDP4 analytic orbit propagation. */
#ifndef BST_ASTRO_SGP4_H
#define BST_ASTRO_SGP4_H

#include "sim/astro/tle.h"

typedef enum bst_sgp4_gravity { BST_SGP4_WGS72, BST_SGP4_WGS84 } bst_sgp4_gravity;
typedef enum bst_sgp4_mode {
    BST_SGP4_IMPROVED,
    BST_SGP4_AFSPC
} bst_sgp4_mode; /* opsmode 'i' and 'a' */

/* Error codes of the published reference (Vallado et al., AIAA 2006-6753). */
typedef enum bst_sgp4_error {
    BST_SGP4_OK = 0,
    BST_SGP4_MEAN_ECCENTRICITY = 1,
    BST_SGP4_MEAN_MOTION = 2,
    BST_SGP4_PERTURBED_ECCENTRICITY = 3,
    BST_SGP4_SEMI_LATUS_RECTUM = 4,
    BST_SGP4_DECAYED = 6
} bst_sgp4_error;

/* An initialised satellite; immutable to its users. */
typedef struct bst_sgp4 bst_sgp4;

/* Creates an SGP4 propagator from an element set; *out is freed with bst_sgp4_free, NULL on error.
 * Orbits of 225 minutes or longer get the deep-space model. BST_ERR_NUMERIC with the code in the
 * message for an eccentricity outside 0 <= e < 1 or a mean motion that is not above 0 (also once
 * Kozai's is turned to Brouwer's); BST_ERR_ARGUMENT for values that are not finite or an
 * inclination outside 0 to pi. Equations: Hoots and Roehrich, Spacetrack Report 3 (1980), with the
 * corrections and constants of Vallado et al., AIAA 2006-6753; BST_SGP4_AFSPC takes that paper's
 * sidereal time and node of the operational code. */
bst_status bst_sgp4_create(bst_ctx *ctx, const bst_elements *elements, bst_sgp4_gravity gravity,
                           bst_sgp4_mode mode, bst_sgp4 **out) BST_MUST_CHECK;
/* The same for one of several element sets near each other, whose differences are wanted. By drag
 * SGP4 turns the line of apsides by angles with 1 / e, and changes e by a sine of the mean anomaly;
 * up to e = 1e-4 it leaves the first out. Together they displace the eccentricity vector by what
 * hardly depends on e, but differs without limit between two sets near e = 0. The set moves with
 * the displacement of the middle set in place of its own, and its drag polynomials end where those
 * of the middle set do.
 *
 * Given:     middle  from bst_sgp4_create, with the gravity and mode; it must outlive *out
 * Returned:  *out    with the elements of the middle set it has its states within rounding */
bst_status bst_sgp4_create_near(bst_ctx *ctx, const bst_elements *elements, const bst_sgp4 *middle,
                                bst_sgp4 **out) BST_MUST_CHECK;
/* Frees a propagator; NULL is allowed. */
void bst_sgp4_free(bst_sgp4 *sgp4);

/* State at `minutes` after the element epoch (UTC taken as uniform, as the theory does): TEME, km
 * and km/s. The result does not depend on the order of times, and threads may share a propagator.
 * position/velocity are still written on BST_SGP4_DECAYED, else untouched on error. Times beyond
 * 1e9 minutes or not finite give BST_SGP4_MEAN_MOTION. Resonant orbits are integrated from the
 * epoch in steps of half a day, of which the last is remembered: the time that a call takes depends
 * on the order of times. */
bst_sgp4_error bst_sgp4_propagate(const bst_sgp4 *sgp4, double minutes, double position_teme_km[3],
                                  double velocity_teme_kmps[3]);

/* A state of bst_sgp4_propagate_many: TEME, km and km/s. */
typedef struct bst_sgp4_state {
    double position_teme_km[3], velocity_teme_kmps[3];
    bst_sgp4_error error;
} bst_sgp4_state;

/* States of many sets: eight near-Earth, deep-space or resonant ones at a time, with the vectors of
 * the processor.
 *
 * Given:     sets, minutes  [count]: states[i] is that of sets[i] at minutes[i] after its epoch, as
 *                           bst_sgp4_propagate has it. A set may come more than once
 * Returned:  states         [count]; error as from bst_sgp4_propagate; where it leaves a state
 *                           untouched, so does this function
 * Notes:     The equations are evaluated in the order of the scalar code, except that sine and
 *            cosine may differ in the last bit: states agree within 1e-9 km. They depend neither on
 *            the other sets nor on the width of the vectors. Sets that end with an error, and times
 *            beyond 2e6 minutes, are left to bst_sgp4_propagate.
 * Threads:   as bst_sgp4_propagate */
void bst_sgp4_propagate_many(const bst_sgp4 *const *sets, const double *minutes, int count,
                             bst_sgp4_state *states);

/* Integration step of a resonant orbit, minutes: at each multiple from the element epoch except 0
 * the position is discontinuous by up to metres. 0: not resonant. */
double bst_sgp4_step_minutes(const bst_sgp4 *sgp4);

/* Description of an SGP4 error code. */
const char *bst_sgp4_error_text(bst_sgp4_error error);

#endif
