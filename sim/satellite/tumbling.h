/* Rotation of a rigid body without torque. */
#ifndef BST_SATELLITE_TUMBLING_H
#define BST_SATELLITE_TUMBLING_H

#include "boresight/status.h"
#include "boresight/vec.h"

/* A motion, tabulated over one period of the body rates; immutable. */
typedef struct bst_tumbling bst_tumbling;

/* Prepares the motion of a body.
 *
 * Given:     inertia_kg_m2  [3] principal moments about the body's x, y, z: above 0, each at most
 *                           the sum of the others
 *            rate_radps     angular velocity at time 0, body frame
 * Returned:  *out  the motion; NULL on error
 * Errors:    BST_ERR_CONFIG for impossible moments, BST_ERR_MEMORY
 * Ownership: free *out with bst_tumbling_free
 * Notes:     the body rates are periodic (Landau and Lifshitz, Mechanics, section 37), and after a
 *            period the attitude has turned about the angular momentum. One period is integrated by
 *            Runge-Kutta; any later time costs the same and keeps energy and momentum.
 * Reference: period: 4 K(k) by the arithmetic-geometric mean (Abramowitz and Stegun 17.6.3) */
bst_status bst_tumbling_create(bst_ctx *ctx, const double inertia_kg_m2[3], bst_vec3 rate_radps,
                               bst_tumbling **out) BST_MUST_CHECK;
/* Frees a motion; NULL is allowed. */
void bst_tumbling_free(bst_tumbling *tumbling);

/* Attitude and rate at a time.
 *
 * Given:     seconds     any sign
 * Returned:  attitude at that time from the attitude at time 0: q_body(t)_from_body(0)
 *            *rate_radps  body frame, if not NULL */
bst_quat bst_tumbling_at(const bst_tumbling *tumbling, double seconds, bst_vec3 *rate_radps);

/* Checks principal moments, kg m^2: above 0, each at most the sum of the others. BST_ERR_CONFIG. */
bst_status bst_tumbling_check(bst_ctx *ctx, const double inertia_kg_m2[3]) BST_MUST_CHECK;

/* Turns a body without torque, by the classical Runge-Kutta method.
 *
 * Given:     inertia_kg_m2  [3] as for bst_tumbling_create
 *            seconds        any sign
 *            step_rad       largest rotation in a step; its error is about step_rad^5 / 120
 *            q              attitude q_body_from_reference at the start
 *            rate_radps     angular velocity at the start, body frame
 * Returned:  *q, *rate_radps  after that time */
void bst_tumbling_turn(const double inertia_kg_m2[3], double seconds, double step_rad, bst_quat *q,
                       bst_vec3 *rate_radps);

#endif
