/* Offset of the onboard clock, learnt from the places of catalogued objects.
 *
 * A clock that is ahead puts the spacecraft and each object too far along their orbits, and so
 * displaces predicted directions by their rate times the offset. An error of an orbit along its
 * track looks nearly the same. The filter therefore estimates these errors with the offset: one of
 * the observer's position and one of each object's, in the axes of its orbit (radial, along,
 * across), where they stay for long. Many objects, or one on a known orbit, show the offset; what
 * cannot be separated stays in its variance. Stars show the offset by aberration only: 6 mas for a
 * second in low orbit.
 *
 * Extended Kalman filter; errors of positions follow random walks, so that they do not become
 * certain by long tracking. Several measurements of one object share its error. */
#ifndef BST_TRACKER_CLOCK_OFFSET_H
#define BST_TRACKER_CLOCK_OFFSET_H

#include <stdint.h>

#include "boresight/vec.h"
#include "tracker/mtt/sky_filter.h"

/* Objects whose errors are kept; those seen least recently make room. */
#define BST_CLOCK_OBJECTS 16
#define BST_CLOCK_STATES (1 + 3 + 3 * BST_CLOCK_OBJECTS)

typedef struct bst_clock_params {
    double sigma_s;        /* 1 sigma of the offset before any measurement; 0: the clock is right */
    double object_sigma_m; /* 1 sigma per axis of an object's position */
    double object_sigma_mps;
    double observer_sigma_m; /* 1 sigma per axis of the navigated position */
} bst_clock_params;

/* Start state: all zero. */
typedef struct bst_clock {
    bool started;
    double time_s; /* of the state */
    int64_t measurements;
    int32_t object[BST_CLOCK_OBJECTS]; /* in the catalogue */
    double seen_s[BST_CLOCK_OBJECTS];  /* its latest measurement; with object -1: no meaning */
    /* offset, s; observer's error, m; objects' errors, m */
    double state[BST_CLOCK_STATES], covariance[BST_CLOCK_STATES][BST_CLOCK_STATES];
} bst_clock;

/* An object as predicted for the onboard time less `corrected_s`, GCRF. */
typedef struct bst_clock_sight {
    int32_t object;     /* index in the catalogue, not negative */
    bst_vec3 direction; /* geometric, unit */
    double range_m;
    bst_vec3 object_m, object_mps, observer_m, observer_mps; /* geocentric */
    double corrected_s; /* offset that the prediction has taken from the onboard time */
} bst_clock_sight;

/* Advances the state to `seconds`, not before that of the latest call. */
void bst_clock_predict(bst_clock *clock, const bst_clock_params *params, double seconds);

/* Updates the state by a measured geometric direction of an object.
 *
 * Returned:  false if it is not used: it misfits (chi-square above 18.4, 2 degrees of freedom), the
 *            object is nearer than 20 sigma of its place, or the sight is degenerate */
bool bst_clock_measure(bst_clock *clock, const bst_clock_params *params,
                       const bst_clock_sight *sight, const bst_sky_measurement *measured);

/* 1 sigma of the estimated offset, clock->state[0], s. */
double bst_clock_sigma_s(const bst_clock *clock, const bst_clock_params *params);

#endif
