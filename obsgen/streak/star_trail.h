/* How stars moved over the frame during an exposure, as it was, not as telemetry has it. Inside of
 * the generator. */
#ifndef BST_OBSGEN_STREAK_STAR_TRAIL_H
#define BST_OBSGEN_STREAK_STAR_TRAIL_H

#include "boresight/status.h"
#include "obsgen/model/blend_weight.h"

enum { BST_ROUTE_NODES = 4096 };

/* The way as places about a pixel apart, and beyond both ends as far as light reaches. */
typedef struct bst_star_trail_node {
    double x, y; /* from the mean of the path, px */
    double time; /* share of the exposure that had passed */
    double
        light; /* output of the filter for a point at that place, over that for a point at rest */
} bst_star_trail_node;

/* The path of a star in the middle of the window at equal steps of the exposure, px, and a filter
 * of this width with the pixel's own. */
typedef struct bst_star_trail_path {
    const double *x_px, *y_px;
    int count; /* at least 2 */
} bst_star_trail_path;

/* Lays out nodes; their number. Where the path comes back to a place it has one node. */
int bst_star_trail_lay(const bst_star_trail_path *path, double sigma_px,
                       bst_star_trail_node *nodes);

/* How far the fit of a uniform straight streak (dx, dy) with the bend (the coefficient of (3u^2 -
 * 1) / 2, u from -1 to 1) lands from the mean of the path in the mean over noise: where the model
 * overlaps most with the light that is there. For a point see bst_star_trail_point_bias. */
void bst_star_trail_bias(const bst_star_trail_path *path, double dx_px, double dy_px,
                         double bend_x_px, double bend_y_px, double sigma_px, double bias_px[2]);

/* Bias of the least-squares fit of a point source to light that moved along the path: the fitted
 * place less the mean of the path, in the mean over noise.
 *
 * Given:
 *   weights   see blend_weight.h
 *   light     brightest pixel of the fitted light over the variance of the noise
 *   sigma_px  root of the mean of the variances of the fitted PSF and of the image at rest, both
 *             with the pixel's own, px
 *   bias_px   where the search begins, (0, 0) or the bias for another light
 *
 * Returned: bias_px, the root c of <w(|x(t) - c|) (x(t) - c)> = 0, the mean over the exposure, by
 * mean shift. Much light: w is even and the bias 0 (the centroid); little: that of the matched
 * filter. */
void bst_star_trail_point_bias(const bst_star_trail_path *path, const bst_blend_weights *weights,
                               double light, double sigma_px, double bias_px[2]);

#endif
