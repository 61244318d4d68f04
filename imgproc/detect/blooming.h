/* Saturated sources whose charge blooms along detector columns. */
#ifndef BST_IMGPROC_DETECT_BLOOMING_H
#define BST_IMGPROC_DETECT_BLOOMING_H

#include "imgproc/measure/deblend.h"
#include "imgproc/measure/locate.h"

/* Merges all candidates on a connected set of saturated pixels into one source. It does nothing if
 * the sensor does not bloom (frame->camera).
 *
 * Candidates are sorted by brightness. The first of a set stays and gets found->bleed; the others
 * are dropped. Its start position is the maximum of the unsaturated pixels beside the bleed. Its
 * charge is the sum over all pixels, because blooming conserves charge. Partly filled pixels at the
 * ends of the columns become BST_PIXEL_BAD. In a frame with star streaks, a set wider than a
 * point's is merged but not fitted. */
void bst_blooming_join(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Fits the unsaturated wings of a source with found->bleed, width free. Returns false if they do
 * not determine it; the source then keeps its start position. */
bool bst_blooming_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

/* Completes a bleeding source after the fits: flux from its charge, covariance including the PSF
 * misfit of the wings, SNR (`norm` for one electron in noise of one), flags and size. */
void bst_blooming_finish(const bst_locate_frame *frame, double norm, bst_imgproc_found *found);

#endif
