/* Width of a star's image by a fit to its pixels. */
#ifndef BST_ANALYSIS_CAMERA_POINT_WIDTH_H
#define BST_ANALYSIS_CAMERA_POINT_WIDTH_H

#include <stdbool.h>

enum { BST_POINT_WIDTH_SIDE = 13 };

/* Fits a round Gaussian, integrated over the pixels, and a constant level by least squares.
 *
 * Given:     pixels      [BST_POINT_WIDTH_SIDE][BST_POINT_WIDTH_SIDE] row by row, any unit
 *            x_px, y_px  approximate place of the star in them, the first pixel's centre is 0
 * Returned:  *fwhm_px    before integration over the pixel; false: no star there */
bool bst_point_width_fit(const double *pixels, double x_px, double y_px, double *fwhm_px);

#endif
