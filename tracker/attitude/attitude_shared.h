/* How much of an attitude's error the next frame repeats.
 *
 * What moves a star's centroid, or is wrong with its place in the catalogue, stays with the star:
 * unresolved neighbours, proper motion, distortion, the pixel under a star that does not move. Such
 * errors are part of every frame's covariance, but averaging frames with the same stars does not
 * reduce them. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_SHARED_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_SHARED_H

#include "tracker/attitude/attitude.h"

/* Stars that are remembered from frame to frame; a power of two. */
#define BST_ATTITUDE_SHARED_STARS 4096

/* All zero: nothing known. */
typedef struct bst_attitude_shared {
    struct {
        uint32_t id;
        int64_t frame;
        bst_vec3 pull_rad; /* about camera x and y, in GCRF axes */
    } stars[BST_ATTITUDE_SHARED_STARS];
    int64_t frame;
    double variance_rad2; /* of the latest attitude, camera x and y together */
    double ratios, frames;
} bst_attitude_shared;

/* Takes a valid solution and its stars, as bst_attitude_solve leaves both. A star of weight w,
 * relative to all, turns the attitude by w times its residual. With errors e + b, where b stays
 * with the star and e does not, the products of these turns in successive frames have the mean
 * w^2 b^2, whose sum over the stars is the covariance of the two attitudes (the lag-one
 * autocovariance; Box, Jenkins and Reinsel, Time Series Analysis, 4th edition, 2.1.5). Frames of
 * fewer than 4 stars are left out. */
void bst_attitude_shared_update(bst_attitude_shared *shared, const bst_attitude_solution *solution,
                                const bst_attitude_star *stars, int count);

/* Covariance of successive attitudes over their variance, about camera x and y, 0 to 1: the mean
 * over about the last 1000 frames, and of 10 beforehand with 0.04. */
double bst_attitude_shared_get(const bst_attitude_shared *shared);

#endif
