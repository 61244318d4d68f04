/* Centroids from the matched filter alone: the interpolated peak of its output. */
#ifndef BST_IMGPROC_MEASURE_PEAK_CENTROID_H
#define BST_IMGPROC_MEASURE_PEAK_CENTROID_H

#include "imgproc/measure/deblend.h"

/* Error law of filter-peak centroids for a source shape.
 *
 * A source of flux F in noise s, with shot noise of variance `excess` per electron, has position
 * covariance (s^2 / F^2 + excess photons / F) (xx, xy, yy) + floor_px2 and flux variance (s^2 +
 * excess flux_photons F) / norm2.
 *
 * Notes:     p is the PSF's share in a pixel, S = sum grad p grad p^T. To first order the peak of
 *            the output sum p d, for pixels d of variance s^2 + F p, has the covariance S^-1 sum
 *            (s^2 + F p) grad p grad p^T S^-1 / F^2. The shot-noise part is given the shape of the
 *            other part. */
bst_imgproc_peak_law bst_peak_centroid_law_of(const bst_imgproc_worker *w,
                                              const bst_imgproc_shape *shape);

/* Sets a shape's path to the star streak at its position, from the camera motion. */
void bst_peak_centroid_star_path(const bst_locate_frame *frame, bst_imgproc_shape *shape);

/* Sets a shape's path to that of a point in a frame in which the camera moved unevenly: where stars
 * are points the star's path, else bend and departure of the camera alone. Otherwise it stays. */
void bst_peak_centroid_camera_path(const bst_locate_frame *frame, bst_imgproc_shape *shape);

/* Moves a shape from the maximum of a filter to where the matched filter of its whole path has its
 * own, within half a path, to a pixel. The filter of a point or a uniform streak may have its
 * maximum where an uneven path dwells, far from its mean. A path within a pixel is left. */
void bst_peak_centroid_on_path(const bst_locate_frame *frame, bst_imgproc_shape *shape);

/* Sets the locator's error laws of points and of the star streak at the frame's centre.
 *
 * Notes:     A filter of the variance s^2 for images of t^2, of points: q = (s^2 + t^2)^2 / (4 s^2
 *            t^2) is norm^2 over response^2, flux variance over that of the fit; that of places is
 *            q^2 times the fit's. */
void bst_peak_centroid_set_laws(bst_imgproc_locator *locator, const bst_locate_frame *frame);

/* Locates source i, which is not fitted, at the filter's peak. Neighbours are not modelled: one on
 * its stamp makes it a BLEND. It is dropped if a brighter source was fitted at its position. */
void bst_peak_centroid_place(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

#endif
