/* The linear loops of a scenario's sensor: the mount's servos and the tracking loop round them. */
#ifndef BST_ANALYSIS_LOOP_LOOP_MODEL_H
#define BST_ANALYSIS_LOOP_LOOP_MODEL_H

#include "control/control.h"
#include "control/loop/tracking_loop.h"
#include "gimbal/mount/mount_response.h"
#include "sim/engine/scenario/loop_timing.h"
#include "sim/engine/scenario/scenario.h"

enum { BST_LOOP_AXES = 3, BST_LOOP_BODY = 3, BST_LOOP_BANDS = 512, BST_LOOP_HINTS = 16 };

typedef struct bst_loop_options {
    double fix_sigma_px; /* of the attitude that a frame's stars give, per axis */
} bst_loop_options;

#define BST_LOOP_DEFAULTS \
    { .fix_sigma_px = 0.01 }

/* Per axis, RMS in pixels at the middle of exposures. */
typedef struct bst_loop_prediction {
    double rms_px;           /* of all parts */
    double jitter_px;        /* what the loop leaves of the jitter */
    double open_px;          /* the jitter without a loop */
    double above_px;         /* the part of it above half the frame rate, which no loop rejects */
    double noise_px, lag_px; /* of the frames' errors; behind the drift */
} bst_loop_prediction;

/* A servo's loop, broken where it drives the axis. */
typedef struct bst_loop_servo {
    bool there, continuous;
    double natural_radps, damping; /* second_order */
    bst_mount_axis_model mount;    /* the full types */
    double hint_hz[2];
    bst_loop loop; /* its `user` is this struct, which must stay where it is */
    bst_loop_margins margins;
} bst_loop_servo;

typedef struct bst_loop_axis {
    const char *name; /* "outer", "inner" */
    bst_loop_servo servo;
    bool tracked; /* there is a tracking loop */
    bst_tracking_loop *tracking;
    bst_loop loop;
    bst_loop_margins margins;
    bst_tracking_band bands[BST_LOOP_BANDS]; /* px^2 */
    int band_count;
    bst_loop_prediction prediction;
} bst_loop_axis;

/* The attitude loop of the spacecraft about a body axis. */
typedef struct bst_loop_body {
    const char *name; /* "x", "y", "z" */
    int number;
    const bst_spacecraft_config *config;
    double hint_hz[BST_LOOP_HINTS];
    bst_loop loop; /* its `user` is this struct */
    bst_loop_margins margins;
} bst_loop_body;

typedef struct bst_loop_model {
    int observer, sensor;
    const char *observer_name, *sensor_name, *gimbal_type, *compensator;
    double pixel_rad;
    bst_loop_timing timing;
    double command_latency_s;
    bool observes; /* the observer: margins as of bst_tracking_open */
    bst_tracking_observer alpha_beta;
    bool lowered;          /* its gains are those of robust_observer */
    bst_compensator gains; /* else */
    int bodies;            /* 0: the spacecraft has no loop */
    bst_loop_body body[BST_LOOP_BODY];
    int axes;
    bst_loop_axis axis[BST_LOOP_AXES];
} bst_loop_model;

/* Builds and analyses the loops of a sensor. *out is NULL when it has no mount that moves under
 * command. BST_ERR_CONFIG: a compensator's specification that cannot be met, and what the modules
 * themselves refuse. */
bst_status bst_loop_model_create(bst_ctx *ctx, const bst_scenario *scenario, int observer,
                                 int sensor, const bst_loop_options *options,
                                 bst_loop_model **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_loop_model_free(bst_loop_model *model);

/* Logs a warning for each loop of a scenario that is unstable or has thin margins
 * (bst_loop_verdict); what cannot be analysed is left to those who run it. */
void bst_loop_warn(bst_ctx *ctx, const bst_scenario *scenario);

/* ---- what the files of this folder share ---- */

/* So small a command that no axis meets a limit, rad: the linear regime. */
#define BST_LOOP_TINY 1e-9
/* The mount is at rest when this much of a command is missing; it is waited for up to LONGEST. */
#define BST_LOOP_AT_REST 1e-9
#define BST_LOOP_LONGEST_S 60.0

/* A flat band (a line, where both frequencies are the same); more than there is room for are left
 * out. */
void bst_loop_add_band(bst_loop_axis *axis, double low_hz, double high_hz, double variance_px2);

/* The platform's jitter, as what it does to an axis that turns about a camera axis (0 x, 1 y),
 * stepped every dt_s. */
bst_status bst_loop_platform_bands(bst_ctx *ctx, const bst_platform_config *platform,
                                   double pixel_rad, double dt_s, int camera_axis,
                                   bst_loop_axis *axis) BST_MUST_CHECK;

/* The loops of a rigid_body with an attitude law; nothing of other spacecraft. */
bst_status bst_loop_build_body(bst_ctx *ctx, const bst_spacecraft_config *config,
                               bst_loop_model *model) BST_MUST_CHECK;
/* What the error of its believed attitude about a body axis does to an axis of the mount. */
void bst_loop_body_bands(const bst_spacecraft_config *config, int body_axis, double pixel_rad,
                         bst_loop_axis *axis);

/* What the tracking loop round an axis consists of beside the model. */
typedef struct bst_loop_tracked {
    const bst_control_config *control; /* NULL: no tracking loop */
    const bst_control_servo_response *servo;
    const bst_platform_config *platform;
    int camera_axis;   /* about which the axis turns: 0 x, 1 y */
    double drift_pxps; /* of the image along this axis */
    const bst_loop_options *options;
} bst_loop_tracked;

/* Adds the platform's jitter and attitude errors to an axis, and closes the tracking loop round it.
 */
bst_status bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                   bst_loop_model *model, bst_loop_axis *axis) BST_MUST_CHECK;

/* The axes of a full mount at its start angles. `type` as bst_mount_type. */
bst_status bst_loop_build_mount(bst_ctx *ctx, int type, const bst_mount_config *config,
                                const bst_control_config *control, const bst_loop_options *options,
                                bst_loop_model *model) BST_MUST_CHECK;

/* ---- loop_report.c ---- */

/* Prints the loops of a sensor, their margins and predicted pointing to stdout. */
void bst_loop_print(const bst_loop_model *model);
struct cJSON;
/* The object of one sensor; NULL when out of memory. */
struct cJSON *bst_loop_json(const bst_loop_model *model);

/* ---- loop_plot.c ---- */

/* Bode, Nyquist, step and rejection of a sensor's loops, as PNG or (a path that ends in .svg) SVG.
 */
bst_status bst_loop_plot(bst_ctx *ctx, const char *path,
                         const bst_loop_model *model) BST_MUST_CHECK;

#endif
