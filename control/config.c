#include "control/control.h"

/* order of the enums in control.h and search_pattern.h */
static const char *const strategies[] = {"track", "stare", "rate", "fixed", "scan", NULL};
static const char *const patterns[] = {"nearest_first", "raster", "spiral", "belt", NULL};
static const char *const dwell_rates[] = {"belt", "sidereal", NULL};
static const char *const attitudes[] = {"telemetry", "unknown", NULL};
static const char *const fixed_frames[] = {"inertial", "body", NULL};

static const bst_config_desc compensator_table[] = {
    BST_COMPENSATOR_KEYS(bst_control_compensators, "\"observer\""), BST_CONFIG_END};

static const bst_config_desc exposure_table[] = {
    BST_REAL(bst_control_exposure, time_s, "s", 0, 1e9, NULL, "Time after the epoch."),
    BST_REAL(bst_control_exposure, exposure_s, "s", 1e-9, 3600, NULL,
             "Exposure time asked of the sensor from then on."),
    BST_CONFIG_END};

#define C bst_control_config
const bst_config_desc bst_control_config_table[] = {
    BST_ENUM(C, strategy, strategies, "\"track\"",
             "track: closed loop; stare: inertially at the cue's place at stare_time_s; rate: open "
             "loop along the cue; fixed: at fixed_direction; scan: along the cue's region."),
    BST_REAL(C, stare_time_s, "s", -1e6, 1e9, "0",
             "strategy stare: time after the epoch whose cue is stared at."),
    BST_ENUM(C, fixed_frame, fixed_frames, "\"inertial\"",
             "strategy fixed: axes of fixed_direction: GCRF, or the body's."),
    BST_REALS(C, fixed_direction, "", -1, 1, "[0, 0, 1]",
              "strategy fixed: where the boresight is held, a direction of any length."),
    BST_REAL(C, scan_rate_arcsec_per_s, "arcsec/s", -36000, 36000, "60",
             "strategy scan: rate along the middle of the cue's region, from its first end to the "
             "second and back; negative: from the second end on."),
    BST_ENUM(C, attitude, attitudes, "\"telemetry\"",
             "Attitude at the start. unknown: mode lost until the tracker has an attitude from "
             "stars; with imgproc/attitude unknown."),
    BST_INT(C, lost_after_frames, "frames", 0, 1000000, "0",
            "After so many frames in a row without an attitude from stars, with the servo settled, "
            "the mode is lost until there is one again; 0: never."),
    BST_BOOL(
        C, lost_hold, "true",
        "Mode lost: the line of sight is held at rest by the telemetry, whose error in attitude "
        "does not matter for that, so that the stars of a turning spacecraft become points. "
        "false: nothing is commanded."),
    BST_REAL(C, exposure_s, "s", 0, 3600, "0",
             "Exposure time asked of the sensor; 0 leaves the sensor's own."),
    BST_REAL(C, period_s, "s", 0, 3600, "0",
             "Frame period asked of the sensor; 0 leaves the sensor's own."),
    BST_LIST(C, exposure_schedule, bst_control_exposure, exposure_table, 0, 10000, "[]",
             "Exposure times from given times on, as for a target that comes nearer; in order of "
             "time."),
    BST_REAL(C, command_latency_s, "s", 0, 60, "0.1",
             "Time from a command's publication to its effect: the instant it is computed for."),
    BST_BOOL(C, compensate_attitude, "true",
             "Correct the pointing by what identified stars say of the attitude."),
    BST_OBJECT(
        C, compensator, compensator_table, "{}",
        "How the correction follows from the frames: observer, a Kalman filter of the "
        "telemetry's error by disturbance_px_rms and what follows; or a compensator on the "
        "image error whose output is the rate at which the correction turns, rad/s per rad."),
    BST_REAL(C, servo_lag_s, "s", 0, 10, "0.025",
             "How late the mount follows a change of its command (second_order: 0.025), for a "
             "compensator's specification."),
    BST_BOOL(C, robust_observer, "true",
             "Compensator observer: lower its gains where the frame period and the latency ask for "
             "it, until its loop has a gain margin of 6 dB, a phase margin of 30 deg and a "
             "sensitivity peak of at most 2; false: the gains of the disturbance below, whatever "
             "the margins."),
    BST_REAL(C, disturbance_px_rms, "px", 1e-6, 1000, "0.5",
             "Expected slow jitter (radial RMS), for the compensator's gains."),
    BST_REAL(C, disturbance_cutoff_hz, "Hz", 1e-6, 100, "0.05",
             "Highest frequency of the slow jitter, for the compensator's gains."),
    BST_REAL(C, fix_sigma_floor_px, "px", 1e-6, 100, "0.04",
             "Attitude fixes are never taken to be better than this."),
    BST_REAL(C, attitude_sigma_arcsec, "arcsec", 1e-6, 360000, "60",
             "Expected error of the spacecraft's own attitude at the start (1 sigma)."),
    BST_REAL(C, drift_sigma_arcsec_per_s, "arcsec/s", 1e-6, 3600, "10",
             "Expected drift rate of the body at the start (1 sigma)."),
    BST_REAL(C, arrival_tolerance_px, "px", 0.01, 10000, "20",
             "A slew has arrived when the servo has settled within this of the aim."),
    BST_FORMER("arrive_tolerance_px", "arrival_tolerance_px"),
    BST_ENUM(C, search_pattern, patterns, "\"nearest_first\"",
             "Order of the places of a search: by distance from the middle; row by row, there and "
             "back; round about the middle; or, in a region, across it step by step along it."),
    BST_ENUM(C, search_rate, dwell_rates, "\"belt\"",
             "How the boresight moves while it dwells on a place of the cue's region: with what "
             "moves as the geostationary belt does, or with the stars."),
    BST_REAL(C, search_timeout_s, "s", 0, 1e9, "0",
             "A search that has found nothing after this time is given up; 0: never."),
    BST_REAL(C, search_sigmas, "", 0, 20, "3",
             "The search covers this many sigma of the cue's error each way, per image axis."),
    BST_REAL(C, search_max_deg, "deg", 0, 90, "2", "The search never reaches farther than this."),
    BST_REAL(C, search_step, "", 0.05, 1, "0.85",
             "Distance of neighbouring search fields, as a fraction of the field of view."),
    BST_INT(C, dwell_frames, "frames", 1, 10000, "4",
            "Frames exposed wholly at rest at each place of the search. Two of them must show the "
            "target, which three do not surely do near the detection limit."),
    BST_REAL(C, dwell_timeout_s, "s", 0.001, 1e6, "30",
             "The search goes on after this time when frames fail to come."),
    BST_INT(C, candidate_hits, "frames", 1, 1000, "2",
            "Detections that make a tentative track with a plausible rate a candidate."),
    BST_REAL(C, candidate_rate_sigmas, "", 0.1, 1000, "4",
             "A candidate's rate is within this many sigma of the cue's."),
    BST_REAL(C, candidate_score, "", 0, 1e3, "7",
             "Least log-likelihood ratio of a candidate against chance pairings of detections."),
    BST_REAL(C, acquire_timeout_s, "s", 0.1, 1e6, "20",
             "A candidate that is not confirmed within this time is given up."),
    BST_REAL(C, track_handover_px, "px", 0.01, 10000, "3",
             "Track mode begins when the target is within this of the boresight."),
    BST_FORMER("track_entry_px", "track_handover_px"),
    BST_REAL(C, reacquire_coast_s, "s", 0, 1e6, "20",
             "A lost target is awaited at its predicted place for this time before the search."),
    BST_REAL(C, reacquire_extent_deg, "deg", 0, 90, "1",
             "How far each way from its predicted place a lost target is searched."),
    BST_OBJECT(C, guidance, bst_guidance_config_table, "{}",
               "Slews, keep-out zones, and what is seen coming."),
    BST_CONFIG_END};
#undef C
