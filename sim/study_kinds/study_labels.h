/* Labels of a sequence of frames in SatNet style, one file per sequence. */
#ifndef BST_STUDY_KINDS_STUDY_LABELS_H
#define BST_STUDY_KINDS_STUDY_LABELS_H

#include <stdio.h>

#include "boresight/messages.h"
#include "sim/world/world.h"

typedef struct bst_study_labels {
    FILE *stream;
    const bst_world *world;
    double box_px, star_limit_v_mag;
    bool mask;                         /* seg_id is the item number in the segmentation mask */
    int64_t frames, satellites, stars; /* labels written so far */
    double snr_sum;                    /* of the satellites */
    double longest_px;                 /* length of a satellite's streak in a frame */
} bst_study_labels;

/* Writes a frame's entry of the list "frames": its time, and the objects with light in it, as
 * `boresight export --satnet`. Coordinates are fractions of the image between pixel edges. */
void bst_study_labels_frame(bst_study_labels *labels, const bst_frame_message *frame,
                            const char *start_utc, double exposure_s, const bst_truth *truth);

/* Writes a member of a JSON object after another one: its key, and its text with quotes escaped;
 * control characters are left out. */
void bst_study_labels_text(FILE *stream, const char *key, const char *text);

#endif
