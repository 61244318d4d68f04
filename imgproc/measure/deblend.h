/* The sources that share light with one another, and the fit of one of them with the others. */
#ifndef BST_IMGPROC_MEASURE_DEBLEND_H
#define BST_IMGPROC_MEASURE_DEBLEND_H

#include "imgproc/measure/locate.h"

enum { BST_COMPANY_MAX_FIXED = 12 };

/* One thread's part of a loop over the found ones. */
typedef struct bst_imgproc_worker {
    const bst_imgproc_locator *l;
    const bst_locate_frame *f;
    bst_fit *fit;
} bst_imgproc_worker;

typedef struct bst_deblend {
    const bst_imgproc_source *free[BST_FIT_MAX_FREE]; /* the first is the one asked about */
    int free_count;
    const bst_imgproc_source *fixed[BST_COMPANY_MAX_FIXED];
    int fixed_count;
} bst_deblend;

/* Distance around a path inside which a source's light counts, px. */
double bst_deblend_reach(const bst_locate_frame *frame);
/* How far a fit may move a source from its maximum, px. */
double bst_deblend_fit_limit(const bst_locate_frame *frame, double path_px);
/* The pixels that a source is fitted to. */
bst_imgproc_stamp bst_deblend_stamp(const bst_imgproc_locator *l, const bst_locate_frame *f,
                                    const bst_imgproc_source *s);

/* Puts the found ones into squares of the frame, by their maxima. */
void bst_deblend_index(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* The sources that share light with `own`, number i: those centred on its stamp are free, the
 * brightest first; those that only reach into it are fixed. */
void bst_deblend_gather(const bst_imgproc_locator *l, const bst_locate_frame *f, int i,
                        const bst_imgproc_source *own, const bst_imgproc_stamp *stamp,
                        bst_deblend *out);

/* Fits *found, number i, in the shape that its source has. The neighbours' own entries stay as they
 * are: each gets its values from its own fit. */
bool bst_deblend_fit(const bst_imgproc_worker *w, int i, bst_imgproc_found *found,
                     const bst_imgproc_stamp *stamp, bool free_width);

/* Of numbers 0 to end - 1, all fitted, those that ended at a brighter one's place are dropped. */
void bst_deblend_drop_doubles(bst_imgproc_locator *l, const bst_locate_frame *f, int end);

#endif
