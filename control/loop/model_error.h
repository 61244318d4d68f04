/* A deliberate error of what telemetry reports of the mount's motion: with it the observer's
 * margins can be found in a simulation. */
#ifndef BST_CONTROL_LOOP_MODEL_ERROR_H
#define BST_CONTROL_LOOP_MODEL_ERROR_H

#include "control/loop/pointing_error.h"
#include "control/modes/aim_history.h"

enum { BST_MODEL_ERROR_SAMPLES = 1024 };

/* How far the correction turned the boresight, by telemetry. */
typedef struct bst_model_error_sample {
    int64_t tick;
    bst_vec3 turned; /* rotation vector in GCRF axes, from the uncorrected aim to the boresight */
    bool known;      /* not in a slew */
} bst_model_error_sample;

/* The frames show `gain` times the motion that telemetry reports of the correction, late_s later.
 * The motion counts from where the error set in. What makes it so: the mount is commanded `gain`
 * times the correction, and a frame's attitude is changed by what telemetry should and does report.
 * Of gain 1 and no delay it does nothing. */
typedef struct bst_model_error {
    bool active;
    double gain, late_s, exposure_s, tick_rate_hz, jump_rad;
    int64_t spacing_ticks; /* between samples */
    bst_aim_history aims;  /* uncorrected */
    bool slewing;          /* the mount has not been seen to arrive since slew_tick */
    int64_t slew_tick;     /* the latest jump of the aim */
    int64_t telemetry;     /* samples of pointing_telemetry that have been read */
    int64_t kept;
    bst_model_error_sample items[BST_MODEL_ERROR_SAMPLES]; /* ring */
    int32_t frames;                                        /* with an attitude so far */
    bool begun;                                            /* the error has set in, with: */
    bst_vec3 origin;                                       /* `turned` */
    bst_vec3 estimate; /* the observer's correction, as a rotation vector */
} bst_model_error;

typedef struct bst_model_error_env {
    double gain, late_s;
    double exposure_s, latency_s; /* of frames, from an exposure's end until control has it */
    double tick_rate_hz;
    double jump_rad; /* an aim that moves by more between two commands starts a slew */
} bst_model_error_env;

/* Initialises a model error: a wrong gain or a late model. Inactive for gain 1 and no delay. */
void bst_model_error_init(bst_model_error *error, const bst_model_error_env *env);

/* Takes in a commanded direction, as bst_pointing_error_uncorrect. */
void bst_model_error_commanded(bst_model_error *error, const bst_pointing_error *observer,
                               int64_t effect_tick, int64_t half_ticks,
                               const bst_vec3 corrected[3]);

/* Takes in what telemetry says. */
void bst_model_error_telemetry(bst_model_error *error, const bst_pointing_telemetry *telemetry);

/* The correction that is commanded for a tick: the observer's, its change since the error set in
 * times `gain`. */
bst_quat bst_model_error_correction(const bst_model_error *error,
                                    const bst_pointing_error *observer, int64_t tick,
                                    double tick_rate_hz);

/* The attitude of a frame as the observer has to see it. The error sets in after enough attitudes
 * for the observer's gains to have settled. */
bst_attitude_fix bst_model_error_apply(bst_model_error *error, const bst_pointing_error *observer,
                                       const bst_attitude_fix *fix);

#endif
