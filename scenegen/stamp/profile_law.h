/* Profile law: light of a Gaussian in the pixels of one axis as polynomials of its sub-pixel
 * position. */
#ifndef BST_SCENEGEN_STAMP_PROFILE_LAW_H
#define BST_SCENEGEN_STAMP_PROFILE_LAW_H

#include "sim/device/device.h"

enum { BST_LAW_MOST_DEGREE = 15 };
/* Allowed error of a law, relative to the central pixel share of a centred Gaussian. */
#define BST_LAW_ERROR 5e-6

/* Error of a law of this degree for nodes as wide as the PSF, relative as BST_LAW_ERROR. */
double bst_profile_law_error(double sigma_px, int degree);

/* Smallest sufficient degree for a PSF of this sigma; 0: none up to BST_LAW_MOST_DEGREE. */
int bst_profile_law_degree(double sigma_px);

/* Largest widening that a law of this degree supports, in PSF variances. */
double bst_profile_law_widest(double sigma_px, int degree);

/* Size of a law for `reach` pixels on each side, floats. */
int bst_profile_law_floats(int degree, int reach);

/* Fills law[reach][degree + 1 + 6 + 4]: for the pixel d = 1..reach beyond the one that holds the
 * centre, at f = (g + 1) / 2 pixels from that one's middle, the powers of g of its share of the
 * light (degree + 1), of this share's derivative by the widening (in variances of the PSF, 6) and
 * half the second derivative (4). Pixel 1 - d has the mirror image, g -> -g. The share is erf((d -
 * f + 1/2) / (sqrt(2) sigma)) / 2 - erf((d - f - 1/2) / (sqrt(2) sigma)) / 2. */
void bst_profile_law(double sigma_px, int degree, int reach, float *law);

/* Profile law in a device buffer, after BST_LAW_HEAD floats: 1 / (sqrt(2) sigma), 1/px, and
 * bst_profile_law_widest. They are no build options, so that PSFs of all widths share a program. Of
 * degree 0: without a law. Release it with clReleaseMemObject. */
bst_status bst_profile_law_buffer(bst_ctx *ctx, cl_context context, double sigma_px, int degree,
                                  int reach, cl_mem *out) BST_MUST_CHECK;

#endif
