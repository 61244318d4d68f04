/* Settings of a multi-target tracker behind a camera of 1024 x 1024 pixels of 3 arcsec. */
#ifndef BST_TESTS_PIXEL_TRACKER_H
#define BST_TESTS_PIXEL_TRACKER_H

#include "tests/test_support.h"
#include "tracker/mtt/multitarget.h"

#define AS BST_ARCSEC_RAD
#define PX (3.0 * AS)
#define FIELD_PX 1024.0

static inline bst_mtt_params pixel_tracker(int max_tracks, int max_detections) {
    return (bst_mtt_params){.max_tracks = max_tracks,
                            .max_detections = max_detections,
                            .noise_rad2ps3 = pow(0.02 * AS, 2),
                            .gate_chi2 = 16,
                            .detection_probability = 0.9,
                            .false_alarms_per_frame = 1,
                            .field_sr = pow(FIELD_PX * PX, 2),
                            .confirm_hits = 3,
                            .confirm_frames = 5,
                            .confirm_score = 12,
                            .max_rate_radps = 120 * AS,
                            .cue_rate_margin_radps = 2 * AS,
                            .initiation_gap_s = 5,
                            .max_misses = 12,
                            .max_coast_s = 120,
                            .max_sigma_rad = 60 * AS,
                            .merge_rad = 6 * PX,
                            .merge_floor_rad = 0.3 * PX,
                            .max_merged_frames = 30,
                            .feed_forward_rad = 0.09};
}

#endif
