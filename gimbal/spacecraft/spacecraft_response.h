/* The spacecraft's attitude loop in the frequency domain, linearised about rest. */
#ifndef BST_GIMBAL_SPACECRAFT_SPACECRAFT_RESPONSE_H
#define BST_GIMBAL_SPACECRAFT_SPACECRAFT_RESPONSE_H

#include "gimbal/spacecraft/spacecraft_config.h"

/* Complex numbers are {real, imaginary}. */
typedef struct bst_spacecraft_response {
    double plant[2];      /* torque on the body -> its attitude about the axis, rad per N m; the
                             other axes and the modes free, friction of the wheels left out */
    double controller[2]; /* attitude error -> torque, N m per rad, with the gyro's and controller's
                             sampling and the hold; the loop is 1 + plant * controller = 0 */
    double closed[2];     /* attitude as the onboard side errs -> attitude: T = L / (1 + L) */
    double compliance[2]; /* torque on the body -> attitude, loop closed: plant / (1 + L) */
} bst_spacecraft_response;

/* About body axis 0, 1 or 2 at a frequency above 0. The controller's share is that of the
 * axis alone: its inertia is the tensor's diagonal element. */
bst_spacecraft_response bst_spacecraft_response_at(const bst_spacecraft_config *config, int axis,
                                                   double frequency_hz);

/* One-sided PSDs (rad^2/Hz) about an axis of what gyro and star tracker do: `knowledge`, of the
 * believed attitude's error; `pointing`, of the body's own attitude, which the controller moves by
 * believed attitude and rate. With the steady filter in the limit of continuous measurements: gains
 * k1 = sqrt(v^2 / r + 2 u / sqrt(r)) and k2 = u / sqrt(r), r = sigma^2 / rate_hz, v and u the
 * gyro's random walks, sigma the noise about this axis of the first tracker; tracker noise n, angle
 * walk and rate walk make the error e = ((k1 s + k2) n + s v + u) / (s^2 + k1 s + k2) and the
 * rate's error (s + k1) e - k1 n. */
typedef struct bst_spacecraft_noise {
    double knowledge, pointing;
} bst_spacecraft_noise;

/* Spectral densities of bst_spacecraft_noise at one frequency.
 *
 * Given:     axis          body axis, 0 to 2
 *            frequency_hz  above 0 */
bst_spacecraft_noise bst_spacecraft_noise_at(const bst_spacecraft_config *config, int axis,
                                             double frequency_hz);

/* Imbalance of wheel `wheel` at its configured speed: frequency, and amplitude (rad) of the body's
 * attitude about an axis, the loop closed. */
void bst_spacecraft_imbalance_line(const bst_spacecraft_config *config, int wheel, int axis,
                                   double *frequency_hz, double *amplitude_rad);

#endif
