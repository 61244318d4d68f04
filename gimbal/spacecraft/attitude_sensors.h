/* Attitude sensors of a spacecraft: star trackers and gyro. */
#ifndef BST_GIMBAL_SPACECRAFT_ATTITUDE_SENSORS_H
#define BST_GIMBAL_SPACECRAFT_ATTITUDE_SENSORS_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/config.h"
#include "boresight/rng.h"
#include "boresight/vec.h"

#define BST_TRACKERS_MOST 4

typedef struct bst_spacecraft_star_tracker_config {
    double axis[3];
    double noise_arcsec, noise_about_axis_arcsec;
    double misalignment_arcsec[3];
    double rate_hz, latency_s;
    double sun_exclusion_deg, earth_exclusion_deg;
    double rate_limit_degps;
    double outage_s[2];
} bst_spacecraft_star_tracker_config;

typedef struct bst_spacecraft_gyro_config {
    double rate_hz;
    double angle_random_walk_deg_rth;
    double rate_random_walk_deg_rth3;
    double bias_degph[3], bias_sigma_degph;
    double scale_factor_ppm[3];
    double misalignment_arcsec[3];
} bst_spacecraft_gyro_config;

extern const bst_config_desc bst_star_tracker_config_table[];
extern const bst_config_desc bst_gyro_config_table[];

typedef struct bst_spacecraft_star_tracker {
    bst_vec3 axis;       /* boresight, unit, body axes */
    bst_vec3 across;     /* unit, perpendicular to the boresight */
    double sigma_rad[2]; /* across the boresight, about it */
    bst_quat alignment;  /* misaligned body axes as assumed by the tracker, from body */
    double sun_exclusion_rad, earth_exclusion_rad, rate_limit_radps;
    double outage_s[2];
    bst_rng_key key;
} bst_spacecraft_star_tracker;

/* Initialises a star tracker from its configuration.
 *
 * Given:     key  key of its noise */
void bst_spacecraft_star_tracker_init(bst_spacecraft_star_tracker *tracker,
                                      const bst_spacecraft_star_tracker_config *config,
                                      bst_rng_key key);

/* True if a star tracker sees stars: the body rate is below its limit, the boresight is farther
 * than the exclusion angles from the Sun and the Earth's limb (sphere of equatorial radius), and
 * there is no outage.
 *
 * Given:     position_m  geocentric, GCRF
 *            sun_m       from the spacecraft, GCRF */
bool bst_spacecraft_star_tracker_sees(const bst_spacecraft_star_tracker *tracker, double seconds,
                                      bst_quat q_body_from_gcrf, bst_vec3 rate_radps,
                                      bst_vec3 position_m, bst_vec3 sun_m);

/* Star-tracker measurement number `sample`: the true attitude with noise and alignment error. */
bst_quat bst_spacecraft_star_tracker_measure(const bst_spacecraft_star_tracker *tracker,
                                             int64_t sample, bst_quat q_body_from_gcrf);

/* Noise covariance of a star tracker, rad^2, body axes. */
bst_mat3 bst_spacecraft_star_tracker_covariance(const bst_spacecraft_star_tracker *tracker);

/* Rate-integrating gyro: each sample is the rotation since the previous one. Farrenkopf, J.
 * Guidance and Control 1 (1978) 282; discrete form after Crassidis and Junkins, Optimal Estimation
 * of Dynamic Systems (2nd edition), section 7.2.2. */
typedef struct bst_spacecraft_gyro {
    double angle_walk;   /* rad / sqrt(s) */
    double rate_walk;    /* rad / s^1.5 */
    bst_mat3 response;   /* scale factor and alignment: sensed angle from body angle */
    bst_vec3 bias_radps; /* current */
    double dt_s;
    bst_rng_key key;
    int64_t samples;
} bst_spacecraft_gyro;

/* Initialises a gyro. The initial bias is bias_degph plus a draw of bias_sigma_degph about each
 * axis.
 *
 * Given:     dt_s  time between samples */
void bst_spacecraft_gyro_init(bst_spacecraft_gyro *gyro, const bst_spacecraft_gyro_config *config,
                              double dt_s, bst_rng_key key);

/* Next gyro sample, rad, body axes; the bias continues its random walk.
 *
 * Given:     turn_rad  true rotation vector of the body since the previous sample */
bst_vec3 bst_spacecraft_gyro_measure(bst_spacecraft_gyro *gyro, bst_vec3 turn_rad);

/* Archives the gyro's bias and its number of samples. */
void bst_spacecraft_gyro_archive(bst_spacecraft_gyro *gyro, bst_archive *archive);

#endif
