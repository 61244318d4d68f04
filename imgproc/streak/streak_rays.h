/* Light along rays from a source in the output of the filter for points: where a streak that is
 * longer than the source begins and ends. */
#ifndef BST_IMGPROC_STREAK_STREAK_RAYS_H
#define BST_IMGPROC_STREAK_STREAK_RAYS_H

#include "imgproc/measure/locate.h"
#include "imgproc/streak/segment_fit.h"

enum { BST_STREAK_AXES = 24, BST_STREAK_RAYS = 2 * BST_STREAK_AXES, BST_STREAK_RAY_SAMPLES = 8 };

/* Sample of a ray from a source's maximum: pixels right and up, and its distance. */
typedef struct bst_streak_ray_sample {
    int dx, dy;
    float distance_px;
} bst_streak_ray_sample;

typedef struct bst_streak_rays {
    const bst_locate_frame *f;
    double sigma_px; /* of the PSF with the pixel */
    /* length of a line with the squared SNR of the filter's output on it, 2 sqrt(pi) sigma: the
     * output for points on a line is the flux per px over the noise of a pixel */
    double decay_px;
    /* from a point, and from a star's streak */
    bst_streak_ray_sample rays[2][BST_STREAK_RAYS][BST_STREAK_RAY_SAMPLES];
    /* second and third samples of each axis, as offsets in the filter's map, and their reach */
    int glances[2][BST_STREAK_AXES][4], glance_px[2];
} bst_streak_rays;

/* Sets the rays of a frame, from points and, if it was filtered for them, from streaks of stars. */
void bst_streak_rays_set(bst_streak_rays *rays, const bst_locate_frame *frame);
/* Output of the filter for points at a source's maximum; 0 outside the frame. */
double bst_streak_rays_peak(const bst_streak_rays *rays, const bst_imgproc_found *source);
/* Start of a segment at a source that has light at its sides: the log-likelihood ratio of a line of
 * the source's brightness to the source alone is 9 or more along one of 24 axes.
 *
 * Returned:  false: it has none */
bool bst_streak_rays_start(const bst_streak_rays *rays, const bst_imgproc_found *source,
                           bst_segment *out);
/* Length by which light goes on beyond an end of a segment, px.
 *
 * Given:     side  -1: its start, 1: its end
 *            line  output of the filter for points on it */
double bst_streak_rays_beyond(const bst_streak_rays *rays, const bst_segment *segment, double side,
                              double line);

#endif
