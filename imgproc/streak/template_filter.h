/* Matched filter with an image as its template. */
#ifndef BST_IMGPROC_STREAK_TEMPLATE_FILTER_H
#define BST_IMGPROC_STREAK_TEMPLATE_FILTER_H

#include <stdbool.h>

#include "boresight/status.h"

/* Template, its spectrum and work space. */
typedef struct bst_template_filter bst_template_filter;

/* Creates a filter for frames of width x height px and unit noise.
 *
 * Given:     values  [rows][columns] of unit sum of squares; copied
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_template_filter_free */
bst_status bst_template_filter_create(bst_ctx *ctx, int width, int height, const float *values,
                                      int columns, int rows,
                                      bst_template_filter **out) BST_MUST_CHECK;
/* Frees a filter; NULL is allowed. */
void bst_template_filter_free(bst_template_filter *filter);

/* A maximum of the filter's output. */
typedef struct bst_template_peak {
    double x_px, y_px; /* of the template's corner; may lie outside the frame */
    double amplitude;  /* of the template */
    double snr;
    double cov_xx, cov_xy, cov_yy; /* of the position, px^2 */
    bool whole; /* a maximum on all sides, not one at the limit of what was asked for */
} bst_template_peak;

/* Highest maximum in SNR of a frame.
 *
 * Given:     image         [height][width]
 *            least_inside  least share of the template's energy inside the frame, above 0.05
 * Returned:  false: no positive value */
bool bst_template_filter_peak(bst_template_filter *filter, const float *image, double least_inside,
                              bst_template_peak *out);

/* Subtracts the template from the image at a peak (bilinear between pixels). */
void bst_template_filter_subtract(const bst_template_filter *filter, float *image,
                                  const bst_template_peak *peak);

#endif
