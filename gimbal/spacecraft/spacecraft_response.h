/* Attitude loop of the spacecraft in the frequency domain, linearised about rest. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_RESPONSE_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_RESPONSE_H

#include "gimbal/spacecraft/spacecraft_config.h"

/* Frequency responses about an axis; complex numbers are {real, imaginary}. */
typedef struct bst_spacecraft_response {
    /* torque on the body -> attitude about the axis, rad per N m; other axes and modes free,
     * without wheel friction */
    double plant[2];
    /* attitude error -> torque, N m per rad, including sampling of gyro and controller and the
     * hold; the loop is 1 + plant * controller = 0 */
    double controller[2];
    double closed[2];     /* attitude knowledge error -> attitude: T = L / (1 + L) */
    double compliance[2]; /* torque on the body -> attitude, closed loop: plant / (1 + L) */
} bst_spacecraft_response;

/* Responses about body axis 0, 1 or 2 at a frequency above 0. The controller uses the tensor's
 * diagonal element as the axis' inertia. */
bst_spacecraft_response bst_spacecraft_response_at(const bst_spacecraft_config *config, int axis,
                                                   double frequency_hz);

/* One-sided PSDs (rad^2/Hz) about an axis caused by gyro and star-tracker noise. `knowledge`: error
 * of the estimated attitude. `pointing`: attitude of the body, which the controller moves by
 * estimated attitude and rate.
 *
 * Notes:     Steady filter in the limit of continuous measurements: gains k1 = sqrt(v^2 / r + 2 u /
 *            sqrt(r)) and k2 = u / sqrt(r). r = sigma^2 / rate_hz, v and u are the gyro's random
 *            walks, sigma the first tracker's noise about this axis. Tracker noise n, angle walk
 *            and rate walk cause the error e = ((k1 s + k2) n + s v + u) / (s^2 + k1 s + k2) and
 *            the rate error (s + k1) e - k1 n. */
typedef struct bst_spacecraft_noise {
    double knowledge, pointing;
} bst_spacecraft_noise;

/* Spectral densities of bst_spacecraft_noise at one frequency.
 *
 * Given:     axis          body axis, 0 to 2
 *            frequency_hz  above 0 */
bst_spacecraft_noise bst_spacecraft_noise_at(const bst_spacecraft_config *config, int axis,
                                             double frequency_hz);

/* Wheel imbalance line of wheel `wheel` at its configured speed: frequency, and amplitude (rad) of
 * the body's attitude about an axis with the loop closed. */
void bst_spacecraft_imbalance_line(const bst_spacecraft_config *config, int wheel, int axis,
                                   double *frequency_hz, double *amplitude_rad);

#endif
