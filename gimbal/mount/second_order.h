/* Two-axis gimbal with second-order servos: from commanded direction to camera attitude. */
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

/* Sine and cosine of half an angle; nearby angles follow by series. */
typedef struct bst_mount_two_axis_half {
    double angle_rad, sin, cos;
} bst_mount_two_axis_half;

/* Plant of the two-axis gimbal. At zero angles the camera has the body's axes. The outer axis
 * rotates about body y, the inner one about the rotated x axis (cross-elevation), right-handed. The
 * boresight in body axes is (cos(i) sin(o), -sin(i), cos(i) cos(o)); its poles are along body +-y.
 * The outer axis has no stops; the inner one stops at +-inner_travel_deg. */
typedef struct bst_mount_two_axis {
    bst_axis axis[2]; /* outer, inner */
    bst_platform platform;
    double encoder_noise_rad, inner_travel_rad, settle_tolerance_rad;
    bst_rng_key encoder_key;
    double dt_s;
    int64_t steps;
    /* for the steps from steps - steps % BST_RNG_BLOCK on */
    double encoder_noise[2][BST_RNG_BLOCK];
    bst_mount_two_axis_half near[2]; /* recent axis angles */
    /* results of each step */
    bst_quat q_cam_from_gcrf;      /* true */
    bst_quat q_measured_from_gcrf; /* from encoders and measured body attitude */
    bst_quat q_measured_body_from_gcrf;
    double encoder_rad[2]; /* readings in (-pi, pi] plus noise */
    bool settled, limited, at_stop;
} bst_mount_two_axis;

/* Random streams of a plant. */
typedef struct bst_mount_two_axis_keys {
    bst_rng_key jitter, attitude, encoder;
} bst_mount_two_axis_keys;

/* Initialises the gimbal at rest at zero angles; step 0 is the first. Errors: those of
 * bst_platform_init. */
bst_status bst_mount_two_axis_init(bst_ctx *ctx, bst_mount_two_axis *plant,
                                   const bst_mount_two_axis_config *config,
                                   bst_quat q_nominal_from_gcrf, double pixel_rad, double dt_s,
                                   const bst_mount_two_axis_keys *keys) BST_MUST_CHECK;

/* Archives the axes, the platform and the results of the last step. */
void bst_mount_two_axis_archive(bst_mount_two_axis *plant, bst_archive *archive);

/* Advances the gimbal to step n = 0, 1, 2, ... (time n * dt_s).
 *
 * Given:     command  NULL: hold the angles; evaluated command_age_s after its reference
 *            measure  false: q_measured members are not updated (telemetry is slower than the
 *                     plant) */
void bst_mount_two_axis_step(bst_mount_two_axis *plant, const bst_los_command *command,
                             double command_age_s, bool measure);

/* Mount status as of the last measured step.
 *
 * Given:     out  zero, or from an earlier call for this plant */
void bst_mount_two_axis_status(const bst_mount_two_axis *plant, int64_t tick,
                               bst_mount_status *out);

/* Inverse kinematics: gimbal angles (outer in (-pi, pi], inner in [-pi/2, pi/2]) and rates for a
 * boresight direction in body axes and its time derivative. On the pole the outer angle is
 * outer_at_pole_rad and its rate zero. */
void bst_mount_two_axis_solve(bst_vec3 direction_body, bst_vec3 rate_body_radps,
                              double outer_at_pole_rad, double angle_rad[2], double rate_radps[2]);

/* Camera attitude relative to the body at given angles. */
bst_quat bst_mount_two_axis_attitude(const double angle_rad[2]);

#endif
