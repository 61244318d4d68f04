/* From streaks that the search finds to located sources. */
#ifndef BST_IMGPROC_STREAK_STREAK_LOCATE_H
#define BST_IMGPROC_STREAK_STREAK_LOCATE_H

#include "imgproc/measure/locate.h"
#include "imgproc/streak/streak_fit.h"
#include "imgproc/streak/streak_search.h"

typedef struct bst_streak_locator {
    bst_streak_search search;
    bst_streak_fit fit;
    uint8_t *excluded; /* of a stamp */
    int *pieces;       /* points that a streak takes the place of */
} bst_streak_locator;

/* The frames and streaks that a locator is made for. */
typedef struct bst_streak_locator_limits {
    int max_width, max_height;
    double fwhm_px; /* of the PSF */
    double max_px;  /* the longest streak */
} bst_streak_locator_limits;

/* psf and pool are kept; pool NULL: the caller's thread alone. */
bst_status bst_streak_locator_create(bst_ctx *ctx, const bst_imgproc_gauss *psf, bst_parallel *pool,
                                     const bst_streak_locator_limits *limits,
                                     bst_streak_locator *out) BST_MUST_CHECK;
/* Frees the memory of a locator and clears the struct, which belongs to the caller. */
void bst_streak_locator_free(bst_streak_locator *locator);

/* Searches the frame that `found` was located in (bst_locate) for streaks and adds each to `found`
 * as long as there is room: fitted in place, path and flux, with flag BST_DETECTION_STREAK. Points
 * that are light of such a streak are dropped from it. Charge that is not light (BST_PIXEL_BAD in
 * the signal) counts for nothing. */
void bst_streak_locate(bst_streak_locator *locator, const bst_locate_frame *frame,
                       const bst_candidates *candidates, double false_alarms,
                       bst_imgproc_locator *found);

#endif
