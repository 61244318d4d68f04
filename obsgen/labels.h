/* Labels of generated detections that are no catalogue stars. */
#ifndef BST_OBSGEN_LABELS_H
#define BST_OBSGEN_LABELS_H

#include "obsgen/generator.h"
#include "sim/onboard/discriminate.h"

/* A frame whose stars have been identified. */
typedef struct bst_obsgen_labels_frame {
    const bst_camera *camera;              /* onboard */
    const bst_truth *truth;                /* of the frame */
    const bst_obsgen_generated *generated; /* of each detection */
    bst_window window;
    double streak_px;                 /* of the stars; 0: points */
    const bst_nav_telemetry *nav;     /* NULL: unknown, no aberration */
    const bst_predictions *predicted; /* moving tracks; NULL: none */
    double middle_tick, tick_rate_hz; /* of the exposure */
} bst_obsgen_labels_frame;

/* Labels the detections as image processing does (sim/onboard/discriminate.h).
 *
 * Given:     detections  identified stars have star_id; charge and artefacts have their label
 * Notes:     the attitude by which earlier frames are compared is the true mean one, turned by the
 *            weighted mean error of the identified stars: a fit to them would have it */
void bst_obsgen_label(bst_discriminator *discriminator, const bst_obsgen_labels_frame *frame,
                      bst_detections *detections);

#endif
