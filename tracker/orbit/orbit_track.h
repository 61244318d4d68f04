/* Orbital motion of a track whose range is known or assumed: its six-dimensional orbit state
 * underlies the direction and rate used by association and filters. */
#ifndef BST_TRACKER_ORBIT_ORBIT_TRACK_H
#define BST_TRACKER_ORBIT_ORBIT_TRACK_H

#include "tracker/mtt/sky_filter.h"
#include "tracker/orbit/orbit_motion.h"

typedef struct bst_orbit_track {
    bool valid;
    bst_od_state state;      /* geocentric, GCRF */
    double covariance[6][6]; /* r, v */
    /* of the latest prediction: direction and rate, and their cross-covariance with r, v */
    bst_sky_state sky;
    double cross[6][4];
    bool ranged; /* ranges have been used, the latest at range_s */
    double range_s;
} bst_orbit_track;

/* Starts an orbit from a track's sky state and a range prior (bst_od_from_track), at the same time.
 */
void bst_orbit_track_start(const bst_sky_state *sky, const bst_od_observer *observer,
                           const bst_orbit_range *range, bst_orbit_track *out);

/* Predicts the orbit to observer->time_s (either direction) and sets track->sky, to first order.
 *
 * Given:     noise_m2ps3  power spectral density of white acceleration per axis, for forces beyond
 *                         two-body motion and J2
 * Returned:  false, with the orbit no longer valid, if the orbit does not exist */
bool bst_orbit_track_predict(bst_orbit_track *track, double noise_m2ps3,
                             const bst_od_observer *observer);

/* Updates the orbit from the updated sky state of its track.
 *
 * Given:     posterior  track->sky after the frame's detections, by any filter and association
 * Returned:  false, and the orbit is no longer valid, if a covariance is singular
 * Notes:     with G = cov(orbit, sky) cov(sky)^-1 the orbit becomes x + G (sky' - sky) and its
 *            covariance P + G (S' - S) G^T. This is the Kalman update, as detections depend on the
 *            sky state alone.
 * Reference: Anderson and Moore 1979, chapter 5 */
bool bst_orbit_track_update(bst_orbit_track *track, const bst_sky_state *posterior);

/* A measured range, for example from the apparent size. */
typedef struct bst_orbit_measured_range {
    double range_m, sigma_m;
    double correlation_s; /* time constant of its errors; 0: they are independent */
} bst_orbit_measured_range;

/* Updates the orbit, and its sky state, with a range measured at the time of the orbit.
 *
 * Returned:  false: the range was not used, as it differs by more than 5 sigma; or the orbit is no
 *            longer valid
 * Notes:     errors of ranges from a size last: that of the known size always, that of the attitude
 *            while the object shows it. The first range counts with its variance. A later one, dt
 *            after the latest that was used, counts with 2 correlation_s / dt times that, if that
 *            is more: over a long time ranges with the autocovariance
 *            sigma^2 exp(-|dt| / correlation_s) tell as much of a constant. */
bool bst_orbit_track_range(bst_orbit_track *track, const bst_od_observer *observer,
                           const bst_orbit_measured_range *measured);

/* Fuses two independent estimates of the same sky state into the first; false if their covariances
 * are not usable. */
bool bst_sky_fuse(bst_sky_state *a, const bst_sky_state *b);

#endif
