/* Deliberate model error of the mount motion reported by telemetry, to measure the observer's
 * stability margins in simulation. */
#ifndef BST_CONTROL_LOOP_MODEL_ERROR_H
#define BST_CONTROL_LOOP_MODEL_ERROR_H

#include "control/loop/pointing_error.h"
#include "control/modes/aim_history.h"

enum { BST_MODEL_ERROR_SAMPLES = 1024 };

/* Rotation of the boresight by the correction, according to telemetry. */
typedef struct bst_model_error_sample {
    int64_t tick;
    bst_vec3 turned; /* rotation vector in GCRF axes, from the uncorrected aim to the boresight */
    bool known;      /* false during a slew */
} bst_model_error_sample;

/* Model error: the frames show `gain` times the motion that telemetry reports of the correction,
 * late_s later, counted from its onset. To simulate it, the mount is commanded `gain` times the
 * correction, and a frame's attitude is changed by the difference. Gain 1 without delay has no
 * effect. */
typedef struct bst_model_error {
    bool active;
    double gain, late_s, exposure_s, tick_rate_hz, jump_rad;
    int64_t spacing_ticks; /* between samples */
    bst_aim_history aims;  /* uncorrected aims */
    bool slewing;          /* the mount has not settled since slew_tick */
    int64_t slew_tick;     /* latest jump of the aim */
    int64_t telemetry;     /* number of pointing_telemetry samples read */
    int64_t kept;
    bst_model_error_sample items[BST_MODEL_ERROR_SAMPLES]; /* ring */
    int32_t frames;                                        /* number of frames with attitude */
    bool begun;                                            /* the error has started, with: */
    bst_vec3 origin;                                       /* value of `turned` at the onset */
    bst_vec3 estimate; /* observer's correction at the onset, rotation vector */
} bst_model_error;

typedef struct bst_model_error_env {
    double gain, late_s;
    double exposure_s, latency_s; /* of frames; latency from exposure end to control */
    double tick_rate_hz;
    double jump_rad; /* a larger change of the aim between two commands starts a slew */
} bst_model_error_env;

/* Initialises a model error: a wrong gain or a late model. Inactive for gain 1 and no delay. */
void bst_model_error_init(bst_model_error *error, const bst_model_error_env *env);

/* Saves or restores a model error, for bst_module_desc.archive. */
void bst_model_error_archive(bst_model_error *error, bst_archive *archive);

/* Updates the model error with a commanded direction, as bst_pointing_error_uncorrect. */
void bst_model_error_commanded(bst_model_error *error, const bst_pointing_error *observer,
                               int64_t effect_tick, int64_t half_ticks,
                               const bst_vec3 corrected[3]);

/* Updates the model error with telemetry. */
void bst_model_error_telemetry(bst_model_error *error, const bst_pointing_telemetry *telemetry);

/* Correction to command at a tick: the observer's, with its change since the onset scaled by
 * `gain`. */
bst_quat bst_model_error_correction(const bst_model_error *error,
                                    const bst_pointing_error *observer, int64_t tick,
                                    double tick_rate_hz);

/* Attitude fix of a frame as the observer must see it. The error starts once the observer's gains
 * have settled. */
bst_attitude_fix bst_model_error_apply(bst_model_error *error, const bst_pointing_error *observer,
                                       const bst_attitude_fix *fix);

#endif
