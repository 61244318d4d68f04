/* The spacecraft that carries the gimbal: its attitude as it is (drift, jitter) and as it believes
 * it to be, and how its state is published. */
#ifndef BST_GIMBAL_PLATFORM_H
#define BST_GIMBAL_PLATFORM_H

#include "gimbal/jitter.h"
#include "sim/core/config.h"
#include "sim/core/messages.h"
#include "sim/core/status.h"

/* The "platform" block of a gimbal's configuration. */
typedef struct bst_platform_config {
    double drift_arcsec_per_s[3];
    double jitter_low_px_rms, jitter_low_cutoff_hz;
    double jitter_high_px_rms, jitter_high_band_hz[2];
    double attitude_bias_arcsec[3];
    double attitude_noise_arcsec;
    double history_s;
    double telemetry_rate_hz, telemetry_history_s;
    double nav_rate_hz;
} bst_platform_config;

extern const bst_config_desc bst_platform_config_table[];

typedef struct bst_platform {
    bst_quat q_nominal_from_gcrf;  /* held inertially */
    bst_quat q_believed_from_gcrf; /* nominal turned by the bias */
    bst_vec3 drift_radps;          /* body axes */
    double attitude_noise_rad;
    bst_rng_key attitude_key;
    bst_jitter jitter;
    double unresolved_rad2; /* variance of the jitter per axis that is not between the samples */
} bst_platform;

/* Prepares a platform. pixel_rad: angle of a sensor pixel (jitter is configured in pixels); dt_s:
 * plant step. BST_ERR_CONFIG when the high jitter band is empty. */
bst_status bst_platform_init(bst_ctx *ctx, bst_platform *platform,
                             const bst_platform_config *config, bst_quat q_nominal_from_gcrf,
                             double pixel_rad, double dt_s, bst_rng_key jitter_key,
                             bst_rng_key attitude_key) BST_MUST_CHECK;

/* True camera attitude at plant step n (seconds = n * dt_s), given the camera's attitude in the
 * body: body nominal turned by drift * seconds about the (constant) drift vector, then the camera
 * turned by the jitter about its own x and y axes. */
bst_quat bst_platform_true_camera(bst_platform *platform, int64_t n, double seconds,
                                  bst_quat q_cam_from_body);

/* The same `fraction` (0 to 1) of a step later: the jitter on the straight way to the next step. */
bst_quat bst_platform_true_camera_between(bst_platform *platform, int64_t n, double fraction,
                                          double seconds, bst_quat q_cam_from_body);

/* The body attitude as the attitude sensors report it at plant step n: believed, plus white noise
 * of attitude_noise_arcsec about each axis. */
bst_quat bst_platform_measured_body(const bst_platform *platform, int64_t n);

/* Number of plant steps between two publications at wanted_hz. BST_ERR_CONFIG, naming the nearest
 * rates, when the plant's rate is no multiple of it. `key` is for the message. */
bst_status bst_platform_divider(bst_ctx *ctx, const char *key, double plant_rate_hz,
                                double wanted_hz, int64_t *out) BST_MUST_CHECK;

/* BST_ERR_CONFIG when the ring of line-of-sight samples does not reach back over an exposure of
 * exposure_s. */
bst_status bst_platform_check_history(bst_ctx *ctx, const bst_platform_config *config,
                                      double exposure_s) BST_MUST_CHECK;

/* Samples in a ring that covers history_s at rate_hz, both ends included. */
static inline int bst_platform_ring(double history_s, double rate_hz) {
    double samples = ceil(history_s * rate_hz) + 1.0;
    return samples < 2.0 ? 2 : samples > 1e8 ? 100000000 : (int)samples;
}

/* Appends a sample to the rings; `capacity` is what bst_step_write said. */
void bst_platform_append_los(bst_los_history *history, int capacity, int64_t tick,
                             bst_quat q_cam_from_gcrf);
void bst_platform_append_pointing(bst_pointing_telemetry *telemetry, int capacity, int64_t tick,
                                  bst_quat q_cam_from_gcrf, const double axis_rad[2],
                                  bst_quat q_body_from_gcrf, bool settled, bool limited);
/* The same of a mount without axes that follows exactly, at plant step n: the body as measured. */
void bst_platform_append_exact(const bst_platform *platform, int64_t n,
                               bst_pointing_telemetry *telemetry, int capacity, int64_t tick,
                               bst_quat q_cam_from_body);

#endif
