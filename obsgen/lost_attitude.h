/* The generator's attitude while telemetry may be wrong by any angle: what image processing would
 * find without an attitude (imgproc/module_lost.c). */
#ifndef BST_OBSGEN_LOST_ATTITUDE_H
#define BST_OBSGEN_LOST_ATTITUDE_H

#include "boresight/archive.h"
#include "boresight/module.h"
#include "obsgen/identify.h"

typedef struct bst_obsgen_lost {
    bool unknown_at_start;
    int64_t lost_after_frames; /* 0: never lost again */
    bool lost;                 /* the attitude is unknown */
    bool known;                /* `error` holds */
    bst_quat error;            /* q_true = q_telemetry * error, of the latest frame with stars */
    int64_t frames_without_stars;
} bst_obsgen_lost;

/* State at the start. */
bst_obsgen_lost bst_obsgen_lost_begin(bool unknown_at_start, int64_t lost_after_frames);
/* True if the configuration asks for attitudes that are found without telemetry. */
bool bst_obsgen_lost_enabled(const bst_obsgen_lost *lost);
/* Saves or restores the state, where it is enabled. */
void bst_obsgen_lost_archive(bst_obsgen_lost *lost, bst_archive *archive);

/* Identifies stars as bst_obsgen_identify, and without an attitude where it is lost: if six
 * identified stars or more reach SNR 8. Publishes an event when the attitude is found and when it
 * is lost.
 *
 * Given:     options     with shift_px by the onboard attitude
 *            detections  header with the onboard attitude, and items
 * Returned:  detections  labels, stars_identified, and the attitude that was found
 * Errors:    those of the catalogue */
bst_status bst_obsgen_lost_identify(bst_obsgen_lost *lost, struct bst_step *step,
                                    const bst_identify_options *options,
                                    const bst_generator_frame *frame,
                                    const bst_obsgen_generated *generated,
                                    bst_detections *detections) BST_MUST_CHECK;

#endif
