/* Values of a plot that follow from several columns or from two rows of a table. */
#ifndef BST_VIEW_PLOT_VALUES_H
#define BST_VIEW_PLOT_VALUES_H

#include <stdbool.h>
#include <stdint.h>

/* State of a track at a time, as table `tracks` has it: direction (deg), its rate along east and
 * north (arcsec/s), and covariances of direction d and rate r (rad^2, rad^2/s, rad^2/s^2). */
typedef struct bst_view_track_state {
    double time_s;
    int64_t track, misses_in_row;
    double ra_deg, dec_deg, rate_arcsec_per_s[2];
    double d11, d12, d22, dr[2][2], r11, r12, r22;
} bst_view_track_state;

/* Angle between two directions, arcsec. Given: right ascension and declination, deg. */
double bst_view_angle_arcsec(double ra_deg, double dec_deg, double other_ra_deg,
                             double other_dec_deg);

/* Three standard deviations per axis, arcsec, of a covariance [rad^2] with these diagonal elements:
 * the mean of both axes. */
double bst_view_three_sigma_arcsec(double d11_rad2, double d22_rad2);

/* Innovation of a track's filter, from its states before and after a detection.
 *
 * Given:     before, after  consecutive states of one track; `after` includes a detection
 * Returned:  *innovation_arcsec   length of the innovation
 *            *sigma3_arcsec       three standard deviations per axis of the innovation
 *            false: these states do not give it (another track, no detection, or a covariance that
 *            did not shrink)
 * Notes:     With the predicted covariance P of the direction, the updated one Q, and the
 *            correction c, the gain is K = I - Q P^-1 = P S^-1, the innovation K^-1 c, and its
 *            covariance S = P (P - Q)^-1 P. The prediction goes on at the rate of `before`; process
 *            noise between the two states is left out, so P is a little too small.
 * Reference: Blackman and Popoli (1999), Design and Analysis of Modern Tracking Systems, sec. 3.2
 */
bool bst_view_innovation(const bst_view_track_state *before, const bst_view_track_state *after,
                         double *innovation_arcsec, double *sigma3_arcsec);

#endif
