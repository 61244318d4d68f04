/* Sources whose charge overflows along their columns (blooming). */
#ifndef BST_IMGPROC_DETECT_BLOOMING_H
#define BST_IMGPROC_DETECT_BLOOMING_H

#include "imgproc/measure/deblend.h"
#include "imgproc/measure/locate.h"

/* Makes one source of all candidates on a set of saturated pixels that touch, on a sensor that
 * blooms (frame->camera); nothing is done on another. Candidates are by brightness; the first of a
 * set stays, with found->bleed, the others are dropped. It starts where the unsaturated pixels
 * beside the bleeding columns have their maximum; its charge is the sum of all pixels, because
 * blooming keeps charge. The pixels at both ends of the columns, which overflow fills in part,
 * become BST_PIXEL_BAD. In a frame whose stars are streaks a set that is wider than a point's is
 * only made one source. */
void bst_blooming_join(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Fits a source with found->bleed to the unsaturated pixels about it, its width free. False: they
 * do not determine it; it stays where it started. */
bool bst_blooming_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

/* Completes such a source after the fits: flux from its charge, a covariance that is not less than
 * the misfit of the PSF to its wings allows, SNR, flags, the extent of the PSF. */
void bst_blooming_finish(const bst_locate_frame *frame, bst_imgproc_found *found);

#endif
