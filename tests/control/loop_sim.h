/* A closed loop without images: the gimbal's and the controller's typed cores, a frame a second,
 * stars and target measured with noise, a constant-velocity tracker, and the latencies between. */
#ifndef BST_TESTS_LOOP_SIM_H
#define BST_TESTS_LOOP_SIM_H

#include <stdbool.h>

#include "control/control.h"
#include "gimbal/mount/second_order.h"

#define SIM_TICKS_PER_S 6000
#define SIM_STEP_TICKS 6
#define SIM_PIXEL_RAD (3.0 * BST_ARCSEC_RAD)

typedef struct sim_options {
    uint64_t seed;
    double duration_s;
    double cue_error_x_deg, cue_error_y_deg; /* along image axes */
    double cue_sigma_deg;
    double burn_at_s, burn_mps;            /* unknown to the cue */
    double drop_share;                     /* of frames, at random */
    double dark_from_s, dark_to_s;         /* no detections of the target */
    double blackout_from_s, blackout_to_s; /* no frames at all */
    double detection_probability;
    double drift_arcsec_per_s[3];
    double jitter_low_px_rms, jitter_high_px_rms;
    double centroid_sigma_px, fix_sigma_px;
    bool clutter; /* a false candidate with a plausible rate at each place of the search */
    bst_quat q_body_from_gcrf; /* zero: towards the cue */
    /* detections are of another object, 40 px beside the target at wrong_from_s and 3 px/s faster
     */
    double wrong_from_s, wrong_to_s;
    double frame_delay_s; /* from an exposure's end to the tracks */
    double control_rate_hz;
    double search_timeout_s;
    int search_pattern; /* bst_search_pattern */
    void (*configure)(
        bst_control_config *config); /* changes control's configuration; may be NULL */
    /* control is saved and restored into a new one after so many updates; 0: never */
    int restore_every;
} sim_options;

typedef struct sim_result {
    double confirmed_s;    /* first time of track mode; INFINITY: never */
    double rms_px, p99_px; /* boresight to true target after that, each plant step */
    double track_fraction; /* of the frames after it: in track mode and target held */
    double rms_track_px;   /* in track mode only */
    double rate_worst_radps, accel_worst_radps2;
    int mode_count[BST_MODE_COUNT]; /* entries */
    int final_mode;
    int tiles;            /* greatest search step */
    double worst_jump_px; /* of the command at a change of mode to track */
    double sweep_s;    /* from the first search's beginning until it began again; 0: it did not */
    bst_search search; /* its places */
    int restored;      /* number of restores */
    uint64_t command_hash; /* of all commands, bit by bit */
    double worst_bump_px;  /* at any change of mode: what the command moved less what the aim did */
} sim_result;

sim_options sim_defaults(void);
/* A body attitude whose +y axis points at the target's place at t_s. */
bst_quat sim_body_with_pole_at(double t_s);
void sim_run(const sim_options *options, sim_result *result);

#endif
