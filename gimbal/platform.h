/* Spacecraft platform of the gimbal: true attitude (drift or dynamics, jitter), estimated attitude,
 * and publication of its state. */
#ifndef BST_GIMBAL_PLATFORM_H
#define BST_GIMBAL_PLATFORM_H

#include "boresight/config.h"
#include "boresight/module.h"
#include "boresight/status.h"
#include "gimbal/jitter/jitter_spectrum.h"
#include "gimbal/spacecraft/spacecraft.h"

/* "platform" block of a gimbal's configuration. */
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
    bst_quat q_nominal_from_gcrf; /* at the epoch; constant for an inertial spacecraft */
    /* inertial: nominal rotated by the bias; else the current estimate */
    bst_quat q_believed_from_gcrf;
    bst_vec3 rate_believed_radps; /* body axes; inertial: zero */
    bst_body_state body;          /* true, as set by bst_platform_advance */
    bst_vec3 drift_radps;         /* body axes */
    double attitude_noise_rad;
    bst_rng_key attitude_key;
    bst_jitter jitter;
    /* variance per axis missing between the samples: of jitter and of wheel imbalance */
    double unresolved_rad2;
    double jitter_unresolved_rad2; /* the jitter part only */
    bst_spacecraft *spacecraft;    /* owned; NULL: inertial */
    struct bst_platform_sky *sky;  /* owned */
    bool wheels_saturated;         /* at their speed or torque limit */
    bool trackers_blind;           /* no star tracker saw stars at the last measurement */
} bst_platform;

/* Jitter spectrum of a configuration.
 *
 * Given:     pixel_rad  angle of a sensor pixel
 * Errors:    those of bst_jitter_spectrum_create; BST_ERR_CONFIG if the high band is empty
 * Ownership: free with bst_jitter_spectrum_free */
bst_status bst_platform_jitter_spectrum(bst_ctx *ctx, const bst_platform_config *config,
                                        double pixel_rad, bst_jitter_spectrum *out) BST_MUST_CHECK;

/* Inputs of a platform besides its configuration. */
typedef struct bst_platform_setup {
    bst_quat q_nominal_from_gcrf; /* of the body at the epoch */
    double pixel_rad;             /* angle of a sensor pixel; jitter is configured in pixels */
    double dt_s;                  /* plant step */
    bst_rng_key jitter_key, attitude_key;
} bst_platform_setup;

/* Initialises a platform. Errors: those of bst_platform_jitter_spectrum. Free it with
 * bst_platform_free. */
bst_status bst_platform_init(bst_ctx *ctx, bst_platform *platform,
                             const bst_platform_config *config,
                             const bst_platform_setup *setup) BST_MUST_CHECK;

/* Creates the spacecraft of a platform configured as `rigid_body`, in the world of the module's
 * sensor; nothing for an inertial one. Errors: those of bst_spacecraft_create. bst_platform_free
 * frees it. */
bst_status bst_platform_equip(const bst_module_env *env, bst_platform *platform,
                              const bst_platform_config *config, double dt_s) BST_MUST_CHECK;
/* Checks that a mount of this inertia (kg m^2, in the order of bst_spacecraft_spec) is light enough
 * for its spacecraft. Its reaction torque acts one step late, which is stable while the mount's
 * inertia is less than the remaining inertia; less than half of it is required. Errors:
 * BST_ERR_CONFIG. */
bst_status bst_platform_check_mount(bst_ctx *ctx, const bst_platform *platform,
                                    const double mount_kgm2[6]) BST_MUST_CHECK;
/* Frees what bst_platform_init and bst_platform_equip allocated; a zeroed platform is allowed. */
void bst_platform_free(bst_platform *platform);

/* largest step number in a saved state: later ones stay within int64_t */
#define BST_PLANT_STEPS_MOST (INT64_MAX / 4)

/* Archives attitude and rate of the body, true and estimated, and its spacecraft. The jitter is not
 * archived: it depends only on the step number. */
void bst_platform_archive(bst_platform *platform, bst_archive *archive);

/* Advances the body to plant step n = 0, 1, 2, ... in order, `seconds` after the epoch. Updates
 * body, q_believed_from_gcrf, rate_believed_radps, unresolved_rad2 and the flags.
 *
 * Given:     reaction_nm  torque of the mount on the body over the previous step, N m, body axes;
 *                         no effect on an inertial body
 * Errors:    those of bst_spacecraft_step
 * Notes:     an inertial platform needs the call only if `body` is used */
bst_status bst_platform_advance(bst_ctx *ctx, bst_platform *platform, int64_t n, double seconds,
                                bst_vec3 reaction_nm) BST_MUST_CHECK;
/* True camera attitude at plant step n (seconds = n * dt_s), given the camera's attitude relative
 * to the body. The body is nominal, rotated by drift * seconds about the constant drift vector, or
 * as set by bst_platform_advance. The camera is then rotated by the jitter about its own x and y
 * axes. */
bst_quat bst_platform_true_camera(bst_platform *platform, int64_t n, double seconds,
                                  bst_quat q_cam_from_body);

/* True camera attitude a `fraction` (0 to 1) of a step later, with the jitter interpolated linearly
 * to the next step. Inertial platforms only. */
bst_quat bst_platform_true_camera_between(bst_platform *platform, int64_t n, double fraction,
                                          double seconds, bst_quat q_cam_from_body);

/* Body attitude reported by the attitude sensors at plant step n: the estimate, on an inertial
 * platform plus white noise of attitude_noise_arcsec about each axis. */
bst_quat bst_platform_measured_body(const bst_platform *platform, int64_t n);

/* Number of plant steps between publications at wanted_hz.
 *
 * Given:     key  configuration key, for the message
 * Errors:    BST_ERR_CONFIG, naming the nearest rates, if the plant rate is no multiple of it */
bst_status bst_platform_divider(bst_ctx *ctx, const char *key, double plant_rate_hz,
                                double wanted_hz, int64_t *out) BST_MUST_CHECK;

/* Checks that the ring of line-of-sight samples covers an exposure of exposure_s. Errors:
 * BST_ERR_CONFIG. */
bst_status bst_platform_check_history(bst_ctx *ctx, const bst_platform_config *config,
                                      double exposure_s) BST_MUST_CHECK;

/* Appends a line-of-sight sample to the ring.
 *
 * Given:     capacity  from bst_step_write */
void bst_platform_append_los(bst_los_history *history, int capacity, int64_t tick,
                             bst_quat q_cam_from_gcrf);

/* Adds the body's part to a mount_status: measured attitude, rate and wheels. */
void bst_platform_add_status(const bst_platform *platform, bst_quat q_body_seen_from_gcrf,
                             bst_mount_status *out);

#endif
