/* Payloads of messages that exist only on the link; the others are in
 * include/boresight/messages.h. */
#ifndef BST_LINK_PAYLOADS_H
#define BST_LINK_PAYLOADS_H

#include "boresight/messages.h"

enum { BST_LINK_NAME_BYTES = 64, BST_LINK_TEXT_BYTES = 256 };

/* hello: a peer connects or reconnects. */
typedef struct bst_link_hello {
    char name[BST_LINK_NAME_BYTES];   /* name of the peer, for messages */
    char serves[BST_LINK_TEXT_BYTES]; /* "observer/sensor/module", or "module" of any sensor;
                                         comma-separated; "*": all */
    bool shared_memory; /* the peer is on the same machine and can read shared memory */
} bst_link_hello;

/* A part that a peer plays, with the onboard knowledge of its sensor. */
typedef struct bst_link_part {
    char instance[160]; /* "observer/sensor/module" */
    char role[32];      /* "imgproc", "tracker", "control" */
    int32_t width_px, height_px, bits;
    double pixel_scale_rad;
    double boresight_px[2]; /* x, y of the boresight on the focal plane */
    double psf_fwhm_px;
    double gain_e_per_dn, offset_dn, read_noise_e, dark_e_per_s, full_well_e;
    double flux_v0_e_per_s;      /* electrons per second of a star of V = 0 */
    double exposure_s, period_s; /* as set by the scenario or commanded by control */
    int64_t period_ticks;        /* of the part's own steps; 0: stepped by its inputs */
} bst_link_part;

/* welcome: the answer to a hello. */
typedef struct bst_link_welcome {
    char scenario[BST_LINK_NAME_BYTES];
    char epoch_utc[40];
    int64_t tick_rate_hz;
    int64_t duration_ticks;
    double timeout_s;       /* time-out of the simulation for each step */
    char shared_memory[64]; /* name of the shared memory; "": frames come by the socket */
    int64_t slot_bytes;
    int32_t slots;
    int32_t count;
    bst_link_part parts[];
} bst_link_welcome;

/* step: all inputs of a step were sent. The peer answers with its outputs, then `done`. */
typedef struct bst_link_step {
    int32_t inputs;  /* number of input messages of the step */
    int32_t attempt; /* 0, 1, ...: number of repetitions; one after each hello */
} bst_link_step;

/* done: the peer has sent all outputs of the step in the header. */
typedef struct bst_link_done {
    int32_t outputs; /* number of output messages of the step */
    double busy_s;   /* wall time of the peer's work; 0: unknown */
} bst_link_done;

/* error: a message of the peer was rejected. */
typedef struct bst_link_error {
    int64_t sequence; /* of the rejected message; -1: unreadable */
    char fault[32];
    char text[BST_LINK_TEXT_BYTES];
} bst_link_error;

/* health: state of a peer, at any time. */
typedef struct bst_link_health {
    int32_t state; /* 0 good, 1 degraded, 2 failed: the simulation ends the run */
    char text[BST_LINK_TEXT_BYTES];
} bst_link_health;

/* end: the run has ended, or the peer leaves. */
typedef struct bst_link_end {
    int32_t reason; /* 0 complete, 1 interrupted, 2 failed, 3 the peer leaves */
    char text[BST_LINK_TEXT_BYTES];
} bst_link_end;

/* frame: metadata of the pixels. */
typedef struct bst_link_frame {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_window window;
    int32_t binning, bits;
    int32_t width, height; /* of the image: window size over binning */
} bst_link_frame;

/* pointing_telemetry: samples since the previous message. */
typedef struct bst_link_pointing_telemetry {
    int64_t first;    /* index of the first sample, from 0 */
    int32_t capacity; /* capacity of the onboard ring: history that modules can read */
    int32_t count;
    bst_quat q_body_from_gcrf;
    bool settled, limited;
    bst_pointing_sample items[];
} bst_link_pointing_telemetry;

/* pointing: true camera attitudes of an exposure or another time span. */
typedef struct bst_link_pointing {
    int32_t count;
    bst_los_sample items[];
} bst_link_pointing;

/* target_states: states of objects that the peer commands. */
typedef struct bst_link_target_state {
    char object[BST_LINK_NAME_BYTES];
    int64_t tick;
    bst_vec3 position_gcrf_m, velocity_gcrf_mps;
} bst_link_target_state;

typedef struct bst_link_target_states {
    int32_t count;
    bst_link_target_state items[];
} bst_link_target_states;

/* target_attitudes: attitudes of objects with a shape that the peer commands. */
typedef struct bst_link_target_attitude {
    char object[BST_LINK_NAME_BYTES];
    int64_t tick;
    bst_quat q_body_from_gcrf;
    bst_vec3 rate_body_radps;
} bst_link_target_attitude;

typedef struct bst_link_target_attitudes {
    int32_t count;
    bst_link_target_attitude items[];
} bst_link_target_attitudes;

#endif
