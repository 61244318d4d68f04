/* True path of the stars over the frame during an exposure (not that of telemetry) and its centroid
 * biases. Internal to the generator. */
#ifndef BST_OBSGEN_STREAK_STAR_TRAIL_H
#define BST_OBSGEN_STREAK_STAR_TRAIL_H

#include "boresight/status.h"
#include "obsgen/model/blend_weight.h"

enum { BST_ROUTE_NODES = 4096 };

/* Trail of a star: nodes about one pixel apart, extended beyond both ends as far as its light. */
typedef struct bst_star_trail_node {
    double x, y;  /* relative to the mean of the path, px */
    double time;  /* elapsed share of the exposure */
    double light; /* output of the point filter there relative to a point at rest */
} bst_star_trail_node;

/* Path of a star at the window's centre at equal steps of the exposure, px. */
typedef struct bst_star_trail_path {
    const double *x_px, *y_px;
    int count; /* at least 2 */
} bst_star_trail_path;

/* Number of equal parts of each step of a path whose sums over places are those over its light: no
 * part is longer than step_px, unless the path then had more than `most` places. Between its places
 * a path is straight and uniform, as in images (bst_los_track_attitude).
 *
 * Given:     more_*_px  uniform motion on top of the path */
int bst_star_trail_parts(const bst_star_trail_path *path, double more_x_px, double more_y_px,
                         double step_px, int most);

/* Divides each step of a path into equal parts. x_px and y_px have room for the new number of
 * places, (count - 1) parts + 1, which is returned. */
int bst_star_trail_divide(double *x_px, double *y_px, int count, int parts);

/* Lays out the nodes of a trail; returns their number. A path that returns to a position has one
 * node there.
 *
 * Given:     sigma_px  of the filter, including the pixel */
int bst_star_trail_lay(const bst_star_trail_path *path, double sigma_px,
                       bst_star_trail_node *nodes);

/* Mean centroid bias of a uniform straight streak fit (dx, dy) with bend (coefficient of (3u^2 - 1)
 * / 2, u from -1 to 1), relative to the path's mean: the position of largest overlap with the true
 * light. For points see bst_star_trail_point_bias. */
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
