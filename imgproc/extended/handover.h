/* Hand-over between points and extended targets in the detections of a frame. */
#ifndef BST_IMGPROC_EXTENDED_HANDOVER_H
#define BST_IMGPROC_EXTENDED_HANDOVER_H

#include "imgproc/extended/centre_of_mass.h"

/* State of the hand-over. */
typedef struct bst_handover {
    bool extended;  /* the latest frame had an extended target */
    double size_px; /* of the largest target in this and earlier frames, which count for less */
} bst_handover;

/* Selects the silhouettes that are extended targets: those of at least the hand-over size, and,
 * after a frame with an extended target, those of at least return_share of it. Point detections in
 * a selected silhouette, or within one FWHM of it, become ARTEFACT: they are parts of the target.
 *
 * Given:     view        of the silhouettes' frame
 * Returned:  *out        the selected silhouettes; *points the others
 *            detections  labels */
void bst_handover_select(bst_handover *handover, const bst_silhouettes *silhouettes,
                         const bst_extended_view *view, bst_silhouettes *out,
                         bst_silhouettes *points, bst_detections *detections);

#endif
