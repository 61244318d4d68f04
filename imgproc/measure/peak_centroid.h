/* Places by the matched filter alone: the top of its output between the pixels. */
#ifndef BST_IMGPROC_MEASURE_PEAK_CENTROID_H
#define BST_IMGPROC_MEASURE_PEAK_CENTROID_H

#include "imgproc/measure/deblend.h"

/* How well the top of a shape is known: of a source of flux F in noise s the covariance of the
 * place is (s^2 / F^2 + photons / F) (xx, xy, yy) + floor_px2, the variance of the flux
 * (s^2 + flux_photons F) / norm2. With p the PSF's share in a pixel and S = sum grad p grad p^T,
 * the top of the output sum p d of pixels d of variance s^2 + F p has the covariance S^-1 sum (s^2
 * + F p) grad p grad p^T S^-1 / F^2 (first order); its photons' part is given the shape of the
 * other. */
bst_imgproc_peak_law bst_peak_centroid_law_of(const bst_imgproc_worker *w,
                                              const bst_imgproc_shape *shape);

/* Puts *found, number i, which is not fitted, at its top. Its neighbours are not counted with: one
 * on its stamp makes it a BLEND, and it is dropped where a brighter one was fitted at its place. */
void bst_peak_centroid_place(const bst_imgproc_worker *w, int i, bst_imgproc_found *found);

#endif
