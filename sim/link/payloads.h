/* The payloads that only the link has; the others are those of include/boresight/messages.h. */
#ifndef BST_LINK_PAYLOADS_H
#define BST_LINK_PAYLOADS_H

#include "boresight/messages.h"

enum { BST_LINK_NAME_BYTES = 64, BST_LINK_TEXT_BYTES = 256 };

/* hello: a peer comes, or comes back. */
typedef struct bst_link_hello {
    char name[BST_LINK_NAME_BYTES];   /* for messages */
    char serves[BST_LINK_TEXT_BYTES]; /* "observer/sensor/module", or "module" of any sensor;
                                         several with commas between; "*": all */
    bool shared_memory;               /* it is on the same machine and would take frames that way */
} bst_link_hello;

/* A part that a peer plays, and what its sensor is known to be on board. */
typedef struct bst_link_part {
    char instance[160]; /* "observer/sensor/module" */
    char role[32];      /* "imgproc", "tracker", "control" */
    int32_t width_px, height_px, bits;
    double pixel_scale_rad;
    double boresight_px[2]; /* x, y of the boresight on the focal plane */
    double psf_fwhm_px;
    double gain_e_per_dn, offset_dn, read_noise_e, dark_e_per_s, full_well_e;
    double flux_v0_e_per_s;      /* electrons per second of a star of V = 0 */
    double exposure_s, period_s; /* as the scenario sets or control commands them */
    int64_t period_ticks;        /* of the part's own steps; 0: on its inputs alone */
} bst_link_part;

/* welcome: the answer to a hello. */
typedef struct bst_link_welcome {
    char scenario[BST_LINK_NAME_BYTES];
    char epoch_utc[40];
    int64_t tick_rate_hz;
    int64_t duration_ticks;
    double timeout_s;       /* for which the simulation waits in each step */
    char shared_memory[64]; /* name of the object that frames lie in; "": they come by the socket */
    int64_t slot_bytes;
    int32_t slots;
    int32_t count;
    bst_link_part parts[];
} bst_link_welcome;

/* step: all inputs of a step have been sent; the peer answers with its outputs, then `done`. */
typedef struct bst_link_step {
    int32_t inputs;  /* messages that belonged to it */
    int32_t attempt; /* 0, 1, ...: how often it has been sent: again after each hello */
} bst_link_step;

/* done: the peer has sent the outputs of the step that the header names. */
typedef struct bst_link_done {
    int32_t outputs; /* messages that belonged to it */
    double busy_s;   /* wall time that the peer worked on it; 0: not told */
} bst_link_done;

/* error: a message of the peer has not been taken. */
typedef struct bst_link_error {
    int64_t sequence; /* of that message; -1: it could not be read */
    char fault[32];
    char text[BST_LINK_TEXT_BYTES];
} bst_link_error;

/* health: at any time. */
typedef struct bst_link_health {
    int32_t state; /* 0 well, 1 degraded, 2 failed: the simulation then ends the run */
    char text[BST_LINK_TEXT_BYTES];
} bst_link_health;

/* end: the run is over, or the peer leaves. */
typedef struct bst_link_end {
    int32_t reason; /* 0 complete, 1 interrupted, 2 failed, 3 the peer leaves */
    char text[BST_LINK_TEXT_BYTES];
} bst_link_end;

/* frame: what goes before the pixels. */
typedef struct bst_link_frame {
    int64_t exposure_id;
    int64_t start_tick, end_tick;
    bst_window window;
    int32_t binning, bits;
    int32_t width, height; /* of the image: the window over the binning */
} bst_link_frame;

/* pointing_telemetry: the samples that are new since the message before. */
typedef struct bst_link_pointing_telemetry {
    int64_t first;    /* number of the first of these samples, from 0 */
    int32_t capacity; /* of the ring on board: how far back modules can look */
    int32_t count;
    bst_quat q_body_from_gcrf;
    bool settled, limited;
    bst_pointing_sample items[];
} bst_link_pointing_telemetry;

/* pointing: true attitudes of the camera over an exposure or any other time. */
typedef struct bst_link_pointing {
    int32_t count;
    bst_los_sample items[];
} bst_link_pointing;

/* target_states: where objects are that the peer steers. */
typedef struct bst_link_target_state {
    char object[BST_LINK_NAME_BYTES];
    int64_t tick;
    bst_vec3 position_gcrf_m, velocity_gcrf_mps;
} bst_link_target_state;

typedef struct bst_link_target_states {
    int32_t count;
    bst_link_target_state items[];
} bst_link_target_states;

#endif
