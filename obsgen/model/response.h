/* How the filter that is made for the PSF known on board answers to the camera's real image of a
 * point or of a short streak. Inside of the generator. */
#ifndef BST_OBSGEN_MODEL_RESPONSE_H
#define BST_OBSGEN_MODEL_RESPONSE_H

#include <stdbool.h>

#include "obsgen/model/matched_filter_theory.h"
#include "sim/optics/psf.h"

/* Widths of the Gaussian that stands for a product of two images, pixels that are read, with the
 * pixel's own width: its line spread's, and that along a streak, which together have the product's
 * area at rest: integral of the product = 1 / (4 pi across along). */
typedef struct bst_obsgen_image_width {
    double across_px, along_px;
} bst_obsgen_image_width;

/* Distances of a falloff: this many a pixel, as far as the sums over an OTF hold. */
enum { BST_FALLOFF_PER_PX = 6, BST_FALLOFF_DISTANCES = 24 * BST_FALLOFF_PER_PX };

/* Output of the filter for points beside a point, over that at its place, by distance in pixels
 * that are read: the mean over all directions. */
typedef struct bst_falloff {
    bool tabulated; /* false: a Gaussian, which bst_matched_falloff has */
    float value[BST_FALLOFF_DISTANCES];
} bst_falloff;

typedef struct bst_response {
    bst_obsgen_image_width source, filter,
        both;               /* image by image, filter by filter, image by filter */
    double maxima_sigma_px; /* of the Gaussian whose filtered noise has as many maxima */
    bst_falloff falloff;    /* of both, as bst_response_set has it */
    double falloff_scale;   /* distances in it per px: 1, less where the image is wider */
} bst_response;

/* One side of it: a PSF at the middle of the field, in sensor pixels, widened by a Gaussian. */
typedef struct bst_response_side {
    const bst_psf *psf; /* lent; NULL: a Gaussian of sigma_px alone */
    double sigma_px;    /* before integration over the pixel; of `psf`: what widens it */
} bst_response_side;

/* The nodes of its PSF's field grid that mix at a place. */
typedef struct bst_response_nodes {
    int node[4], count;
    double weight[4];
} bst_response_nodes;

/* Nodes of the PSF's field grid about a position, with weights; none for a PSF that does not vary.
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates */
void bst_response_nodes_at(const bst_response_side *side, double x_px, double y_px,
                           bst_response_nodes *out);

/* OTF of a side's image, with that of a pixel of binning x binning sensor pixels, at a frequency in
 * cycles per sensor pixel: out = {real, imaginary}. */
void bst_response_otf(const bst_response_side *side, const bst_response_nodes *nodes, int binning,
                      double fx, double fy, double out[2]);

/* Frequency beyond which the OTF counts for nothing, cycles per sensor pixel. */
double bst_response_cutoff(const bst_response_side *side);

/* For a frame that is binned by `binning`. Gaussians in closed form, with 1/12 px^2 for the pixel;
 * a PSF by sums over its OTF (Parseval), which holds the pixel exactly: the mean over places in the
 * pixel of sum p q is the integral of Re(P conj Q) (King 1983, PASP 95, 163), the gradient's
 * covariance of the filter's output that of (2 pi)^2 f f^T |Q|^2. (x_px, y_px): place in the field.
 */
void bst_response_set(bst_response *out, const bst_response_side *source,
                      const bst_response_side *filter, int binning, double x_px, double y_px);

/* The same for images that are wider by this variance, px^2, than what `response` was set for. */
bst_response bst_response_widened(const bst_response *response, double variance_px2);

/* Integral of the product of two such images that moved along p and q, 1/px^2, as
 * bst_matched_product. */
double bst_response_product(const bst_obsgen_image_width *width, bst_obsgen_path_px p,
                            bst_obsgen_path_px q);

/* SNR that the filter for the path `filter` gives of an image that moved along `source`, over that
 * of the filter for the image itself. */
double bst_response_efficiency(const bst_response *response, bst_obsgen_path_px source,
                               bst_obsgen_path_px filter);

/* Output of the filter for an image that moved by length_px, at a place beside it along and across
 * its path, over that at its place. */
double bst_response_falloff(const bst_response *response, double along_px, double across_px,
                            double length_px);

/* sqrt(sum p^2) of a real image of unit flux that moved by length_px, over that of a Gaussian of
 * the same noise-equivalent area at rest: 1 for a Gaussian. */
double bst_response_norm_ratio(const bst_response *response, double length_px);

#endif
