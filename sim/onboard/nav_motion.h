/* Propagates the observer state of navigation telemetry to another time. */
#ifndef BST_ONBOARD_NAV_MOTION_H
#define BST_ONBOARD_NAV_MOTION_H

#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* Geocentric observer state (GCRF, m and m/s) dt_s after the telemetry's tick, either sign:
 * two-body motion, or linear if the telemetry is no orbit (at rest, or vertical motion). Neglecting
 * oblateness changes the velocity of a low orbit by 0.01 m/s per second. */
void bst_nav_state_after(const bst_nav_telemetry *nav, double dt_s, bst_vec3 *position_m,
                         bst_vec3 *velocity_mps);

/* Aberration of light received dt_s after the telemetry's tick, by the velocity at that time. A low
 * orbit's velocity changes by 8.5 m/s per second, 6 mas of aberration. The Sun's direction and the
 * Earth's barycentric velocity are those of the telemetry. */
bst_light bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s);

#endif
