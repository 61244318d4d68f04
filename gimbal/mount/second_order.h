/* Two-axis gimbal on a drifting spacecraft: turns a commanded direction into a camera attitude. */
#ifndef BST_GIMBAL_MOUNT_SECOND_ORDER_H
#define BST_GIMBAL_MOUNT_SECOND_ORDER_H

#include "gimbal/mount/axis.h"
#include "gimbal/platform.h"

typedef struct bst_mount_two_axis_config {
    double rate_limit_degps;
    double accel_limit_degps2;
    double natural_frequency_hz;
    double damping;
    double encoder_noise_arcsec;
    double inner_travel_deg;
    double settle_tolerance_arcsec;
    bst_platform_config platform;
} bst_mount_two_axis_config;

extern const bst_config_desc bst_two_axis_config_table[];

/* Sine and cosine of half an angle, from which those of angles nearby follow by series. */
typedef struct bst_mount_two_axis_half {
    double angle_rad, sin, cos;
} bst_mount_two_axis_half;

/* The plant. At zero angles the camera has the body's axes; the outer axis turns about body y, the
 * inner one about the turned x axis (cross-elevation), right-handed. The boresight in body axes is
 * (cos(i) sin(o), -sin(i), cos(i) cos(o)): its poles lie along body +-y. The outer axis has no
 * stops; the inner one stops at +-inner_travel_deg. */
typedef struct bst_mount_two_axis {
    bst_axis axis[2]; /* outer, inner */
    bst_platform platform;
    double encoder_noise_rad, inner_travel_rad, settle_tolerance_rad;
    bst_rng_key encoder_key;
    double dt_s;
    int64_t steps;
    double encoder_noise[2][BST_RNG_BLOCK]; /* of the steps from steps - steps % BST_RNG_BLOCK on */
    bst_mount_two_axis_half near[2];        /* the axes' angles not long ago */
    /* after each step */
    bst_quat q_cam_from_gcrf;      /* true */
    bst_quat q_measured_from_gcrf; /* encoders and measured body attitude */
    bst_quat q_measured_body_from_gcrf;
    double encoder_rad[2]; /* readings in (-pi, pi] plus noise */
    bool settled, limited, at_stop;
} bst_mount_two_axis;

/* Random streams of a plant. */
typedef struct bst_mount_two_axis_keys {
    bst_rng_key jitter, attitude, encoder;
} bst_mount_two_axis_keys;

/* At rest at zero angles; step 0 is the first. Errors as bst_platform_init. */
bst_status bst_mount_two_axis_init(bst_ctx *ctx, bst_mount_two_axis *plant,
                                   const bst_mount_two_axis_config *config,
                                   bst_quat q_nominal_from_gcrf, double pixel_rad, double dt_s,
                                   const bst_mount_two_axis_keys *keys) BST_MUST_CHECK;

/* Brings the plant to step n = 0, 1, 2, ... (time n * dt_s). `command` (NULL: hold the angles) is
 * evaluated at that time, command_age_s after its reference. With measure false the q_measured
 * members are left alone (telemetry is slower than the plant). */
void bst_mount_two_axis_step(bst_mount_two_axis *plant, const bst_los_command *command,
                             double command_age_s, bool measure);

/* Geometry, limits and state as of the last step that measured; `out` zero, or of an earlier call
 * for this plant. */
void bst_mount_two_axis_status(const bst_mount_two_axis *plant, int64_t tick,
                               bst_mount_status *out);

/* Gimbal angles (outer in (-pi, pi], inner in [-pi/2, pi/2]) and their rates that put the boresight
 * on a body-axes direction with its time derivative. On the pole the outer angle is
 * outer_at_pole_rad and its rate zero. */
void bst_mount_two_axis_solve(bst_vec3 direction_body, bst_vec3 rate_body_radps,
                              double outer_at_pole_rad, double angle_rad[2], double rate_radps[2]);

/* Camera attitude in the body at given angles. */
bst_quat bst_mount_two_axis_attitude(const double angle_rad[2]);

#endif
