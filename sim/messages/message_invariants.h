/* What holds of every message that a module of this program publishes, for the assertions at the
 * end of its step. Messages of plug-ins and of other programs are checked with an error message
 * instead (sim/link/wire.c, imgproc/detect/plugin_detector.c). */
#ifndef BST_MESSAGES_MESSAGE_INVARIANTS_H
#define BST_MESSAGES_MESSAGE_INVARIANTS_H

#include <stdbool.h>

#include "boresight/messages.h"

/* A window has at least one pixel and does not begin outside the sensor. */
bool bst_window_is_valid(const bst_window *window);
/* An exposure: ticks in order, a window, binning of 0 or more. */
bool bst_exposure_is_valid(const bst_exposure *exposure);
/* A frame message: ticks in order, a window, binning of 1 or more, 8 to 16 bits. */
bool bst_frame_message_is_valid(const bst_frame_message *message);
/* The newest sample of a ring of attitudes: a unit quaternion, later than the sample before. */
bool bst_los_history_is_valid(const bst_los_history *history);
/* The same of a ring of measured attitudes. */
bool bst_pointing_telemetry_is_valid(const bst_pointing_telemetry *telemetry);
/* Positions and velocities are finite. */
bool bst_nav_telemetry_is_valid(const bst_nav_telemetry *telemetry);
/* A mount: unit axes and quaternions, limits of 0 or more, travel in order. */
bool bst_mount_status_is_valid(const bst_mount_status *status);
/* A commanded direction is a unit vector; rates and accelerations are finite. */
bool bst_los_command_is_valid(const bst_los_command *command);
/* Settings of a sensor are finite, or 0 and less for "keep". */
bool bst_sensor_command_is_valid(const bst_sensor_command *command);
/* Windows of a frame: at most `capacity`, numbered from 0 without gaps, with a bst_region_reason
 * and finite places; those of stars have no track. */
bool bst_regions_of_interest_are_valid(const bst_regions_of_interest *regions, int capacity);
/* Wheels: at most `capacity`, with finite speeds and torques, and limits of 0 or more. */
bool bst_wheel_status_is_valid(const bst_wheel_status *status, int capacity);
/* A bst_mode, no negative target or step of a search. */
bool bst_control_status_is_valid(const bst_control_status *status);
/* A task: object -1 or more, standard deviations of 0 or more, a bst_task_end. */
bool bst_task_is_valid(const bst_task *task);

/* Detections of a frame: at most `capacity`, on finite places, with covariances, labels and
 * probabilities in their ranges, unit attitudes. */
bool bst_detections_are_valid(const bst_detections *detections, int capacity);
/* Tracks after a frame: at most `capacity`, in unit directions, with finite covariances whose
 * diagonals are not negative, identities of 1 or more, and a fix with a unit attitude. */
bool bst_tracks_are_valid(const bst_tracks *tracks, int capacity);
/* Identities of tracks: at most `capacity`, probabilities in 0 to 1. */
bool bst_track_identities_are_valid(const bst_track_identities *identities, int capacity);
/* Smoothed tracks of a frame: as bst_tracks_are_valid. */
bool bst_tracks_smoothed_are_valid(const bst_tracks_smoothed *tracks, int capacity);
/* Predictions: at most `capacity`, in unit directions, with standard deviations of 0 or more. */
bool bst_predictions_are_valid(const bst_predictions *predictions, int capacity);
/* The true scene of an exposure: at most `capacity` items, shares of the field in 0 to 1, unit
 * attitudes, electrons of 0 or more. */
bool bst_truth_is_valid(const bst_truth *truth, int capacity);

#endif
