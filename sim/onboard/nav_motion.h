/* The observer at another time than that of its navigation telemetry. */
#ifndef BST_ONBOARD_NAV_MOTION_H
#define BST_ONBOARD_NAV_MOTION_H

#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* The observer's geocentric state (GCRF, m and m/s) dt_s after the telemetry's tick, either sign:
 * two-body motion, or a straight line where the telemetry is no orbit (at rest, or straight up).
 * The Earth's oblateness, left out, changes the velocity of a low orbit by 0.01 m/s per second. */
void bst_nav_state_after(const bst_nav_telemetry *nav, double dt_s, bst_vec3 *position_m,
                         bst_vec3 *velocity_mps);

/* What aberrates light that the observer receives dt_s after the telemetry's tick: its velocity of
 * that time. A low orbit's velocity turns by 8.5 m/s, 6 mas of aberration, each second. The Sun's
 * direction and the Earth's barycentric velocity are those of the telemetry. */
bst_light bst_nav_light_after(const bst_nav_telemetry *nav, double dt_s);

#endif
