/* Joins the detections that are fragments of one long streak. */
#ifndef BST_IMGPROC_STREAK_STREAK_FRAGMENTS_H
#define BST_IMGPROC_STREAK_STREAK_FRAGMENTS_H

#include "imgproc/measure/locate.h"
#include "imgproc/streak/segment_fit.h"

/* Work space. */
typedef struct bst_streak_fragments {
    bst_segment_pixel *pixels; /* [capacity] */
    int capacity, count;
    int *fragments;     /* [fragment_capacity]: sources on the segment */
    bst_segment *parts; /* [fragment_capacity]: their paths */
    int fragment_capacity, fragment_count;
} bst_streak_fragments;

/* Allocates the work space.
 *
 * Given:     width, height  of the largest frame: a streak may be as long as its diagonal, px
 *            max_sigma_px   widest PSF of a frame
 * Errors:    BST_ERR_MEMORY; then `out` holds nothing to free
 * Ownership: free with bst_streak_fragments_free */
bst_status bst_streak_fragments_create(bst_ctx *ctx, int width, int height, double max_sigma_px,
                                       bst_streak_fragments *out) BST_MUST_CHECK;
/* Frees the memory of a work space and clears the struct, which belongs to the caller. */
void bst_streak_fragments_free(bst_streak_fragments *fragments);

/* Joins fragments of streaks among the located sources. A matched filter for points or for the
 * streaks of stars finds several maxima on the path of an object that moves much further, and each
 * would be a detection with the covariance of a whole source.
 *
 * 1. Start: a source with light at its sides (streak_rays.h), or a streak of unknown rate.
 * 2. A segment is fitted to the pixels and its ends move outwards while the ratio of the light
 *    beyond them grows, until neither moves.
 * 3. The segment replaces the sources on it if its chi-square, with twice the number of parameters,
 *    is lower by 9 (by 22 if there is only one) and is that of noise. Sources that are too bright
 *    for it stay, and their pixels are left out. An end among left-out pixels is held in the middle
 *    of them, and their width counts in the covariance.
 *
 * A streak of unknown rate whose end the frame cuts has the standard deviation of half its visible
 * length along itself: the part beyond is unknown. Nothing is joined in a crowd, where stars line
 * up: `candidates` is the number of the frame's sources before the locator's limits cut it. A
 * segment like the streaks of stars is none. */
void bst_streak_fragments_join(bst_streak_fragments *fragments, const bst_locate_frame *frame,
                               int candidates, bst_imgproc_locator *located);

#endif
