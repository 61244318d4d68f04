/* Deblending: joint fit of sources whose light overlaps. */
#ifndef BST_IMGPROC_MEASURE_DEBLEND_H
#define BST_IMGPROC_MEASURE_DEBLEND_H

#include "imgproc/measure/locate.h"

enum { BST_DEBLEND_MAX_FIXED = 12 };

/* One thread's context in a loop over the located sources. */
typedef struct bst_imgproc_worker {
    const bst_imgproc_locator *l;
    const bst_locate_frame *f;
    bst_fit *fit;
} bst_imgproc_worker;

/* Sources that overlap with one source: fitted with it, or held fixed. */
typedef struct bst_deblend {
    const bst_imgproc_source *free[BST_FIT_MAX_FREE]; /* free[0] is the source itself */
    int free_count;
    const bst_imgproc_source *fixed[BST_DEBLEND_MAX_FIXED];
    int fixed_count;
} bst_deblend;

/* Distance from a source's path within which its light is modelled, px. */
double bst_deblend_reach(const bst_locate_frame *frame);
/* Largest shift of a source from its maximum in a fit, px. */
double bst_deblend_fit_limit(const bst_locate_frame *frame, double path_px);
/* Stamp of pixels to which a source is fitted. */
bst_imgproc_stamp bst_deblend_stamp(const bst_imgproc_locator *l, const bst_locate_frame *f,
                                    const bst_imgproc_source *s);

/* Builds the spatial index: assigns the located sources to cells of the frame by their maxima. */
void bst_deblend_index(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Finds the sources that overlap with `own`, source i. Those centred on its stamp are free in the
 * fit, brightest first. Those whose light only extends into it are fixed. */
void bst_deblend_gather(const bst_imgproc_locator *l, const bst_locate_frame *f, int i,
                        const bst_imgproc_source *own, const bst_imgproc_stamp *stamp,
                        bst_deblend *out);

/* Fits source i jointly with its neighbours, in the shape that its source has. The neighbours' own
 * results are unchanged; each is set by its own fit. Returns false if the fit fails. */
bool bst_deblend_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                     const bst_imgproc_stamp *stamp, bool free_width);

/* Drops duplicates: fitted sources of indices 0 to end - 1 that converged to the position of a
 * brighter one. */
void bst_deblend_drop_doubles(bst_imgproc_locator *l, const bst_locate_frame *f, int end);

#endif
