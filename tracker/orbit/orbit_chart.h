/* Coordinates of an orbit that directions determine well, for fits. */
#ifndef BST_TRACKER_ORBIT_ORBIT_CHART_H
#define BST_TRACKER_ORBIT_ORBIT_CHART_H

#include "tracker/orbit/orbit_motion.h"

/* Orbit state in coordinates of the mid-arc observer: r = R + range q, v = V + range (u q + w),
 * with R and V the observer's state. Steps are (direction along two axes, rate times span along the
 * same axes, ln range, u times span): all are angles. */
typedef struct bst_od_chart {
    const bst_od_observer *observer; /* borrowed */
    double span_s;
    bst_vec3 q, w; /* unit direction; its rate, perpendicular, rad/s */
    double range_m, u_ps;
} bst_od_chart;

/* Coordinates of a state, of the observer's time, as the observer sees it. */
bst_od_chart bst_od_chart_of(const bst_od_observer *observer, double span_s, const bst_od_state *s);
/* State of given coordinates. */
bst_od_state bst_od_chart_state(const bst_od_chart *c);
/* Coordinates after a step. */
bst_od_chart bst_od_chart_moved(const bst_od_chart *c, const double step[6]);
/* Jacobian of (r, v), m and m/s, by the coordinate steps. */
void bst_od_chart_jacobian(const bst_od_chart *c, double out[6][6]);

#endif
