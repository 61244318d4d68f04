/* What one frame shows of single pixels of the sensor: maxima that a defective pixel may have made,
 * and the signal of pixels that are left out. The evidence of pixel_learner.h. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_EVIDENCE_H
#define BST_IMGPROC_CALIBRATE_PIXEL_EVIDENCE_H

#include "imgproc/calibrate/bad_rows.h"
#include "imgproc/measure/locate.h"

/* A maximum of a frame. */
typedef struct bst_pixel_show {
    int32_t pixel; /* y * width + x of the sensor; of a binned pixel its first one */
    bst_sharpness_test sharp;
} bst_pixel_show;

/* A pixel that is left out, looked at all the same. */
typedef struct bst_pixel_check {
    int32_t pixel;
    float excess; /* above the background, in standard deviations of its noise */
} bst_pixel_check;

typedef struct bst_pixel_shows {
    int capacity;
    bst_pixel_show *items; /* [capacity], by pixel once sorted */
    bst_pixel_check *checks;
    int count, check_count, maxima; /* maxima: all, with those of light alone, which are no items */
    bool usable;   /* maxima are those of points or of streaks that were filtered for */
    double pixels; /* of the frame or of its windows that were looked at, after binning */
} bst_pixel_shows;

/* Room for `capacity` of each. BST_ERR_MEMORY. */
bst_status bst_pixel_shows_create(bst_ctx *ctx, int capacity, bst_pixel_shows *out) BST_MUST_CHECK;
/* Frees the memory of the evidence and clears the struct, which belongs to the caller. */
void bst_pixel_shows_free(bst_pixel_shows *shows);

/* Adds the maxima of a frame, or of a window of one, before charge is removed from its signal. Each
 * stands at the highest of the nine pixels about it; the pixels about one with charge that hold
 * charge too are added. Bright ones that are not sharper than light are only counted. The locator's
 * sharpness is made for the frame. */
void bst_pixel_shows_add(bst_pixel_shows *shows, const bst_imgproc_locator *locator,
                         const bst_locate_frame *frame, const bst_candidates *candidates);

/* Puts the maxima in order of pixel, one of each, and the checks in order of pixel. */
void bst_pixel_shows_sort(bst_pixel_shows *shows);

/* The maximum at a pixel of the sensor; NULL: none. After bst_pixel_shows_sort. */
const bst_pixel_show *bst_pixel_shows_find(const bst_pixel_shows *shows, int32_t pixel);

#endif
