#include "tracker/tracker.h"

#define C bst_tracker_config

/* order of bst_mtt_association */
static const char *const motions[] = {"constant_rate", "orbit", NULL};
static const char *const associations[] = {"gnn", "nearest", "pda", "mixture", "pmb", NULL};

const bst_config_desc bst_tracker_config_table[] = {
    BST_REAL(C, star_systematic_px, "px", 0, 10, "0",
             "Standard deviation added to every star's centroid (catalogue, distortion)."),
    BST_FORMER("star_floor_px", "star_systematic_px"),
    BST_REAL(C, star_reject_chi2, "", 4, 1e6, "18.4",
             "Stars that fit worse (2 degrees of freedom) do not count for the attitude."),
    BST_REAL(
        C, max_attitude_sigma_px, "px", 1e-3, 1e3, "2",
        "Frames whose attitude, and detections whose place, is worse than this are not used for "
        "tracking."),
    BST_REAL(C, max_roll_sigma_arcsec, "arcsec", 1e-3, 1e6, "600",
             "A fix with a worse roll about the boresight is not valid."),
    BST_REAL(C, drift_sigma_arcsec_per_s, "arcsec/s", 0, 1e5, "20",
             "Standard deviation of the attitude telemetry's drift before any fix."),
    BST_REAL(C, drift_noise_arcsec_per_s15, "arcsec/s^1.5", 0, 1e5, "0.3",
             "Random walk of the telemetry's drift rate."),
    BST_REAL(C, jitter_px, "px", 0, 100, "0.2",
             "Attitude error of a frame that the next frame does not share."),
    BST_REAL(C, telemetry_sigma_arcsec, "arcsec", 0, 1e6, "60",
             "Standard deviation of the attitude telemetry before any fix."),
    BST_REAL(C, process_noise_arcsec_per_s15, "arcsec/s^1.5", 0, 1e4, "0.02",
             "Square root of the power spectral density of the objects' angular acceleration."),
    BST_REAL(C, steady_noise_share, "", 1e-3, 1, "0.1",
             "Confirmed tracks learn whether their object needs process_noise_arcsec_per_s15 or "
             "only this share of it; 1: all have process_noise_arcsec_per_s15. Not with type imm."),
    BST_REAL(C, gate_chi2, "", 1, 1e3, "16", "Gate of a detection, 2 degrees of freedom."),
    BST_REAL(
        C, detection_probability, "", 0.01, 0.999, "0.9",
        "Believed probability that an object in the field, far above the detection threshold, is "
        "detected."),
    BST_REAL(C, false_alarms_per_frame, "", 1e-6, 1e6, "1",
             "Least number of false alarms per frame that is believed; more is learnt."),
    BST_INT(C, confirm_hits, "", 2, 100, "3", "Hits that confirm a track (M of N)."),
    BST_INT(C, confirm_frames, "", 2, 100, "5",
            "Frames within which they must come (M of N); with pmb the existence probability "
            "decides."),
    BST_REAL(C, confirm_score, "", 0, 1e3, "12",
             "Least log-likelihood ratio against clutter of a confirmed track."),
    BST_REAL(C, max_rate_arcsec_per_s, "arcsec/s", 0, 1e5, "120",
             "Largest rate of tracks that start without the cue's help."),
    BST_REAL(C, cue_rate_margin_arcsec_per_s, "arcsec/s", 0, 1e5, "2",
             "Tracks may start within this and four sigma of the cue's rate."),
    BST_REAL(C, initiation_gap_s, "s", 1e-3, 1e4, "5",
             "Longest time between the two detections that start a track."),
    BST_INT(C, max_misses, "", 0, 10000, "12",
            "Frames in a row without a detection after which a confirmed track is deleted. Tracks "
            "that the cue explains, and the target, are kept for max_coast_s."),
    BST_REAL(C, max_coast_s, "s", 0, 1e6, "120",
             "Longest time without a detection, in the field or not."),
    BST_REAL(C, max_sigma_arcsec, "arcsec", 0.01, 1e6, "60",
             "A track whose direction is worse than this is deleted."),
    BST_REAL(C, merge_distance_px, "px", 0, 100, "6",
             "Objects nearer to each other than this may share one detection."),
    BST_FORMER("merge_px", "merge_distance_px"),
    BST_REAL(C, merged_systematic_px, "px", 0, 100, "0.3",
             "Standard deviation added to a shared detection."),
    BST_FORMER("merge_floor_px", "merged_systematic_px"),
    BST_REAL(C, object_systematic_px, "px", 0, 10, "0.02",
             "Standard deviation added to the centroid of every detection that is not a star."),
    BST_FORMER("object_floor_px", "object_systematic_px"),
    BST_REAL(C, blended_systematic_px, "px", 0, 100, "0.5",
             "Standard deviation added to detections flagged as blends or at an edge."),
    BST_FORMER("blend_sigma_px", "blended_systematic_px"),
    BST_REAL(C, edge_margin_px, "px", 0, 1000, "4",
             "Tracks nearer to the sensor's edge than this are not missed when undetected."),
    BST_REAL(C, cue_acceleration_radius_deg, "deg", 0, 90, "5",
             "Tracks this near to the cue follow its acceleration."),
    BST_FORMER("feed_forward_deg", "cue_acceleration_radius_deg"),
    BST_REAL(C, target_direction_chi2, "", 0, 1e6, "18.4",
             "Largest misfit of the target's direction to the cue, 2 degrees of freedom."),
    BST_REAL(C, target_rate_chi2, "", 0, 1e6, "11.8",
             "Largest misfit of the target's rate to the cue, 2 degrees of freedom."),
    BST_REAL(C, target_magnitude_chi2, "", 0, 1e6, "16",
             "Largest misfit of the target's brightness to the cue."),
    BST_REAL(
        C, target_release_chi2, "", 0, 1e9, "200",
        "A kept target whose rate misfits the cue by more is let go when it has become a star's, "
        "or "
        "has jumped by more while the target was not seen alone; a manoeuvre seen frame by frame "
        "lets nothing go."),
    BST_REAL(C, target_rate_systematic_arcsec_per_s, "arcsec/s", 0, 1e4, "0.1",
             "Standard deviation of the cue's rate beyond what the cue states."),
    BST_FORMER("target_rate_floor_arcsec_per_s", "target_rate_systematic_arcsec_per_s"),
    BST_REAL(C, target_max_rate_sigma_arcsec_per_s, "arcsec/s", 1e-6, 1e4, "0.8",
             "A track is judged against the cue once its rate is known to this, or while it "
             "manoeuvres."),
    BST_REAL(C, target_dormant_s, "s", 0, 1e6, "600",
             "A lost target's extrapolated place binds the next choice for this long."),
    BST_FORMER("target_memory_s", "target_dormant_s"),
    BST_INT(C, target_min_hits, "", 2, 1000, "4",
            "Fewest hits of a new target; one more for every 2 of its chi-square against the cue."),
    BST_REAL(C, stationary_rate_arcsec_per_s, "arcsec/s", 0, 1e4, "0.5",
             "What is slower than this is taken for a star unless the cue expects it so slow; 0: "
             "nothing is."),
    BST_FORMER("star_rate_arcsec_per_s", "stationary_rate_arcsec_per_s"),
    BST_REAL(C, motion_chi2, "", 0, 1e6, "25",
             "A track moves when its rate misfits rest by more, 2 degrees of freedom."),
    BST_INT(C, max_tracks, "", 1, 100000, "256", "Room for tracks of what may move."),
    BST_INT(C, max_stationary_tracks, "", 0, 100000, "4096",
            "Room for what is at rest: stars that the catalogue lacks."),
    BST_FORMER("max_stars", "max_stationary_tracks"),
    BST_INT(C, max_detections, "", 1, 1000000, "8192",
            "Room for detections of one frame that are not stars."),
    BST_ENUM(
        C, association, associations, "\"pmb\"",
        "pmb: joint probabilities of all tracks and detections, existence probabilities beside "
        "confirm_score, and measurements merged of two tracks (Poisson multi-Bernoulli); every "
        "pair of detections starts a track, and the likeliest choices live on apart until later "
        "detections decide. mixture: each confirmed track on its own weighs every detection in "
        "its gate by its probability, with choices that live on apart; with type imm the same as "
        "pda. pda: as mixture, with one Gaussian. gnn: the assignment of least total cost. "
        "nearest: the cheapest pair first."),
    BST_ENUM(
        C, motion, motions, "\"constant_rate\"",
        "constant_rate: along a great circle, with the cue's acceleration near it. orbit: along "
        "an orbit about the Earth, from a confirmed track's direction and rate and the range "
        "of the cue's object or the assumed one (not with type imm)."),
    BST_REAL(C, assumed_range_km, "km", 0, 1e7, "0",
             "Motion orbit: range of tracks of which the cue knows none; 0: those keep a constant "
             "rate."),
    BST_REAL(C, range_sigma, "", 1e-6, 1, "0.02",
             "Motion orbit: standard deviation of the range, as a share of it."),
    BST_REAL(C, range_rate_sigma_mps, "m/s", 0, 1e5, "50",
             "Motion orbit: standard deviation of the range rate (of an assumed range: 3000 m/s)."),
    BST_REAL(C, size_range_correlation_s, "s", 0, 1e9, "3600",
             "Motion orbit: time constant of the errors of ranges from the size of extended "
             "targets; 0: these ranges are not used."),
    BST_REAL(C, orbit_noise_mps15, "m/s^1.5", 0, 1e3, "1e-3",
             "Motion orbit: square root of the power spectral density of the acceleration beside "
             "two-body motion."),
    BST_REAL(C, manoeuvre_noise_arcsec_per_s15, "arcsec/s^1.5", 0, 1e5, "3",
             "The same as process_noise_arcsec_per_s15 while an object manoeuvres: of the second "
             "model of "
             "type imm; of ekf and ukf for manoeuvre_sojourn_s after an event `manoeuvre`."),
    BST_REAL(C, quiescent_sojourn_s, "s", 1e-3, 1e9, "3600",
             "Mean time between the end of a manoeuvre and the next one."),
    BST_FORMER("quiet_s", "quiescent_sojourn_s"),
    BST_REAL(C, manoeuvre_sojourn_s, "s", 1e-3, 1e9, "60", "Mean length of a manoeuvre."),
    BST_FORMER("manoeuvre_s", "manoeuvre_sojourn_s"),
    BST_REAL(C, brightness_systematic_mag, "mag", 0, 10, "0.2",
             "Standard deviation added to every magnitude."),
    BST_FORMER("brightness_floor_mag", "brightness_systematic_mag"),
    BST_REAL(C, brightness_random_walk_mag, "mag", 0, 10, "0.05",
             "Standard deviation by which an object's brightness changes from frame to frame."),
    BST_FORMER("brightness_walk_mag", "brightness_random_walk_mag"),
    BST_INT(C, event_window, "", 0, 16, "8",
            "Manoeuvres and changes of brightness are detected from so many detections of a track; "
            "0: none are."),
    BST_REAL(
        C, false_events_per_hour, "1/h", 0, 1e4, "0.01",
        "Greatest number of false manoeuvres, and of false changes of brightness, per hour and "
        "track; 0: none are detected."),
    BST_INT(C, max_dormant_tracks, "", 0, 100000, "64",
            "Room for tracks that were lost; what is confirmed where one of them should be is that "
            "track again."),
    BST_FORMER("max_memory", "max_dormant_tracks"),
    BST_REAL(C, max_dormant_s, "s", 0, 1e6, "7200", "Lost tracks are remembered for this long."),
    BST_FORMER("memory_s", "max_dormant_s"),
    BST_REAL(C, max_dormant_sigma_deg, "deg", 0, 30, "1",
             "Lost tracks whose direction is worse than this are forgotten."),
    BST_FORMER("memory_sigma_deg", "max_dormant_sigma_deg"),
    BST_REAL(C, dormant_gate_chi2, "", 0, 1e6, "18.5",
             "Largest misfit of a new track to a lost one, 4 degrees of freedom."),
    BST_FORMER("memory_chi2", "dormant_gate_chi2"),
    BST_INT(C, max_merged_frames, "", 0, 10000, "60",
            "Frames in a row that a track may live on detections that it shares; of two tracks "
            "that then "
            "still share one, that with more hits goes on."),
    BST_FORMER("max_merged", "max_merged_frames"),
    BST_REAL(C, telemetry_gate_chi2, "", 1, 1e6, "30",
             "Attitudes from stars that contradict the telemetry's history by more (3 degrees of "
             "freedom) are not used ..."),
    BST_INT(C, max_telemetry_rejections, "", 1, 1000, "3",
            "... until so many in a row do: then the history starts anew."),
    BST_FORMER("telemetry_patience", "max_telemetry_rejections"),
    BST_REAL(C, target_max_chi2, "", 0.1, 1e6, "4",
             "A track whose mean innovation (per degree of freedom) exceeds this is not taken for "
             "the target."),
    BST_REAL(C, target_margin, "", 0, 1e3, "2",
             "Log-likelihood by which the best candidate for the target must lead the second ..."),
    BST_INT(C, target_margin_hits, "", 2, 10000, "8", "... unless it has this many hits."),
    BST_INT(C, smoothing_lag_frames, "", 0, 60, "0",
            "Table tracks_smoothed has each track's states given so many later frames; 0: it is "
            "empty. Not with motion orbit."),
    BST_REAL(C, identity_period_s, "s", 0, 1e9, "10",
             "Tracks are compared with the onboard catalogue this often, and in each frame without "
             "a certain target; 0: never."),
    BST_REAL(C, catalogue_sigma_m, "m", 1, 1e9, "5000",
             "Standard deviation per axis of the catalogue's objects, across the line of sight."),
    BST_REAL(C, catalogue_sigma_mps, "m/s", 1e-3, 1e6, "1", "The same of their velocities."),
    BST_REAL(C, catalogue_mag_sigma, "mag", 0.01, 100, "1", "The same of their magnitudes."),
    BST_REAL(C, uncatalogued_per_field, "", 1e-9, 1e6, "0.1",
             "Believed mean number of objects in a field that the catalogue lacks."),
    BST_REAL(C, clock_sigma_s, "s", 0, 1e4, "0",
             "Standard deviation of the onboard clock's offset before the flight. It is then "
             "learnt from the places of identified objects, with catalogue_sigma_m and "
             "catalogue_sigma_mps, and corrected; 0: the clock is taken to be right."),
    BST_REAL(C, navigation_sigma_m, "m", 0, 1e7, "10",
             "Standard deviation per axis of the navigated position, where the clock's offset is "
             "learnt."),
    BST_CONFIG_END};
