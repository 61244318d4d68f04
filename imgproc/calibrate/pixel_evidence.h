/* Evidence of defective detector pixels in one frame: maxima sharper than the PSF, and re-checks of
 * pixels already masked. Input of pixel_learner.h. */
#ifndef BST_IMGPROC_CALIBRATE_PIXEL_EVIDENCE_H
#define BST_IMGPROC_CALIBRATE_PIXEL_EVIDENCE_H

#include "imgproc/calibrate/bad_rows.h"
#include "imgproc/measure/locate.h"

/* A maximum of a frame that a defective pixel may have caused. */
typedef struct bst_pixel_show {
    int32_t pixel; /* y * width + x on the sensor; the first sensor pixel of a binned one */
    bst_sharpness_test sharp;
} bst_pixel_show;

/* Re-check of a masked pixel of the bad-pixel map. */
typedef struct bst_pixel_check {
    int32_t pixel;
    float excess; /* signal above the background, in standard deviations of the pixel's noise */
} bst_pixel_check;

typedef struct bst_pixel_shows {
    int capacity;
    bst_pixel_show *items; /* [capacity], ascending in pixel after bst_pixel_shows_sort */
    bst_pixel_check *checks;
    /* maxima: number in the frame, including those cleared as light and not stored */
    int count, check_count, maxima;
    bool usable; /* true if the matched filter fitted the stars' shape (points or known streaks) */
    double pixels; /* number of binned pixels searched */
} bst_pixel_shows;

/* Allocates evidence with room for `capacity` maxima and as many re-checks. Errors: BST_ERR_MEMORY.
 */
bst_status bst_pixel_shows_create(bst_ctx *ctx, int capacity, bst_pixel_shows *out) BST_MUST_CHECK;
/* Frees the memory of the evidence and clears the struct, which belongs to the caller. */
void bst_pixel_shows_free(bst_pixel_shows *shows);

/* Adds the maxima of a frame, or of a window of it, to the bad-pixel evidence.
 *
 * Call it before cosmic-ray charge is removed from the signal. Each maximum is moved to the
 * brightest of its 3 x 3 pixels. Sharp pixels within 2 px of a sharp one are added too. Bright
 * maxima that fit the PSF are only counted. The locator's sharpness test must be prepared for the
 * frame. */
void bst_pixel_shows_add(bst_pixel_shows *shows, const bst_imgproc_locator *locator,
                         const bst_locate_frame *frame, const bst_candidates *candidates);

/* Sorts maxima and re-checks by pixel and removes duplicate maxima. */
void bst_pixel_shows_sort(bst_pixel_shows *shows);

/* Evidence at a sensor pixel; NULL if there is none. Call bst_pixel_shows_sort first. */
const bst_pixel_show *bst_pixel_shows_find(const bst_pixel_shows *shows, int32_t pixel);

#endif
