/* The spacecraft that carries the gimbal: its attitude as it is (drift or dynamics, jitter) and as
 * it believes it to be, and how its state is published. */
#ifndef BST_GIMBAL_PLATFORM_H
#define BST_GIMBAL_PLATFORM_H

#include "boresight/config.h"
#include "boresight/module.h"
#include "boresight/status.h"
#include "gimbal/jitter/jitter_spectrum.h"
#include "gimbal/spacecraft/spacecraft.h"

/* The "platform" block of a gimbal's configuration. */
typedef struct bst_platform_config {
    double drift_arcsec_per_s[3];
    double jitter_low_px_rms, jitter_low_cutoff_hz;
    double jitter_high_px_rms, jitter_high_band_hz[2];
    bst_jitter_psd_config jitter_psd;
    double attitude_bias_arcsec[3];
    double attitude_noise_arcsec;
    double history_s;
    double telemetry_rate_hz, telemetry_history_s;
    double nav_rate_hz;
    bst_spacecraft_config spacecraft;
} bst_platform_config;

extern const bst_config_desc bst_platform_config_table[];

typedef struct bst_platform {
    bst_quat q_nominal_from_gcrf;  /* at the epoch; of an inertial spacecraft always */
    bst_quat q_believed_from_gcrf; /* inertial: nominal turned by the bias; else as estimated now */
    bst_vec3 rate_believed_radps;  /* body axes; inertial: zero */
    bst_body_state body;           /* true, as bst_platform_advance left it */
    bst_vec3 drift_radps;          /* body axes */
    double attitude_noise_rad;
    bst_rng_key attitude_key;
    bst_jitter jitter;
    double unresolved_rad2; /* variance of the jitter per axis that is not between the samples, and
                               of the wheels' imbalance */
    double jitter_unresolved_rad2; /* the former alone */
    bst_spacecraft *spacecraft;    /* owned; NULL: inertial */
    struct bst_platform_sky *sky;  /* owned, with it */
    bool wheels_saturated;         /* at their greatest speed or torque */
    bool trackers_blind;           /* no star tracker saw stars when last asked */
} bst_platform;

/* The jitter that a configuration asks for; pixel_rad: angle of a sensor pixel. Errors as
 * bst_jitter_spectrum_create, and BST_ERR_CONFIG when the high band is empty; to be freed with
 * bst_jitter_spectrum_free. */
bst_status bst_platform_jitter_spectrum(bst_ctx *ctx, const bst_platform_config *config,
                                        double pixel_rad, bst_jitter_spectrum *out) BST_MUST_CHECK;

/* What a platform needs besides its configuration. */
typedef struct bst_platform_setup {
    bst_quat q_nominal_from_gcrf; /* of the body at the epoch */
    double pixel_rad;             /* angle of a sensor pixel: jitter is configured in pixels */
    double dt_s;                  /* plant step */
    bst_rng_key jitter_key, attitude_key;
} bst_platform_setup;

/* Prepares a platform. Errors as bst_platform_jitter_spectrum. To be freed with bst_platform_free.
 */
bst_status bst_platform_init(bst_ctx *ctx, bst_platform *platform,
                             const bst_platform_config *config,
                             const bst_platform_setup *setup) BST_MUST_CHECK;

/* Gives a platform whose configuration has a `rigid_body` its spacecraft, which sees the world of
 * the module's sensor; nothing for an inertial one. Errors as bst_spacecraft_create; freed by
 * bst_platform_free. */
bst_status bst_platform_equip(const bst_module_env *env, bst_platform *platform,
                              const bst_platform_config *config, double dt_s) BST_MUST_CHECK;
/* BST_ERR_CONFIG when a mount of that inertia (kg m^2, in the order of bst_spacecraft_spec) is too
 * heavy for its spacecraft: its reaction comes a step late, which is stable while the mount's
 * inertia is less than the rest's, here required to be below half of it. */
bst_status bst_platform_check_mount(bst_ctx *ctx, const bst_platform *platform,
                                    const double mount_kgm2[6]) BST_MUST_CHECK;
/* What init and equip made; a zeroed platform is allowed. */
void bst_platform_free(bst_platform *platform);

/* Brings the body to plant step n = 0, 1, 2, ... in turn, `seconds` after the epoch: members body,
 * q_believed_from_gcrf, rate_believed_radps, unresolved_rad2 and the flags. reaction_nm: torque of
 * the mount on the body over the step before (N m, body axes; of no effect on an inertial one). An
 * inertial platform needs it only where `body` is read. Passes on errors of bst_spacecraft_step. */
bst_status bst_platform_advance(bst_ctx *ctx, bst_platform *platform, int64_t n, double seconds,
                                bst_vec3 reaction_nm) BST_MUST_CHECK;
/* True camera attitude at plant step n (seconds = n * dt_s), given the camera's attitude in the
 * body: the body nominal turned by drift * seconds about the (constant) drift vector, or as
 * bst_platform_advance left it where there is a spacecraft; then the camera turned by the jitter
 * about its own x and y axes. */
bst_quat bst_platform_true_camera(bst_platform *platform, int64_t n, double seconds,
                                  bst_quat q_cam_from_body);

/* The same `fraction` (0 to 1) of a step later: the jitter on the straight way to the next step.
 * Inertial platforms only. */
bst_quat bst_platform_true_camera_between(bst_platform *platform, int64_t n, double fraction,
                                          double seconds, bst_quat q_cam_from_body);

/* The body attitude as the attitude sensors report it at plant step n: believed, on an inertial
 * platform plus white noise of attitude_noise_arcsec about each axis. */
bst_quat bst_platform_measured_body(const bst_platform *platform, int64_t n);

/* Number of plant steps between two publications at wanted_hz. BST_ERR_CONFIG, naming the nearest
 * rates, when the plant's rate is no multiple of it. `key` is for the message. */
bst_status bst_platform_divider(bst_ctx *ctx, const char *key, double plant_rate_hz,
                                double wanted_hz, int64_t *out) BST_MUST_CHECK;

/* BST_ERR_CONFIG when the ring of line-of-sight samples does not reach back over an exposure of
 * exposure_s. */
bst_status bst_platform_check_history(bst_ctx *ctx, const bst_platform_config *config,
                                      double exposure_s) BST_MUST_CHECK;

/* Appends a sample to the ring; `capacity` is what bst_step_write said. */
void bst_platform_append_los(bst_los_history *history, int capacity, int64_t tick,
                             bst_quat q_cam_from_gcrf);

/* The body's part of a mount_status: its attitude as measured, rate and wheels. */
void bst_platform_add_status(const bst_platform *platform, bst_quat q_body_seen_from_gcrf,
                             bst_mount_status *out);

#endif
