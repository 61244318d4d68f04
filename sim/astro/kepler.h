/* Two-body (Kepler) motion in closed form. */
#ifndef BST_ASTRO_KEPLER_H
#define BST_ASTRO_KEPLER_H

#include "boresight/status.h"
#include "boresight/vec.h"

/* State after `seconds` (either sign) of two-body motion about a centre of gravitational parameter
 * mu (m^3/s^2), for any conic: universal variables with Stumpff functions, solved by
 * Laguerre-Conway iteration (Conway 1986) within a bracket. The rounding error grows as (r / q)^2
 * for motion from a distance r to a much smaller pericentre q. Errors: BST_ERR_NUMERIC for a state
 * at the centre, a rectilinear orbit, or no convergence. */
bst_status bst_kepler_propagate(bst_ctx *ctx, double mu, bst_vec3 position_m, bst_vec3 velocity_mps,
                                double seconds, bst_vec3 *position_out_m,
                                bst_vec3 *velocity_out_mps) BST_MUST_CHECK;

/* Eccentric anomaly of a mean anomaly, in the same turn, by Kepler's equation; radians, 0 <= e < 1.
 */
double bst_kepler_eccentric_anomaly(double mean_anomaly_rad, double e);

#endif
