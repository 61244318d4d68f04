/* Correlation of the attitude errors of successive frames.
 *
 * Some centroid errors stay with the star: unresolved neighbours, proper motion, distortion, the
 * pixel under a star at rest in the frame. They are part of every frame's covariance, but averaging
 * over frames with the same stars does not reduce them. */
#ifndef BST_TRACKER_ATTITUDE_ATTITUDE_SHARED_H
#define BST_TRACKER_ATTITUDE_ATTITUDE_SHARED_H

#include "boresight/archive.h"
#include "tracker/attitude/attitude.h"

/* Number of stars stored between frames; a power of two. */
#define BST_ATTITUDE_SHARED_STARS 4096

/* State of the correlation estimate; all zero: nothing known. */
typedef struct bst_attitude_shared {
    struct {
        uint32_t id;
        int64_t frame;
        bst_vec3 pull_rad; /* about camera x and y, in GCRF axes */
    } stars[BST_ATTITUDE_SHARED_STARS];
    int64_t frame;
    double variance_rad2; /* variance of the latest attitude about camera x and y together */
    double ratios, frames;
} bst_attitude_shared;

/* Updates the correlation with a valid attitude solution and its stars, as bst_attitude_solve
 * returns them. Frames with fewer than 4 stars are skipped.
 *
 * Notes:     A star of relative weight w rotates the attitude by w times its residual. Let the
 *            residual be e + b, where b persists with the star and e does not. The product of these
 *            rotations in successive frames has the mean w^2 b^2. The sum over the stars is the
 *            covariance of the two attitudes (lag-one autocovariance).
 * Reference: Box, Jenkins and Reinsel, Time Series Analysis, 4th edition, 2.1.5 */
void bst_attitude_shared_update(bst_attitude_shared *shared, const bst_attitude_solution *solution,
                                const bst_attitude_star *stars, int count);

/* Correlation of successive attitude errors about camera x and y, 0 to 1: the mean over about the
 * last 1000 frames, with a prior of 0.04 weighted as 10 frames. */
double bst_attitude_shared_get(const bst_attitude_shared *shared);

/* Saves or restores the correlation estimate, for bst_module_desc.archive. Of the stars only those
 * of the latest frame: no others are compared with the next frame. */
void bst_attitude_shared_archive(bst_attitude_shared *shared, bst_archive *archive);

#endif
