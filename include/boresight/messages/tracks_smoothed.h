/* Channel tracks_smoothed: states of tracks in an earlier frame, given the later frames too. */
#ifndef BORESIGHT_MESSAGES_TRACKS_SMOOTHED_H
#define BORESIGHT_MESSAGES_TRACKS_SMOOTHED_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/messages/tracks.h"
#include "boresight/vec.h"

#define BST_CHANNEL_TRACKS_SMOOTHED "tracks_smoothed"

typedef struct bst_track_smoothed {
    int64_t id;              /* as in tracks */
    int32_t status;          /* bst_track_status in that frame */
    bool target_of_interest; /* in that frame */
    int32_t later_frames;    /* frames after it that contribute */
    bst_vec3 direction_gcrf; /* unit, geometric */
    bst_vec3 rate_gcrf_radps;
    double covariance[4][4]; /* as in bst_track */
} bst_track_smoothed;

/* tracks_smoothed (queue): tracks of the frame that lies smoothing_lag_frames before the latest,
 * valid at its `tick` (mid-exposure). Only tracks that have been confirmed since. */
typedef struct bst_tracks_smoothed {
    int64_t exposure_id;
    int64_t tick;
    int32_t count, lost; /* lost: tracks of the latest frame that found no room */
    bst_track_smoothed items[];
} bst_tracks_smoothed;

#endif
