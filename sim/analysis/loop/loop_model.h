/* Linear analysis of a sensor's control loops: mount servos, tracking loop and spacecraft attitude
 * loop. */
#ifndef BST_ANALYSIS_LOOP_LOOP_MODEL_H
#define BST_ANALYSIS_LOOP_LOOP_MODEL_H

#include "control/control.h"
#include "control/loop/tracking_loop.h"
#include "gimbal/mount/mount_response.h"
#include "sim/engine/scenario/loop_timing.h"
#include "sim/engine/scenario/scenario.h"

enum { BST_LOOP_AXES = 3, BST_LOOP_BODY = 3, BST_LOOP_BANDS = 512, BST_LOOP_HINTS = 16 };

typedef struct bst_loop_options {
    double fix_sigma_px; /* of the stellar attitude of a frame, per axis */
} bst_loop_options;

#define BST_LOOP_DEFAULTS \
    { .fix_sigma_px = 0.01 }

/* Predicted pointing error per axis, RMS in pixels at mid-exposure. */
typedef struct bst_loop_prediction {
    double rms_px;           /* total */
    double jitter_px;        /* jitter after rejection by the loop */
    double open_px;          /* jitter without loop */
    double above_px;         /* part of open_px above half the frame rate, which no loop rejects */
    double noise_px, lag_px; /* from measurement errors; lag behind the drift */
} bst_loop_prediction;

/* A servo loop, opened at the axis drive. */
typedef struct bst_loop_servo {
    bool there, continuous;
    double natural_radps, damping; /* second_order */
    bst_mount_axis_model mount;    /* the full types */
    double hint_hz[2];
    bst_loop loop; /* its `user` points to this struct: do not move it */
    bst_loop_margins margins;
} bst_loop_servo;

typedef struct bst_loop_axis {
    const char *name; /* "outer", "inner" */
    bst_loop_servo servo;
    bool tracked; /* the axis is part of a tracking loop */
    bst_tracking_loop *tracking;
    bst_loop loop;
    bst_loop_margins margins;
    bst_tracking_band bands[BST_LOOP_BANDS]; /* px^2 */
    int band_count;
    bst_loop_prediction prediction;
} bst_loop_axis;

/* Attitude control loop of the spacecraft about a body axis. */
typedef struct bst_loop_body {
    const char *name; /* "x", "y", "z" */
    int number;
    const bst_spacecraft_config *config;
    double hint_hz[BST_LOOP_HINTS];
    bst_loop loop; /* its `user` points to this struct */
    bst_loop_margins margins;
} bst_loop_body;

typedef struct bst_loop_model {
    int observer, sensor;
    const char *observer_name, *sensor_name, *gimbal_type, *compensator;
    double pixel_rad;
    bst_loop_timing timing;
    double command_latency_s;
    bool observes; /* disturbance observer in use: margins as of bst_tracking_open */
    bst_tracking_observer alpha_beta;
    bool lowered;          /* gains reduced by robust_observer */
    bst_compensator gains; /* otherwise */
    int bodies;            /* 0: no attitude loop */
    bst_loop_body body[BST_LOOP_BODY];
    int axes;
    bst_loop_axis axis[BST_LOOP_AXES];
} bst_loop_model;

/* Builds and analyses the loops of a sensor. *out NULL: no commanded mount. BST_ERR_CONFIG: a
 * compensator specification that cannot be met; errors of the modules. */
bst_status bst_loop_model_create(bst_ctx *ctx, const bst_scenario *scenario, int observer,
                                 int sensor, const bst_loop_options *options,
                                 bst_loop_model **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_loop_model_free(bst_loop_model *model);

/* Logs a warning for each loop of a scenario that is unstable or has small margins
 * (bst_loop_verdict). Loops that cannot be analysed are skipped. */
void bst_loop_warn(bst_ctx *ctx, const bst_scenario *scenario);

/* ---- what the files of this folder share ---- */

/* command amplitude below all limits, rad: linear regime */
#define BST_LOOP_TINY 1e-9
/* The mount is at rest at this remaining fraction of the command; the maximum wait is LONGEST. */
#define BST_LOOP_AT_REST 1e-9
#define BST_LOOP_LONGEST_S 60.0

/* Adds a band of constant density (a line if both frequencies are equal); bands beyond the capacity
 * are dropped. */
void bst_loop_add_band(bst_loop_axis *axis, double low_hz, double high_hz, double variance_px2);

/* Adds the platform's jitter bands to a mount axis that rotates about a camera axis (0 x, 1 y),
 * with time step dt_s. */
bst_status bst_loop_platform_bands(bst_ctx *ctx, const bst_platform_config *platform,
                                   double pixel_rad, double dt_s, int camera_axis,
                                   bst_loop_axis *axis) BST_MUST_CHECK;

/* Builds the attitude loops of a rigid_body with an attitude law; nothing for other spacecraft. */
bst_status bst_loop_build_body(bst_ctx *ctx, const bst_spacecraft_config *config,
                               bst_loop_model *model) BST_MUST_CHECK;
/* Adds the bands of the attitude knowledge error about a body axis to a mount axis. */
void bst_loop_body_bands(const bst_spacecraft_config *config, int body_axis, double pixel_rad,
                         bst_loop_axis *axis);

/* Inputs of the tracking loop of an axis besides its model. */
typedef struct bst_loop_tracked {
    const bst_control_config *control; /* NULL: no tracking loop */
    const bst_control_servo_response *servo;
    const bst_platform_config *platform;
    int camera_axis;   /* rotation axis: 0 x, 1 y */
    double drift_pxps; /* image drift along this axis */
    const bst_loop_options *options;
} bst_loop_tracked;

/* Adds platform jitter and attitude errors to an axis and closes its tracking loop. */
bst_status bst_loop_close_tracking(bst_ctx *ctx, const bst_loop_tracked *tracked,
                                   bst_loop_model *model, bst_loop_axis *axis) BST_MUST_CHECK;

/* Builds the axes of a full mount at its initial angles. `type` as bst_mount_type. */
bst_status bst_loop_build_mount(bst_ctx *ctx, int type, const bst_mount_config *config,
                                const bst_control_config *control, const bst_loop_options *options,
                                bst_loop_model *model) BST_MUST_CHECK;

/* ---- loop_report.c ---- */

/* Prints the loops of a sensor, their margins and predicted pointing to stdout. */
void bst_loop_print(const bst_loop_model *model);
struct cJSON;
/* Analysis of one sensor as a JSON object; NULL: out of memory. */
struct cJSON *bst_loop_json(const bst_loop_model *model);

/* ---- loop_plot.c ---- */

/* Plots Bode, Nyquist, step response and rejection of a sensor's loops to PNG or SVG, by the ending
 * of the path. */
bst_status bst_loop_plot(bst_ctx *ctx, const char *path,
                         const bst_loop_model *model) BST_MUST_CHECK;

#endif
