/* Moments and widths of a source's image on the detector. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_FIELD_IMAGE_H
#define BST_WORLD_SCENE_FIELD_IMAGE_H

#include "sim/optics/streak_image.h"
#include "sim/world/scene/field.h"

/* Mean and covariance of the image position of a source over the exposure, px, and the displacement
 * along the straight uniform path nearest to its path (least squares over time), px: jitter that
 * moves the ends hardly changes it. NAN: behind the camera. */
typedef struct bst_scene_image_moments {
    double x_mean, y_mean, xx, xy, yy, dx, dy;
} bst_scene_image_moments;

/* Image moments of a source with variable brightness, weighted by its light, from time u0 to u1 of
 * the track (0 to 1). */
bst_scene_image_moments bst_scene_image_by_light(const bst_camera *camera,
                                                 const bst_los_track *track,
                                                 const bst_scene_source *source, double u0,
                                                 double u1);

/* Centroid of the light of a source, from the moments of its chief ray. The PSF's own centroid and
 * the slope of the illumination shift it. NAN if the moments are NAN. */
void bst_scene_image_centroid(const bst_camera *camera, const bst_scene_source *source,
                              const bst_scene_image_moments *m, double *x_px, double *y_px);

/* Adds the extent of a source's disc, at attitude q_mid, to its image moments. */
void bst_scene_image_add_disc(const bst_camera *camera, bst_quat q_mid,
                              const bst_scene_source *source, bst_scene_image_moments *m);

/* Integral of the squared light of an image, 1/px^2, of light 1: the path of the source from time
 * u01[0] to u01[1] of the track (0 to 1: all of it), weighted by its light, blurred by a circular
 * Gaussian of this variance (px^2). The path is taken as 20 to 64 straight pieces of equal time and
 * uniform light; it may turn back and cross itself. What jitter faster than the pieces adds to
 * their variance widens them as a Gaussian. `moments` are the path's, `excess_px2` is their
 * variance beyond that of the straight path nearest to it. NAN when a place is behind the camera,
 * and when the path is a straight one with jitter: that is as good as a Gaussian streak. */
double bst_scene_image_squared_path(const bst_camera *camera, const bst_los_track *track,
                                    const bst_scene_source *source, const double u01[2],
                                    const bst_scene_image_moments *moments, double excess_px2,
                                    double variance_px2);

/* Widths along and across a straight uniform streak (dx, dy), px, of what blurs it: `variance` of
 * PSF and pixel, px^2, widened by the smear beyond that streak. */
void bst_image_spread(double variance, const bst_scene_image_moments *m, double dx, double dy,
                      double *along, double *across);

/* Widths of the blur of a smeared image: PSF and pixel, widened along and across the streak by the
 * smear beyond a uniform straight streak (jitter, curvature). A non-Gaussian PSF counts as the
 * Gaussian with the same noise-equivalent area. Returns the variance before widening. */
double bst_image_blur(const bst_camera *camera, const bst_scene_source *source,
                      const bst_scene_image_moments *m, double dx, double dy, double *along,
                      double *across);

#endif
