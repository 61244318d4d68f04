/* The light of a Gaussian on the pixels of one axis, as polynomials of its place within a pixel. */
#ifndef BST_SCENEGEN_STAMP_PROFILE_LAW_H
#define BST_SCENEGEN_STAMP_PROFILE_LAW_H

#include "sim/device/device.h"

enum { BST_LAW_MOST_DEGREE = 15 };
/* What a law may miss, of the share of the pixel that a centred Gaussian lights most. */
#define BST_LAW_ERROR 5e-6

/* What a law of this degree misses, likewise, of nodes as wide as the PSF. */
double bst_profile_law_error(double sigma_px, int degree);

/* Least degree that a PSF of this sigma wants; 0: none up to BST_LAW_MOST_DEGREE is good enough. */
int bst_profile_law_degree(double sigma_px);

/* Widening up to which a law of this degree serves, in variances of the PSF. */
double bst_profile_law_widest(double sigma_px, int degree);

/* Floats of a law for so many pixels on each side. */
int bst_profile_law_floats(int degree, int reach);

/* Fills law[reach][degree + 1 + 6 + 4]: for the pixel d = 1..reach beyond the one that holds the
 * centre, at f = (g + 1) / 2 pixels from that one's middle, the powers of g of its share of the
 * light (degree + 1), of this share's derivative by the widening (in variances of the PSF, 6) and
 * half the second derivative (4). Pixel 1 - d has the mirror image, g -> -g. The share is erf((d -
 * f + 1/2) / (sqrt(2) sigma)) / 2 - erf((d - f - 1/2) / (sqrt(2) sigma)) / 2. */
void bst_profile_law(double sigma_px, int degree, int reach, float *law);

/* The same on a device; of degree 0: something that is no law. Release it with clReleaseMemObject.
 */
bst_status bst_profile_law_buffer(bst_ctx *ctx, cl_context context, double sigma_px, int degree,
                                  int reach, cl_mem *out) BST_MUST_CHECK;

#endif
