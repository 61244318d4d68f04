/* Measures the streaks found by the streak search as sources. */
#ifndef BST_IMGPROC_STREAK_STREAK_LOCATE_H
#define BST_IMGPROC_STREAK_STREAK_LOCATE_H

#include "imgproc/measure/locate.h"
#include "imgproc/streak/streak_fit.h"
#include "imgproc/streak/streak_search.h"

typedef struct bst_streak_locator {
    bst_streak_search search;
    bst_streak_fit fit;
    uint8_t *excluded; /* mask of a stamp */
    int *pieces;       /* point sources replaced by a streak */
} bst_streak_locator;

/* Sizes of a streak locator's memory. */
typedef struct bst_streak_locator_limits {
    int max_width, max_height;
    double fwhm_px; /* of the PSF */
    double max_px;  /* longest streak */
} bst_streak_locator_limits;

/* Creates a streak locator.
 *
 * Given:     psf, pool  must outlive it; pool NULL: the caller's thread
 * Errors:    BST_ERR_MEMORY */
bst_status bst_streak_locator_create(bst_ctx *ctx, const bst_imgproc_gauss *psf, bst_parallel *pool,
                                     const bst_streak_locator_limits *limits,
                                     bst_streak_locator *out) BST_MUST_CHECK;
/* Frees the memory of a locator and clears the struct, which belongs to the caller. */
void bst_streak_locator_free(bst_streak_locator *locator);

/* Searches a frame for streaks and adds them to the sources `found` by bst_locate, as far as there
 * is room. Each is fitted in position, path and flux and has flag BST_DETECTION_STREAK. Point
 * sources that are fragments of a streak are dropped. Charge (BST_PIXEL_BAD in the signal) is
 * ignored. */
void bst_streak_locate(bst_streak_locator *locator, const bst_locate_frame *frame,
                       const bst_candidates *candidates, double false_alarms,
                       bst_imgproc_locator *found);

#endif
