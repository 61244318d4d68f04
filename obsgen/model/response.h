/* Response of the matched filter, built for the onboard PSF, to the camera's real image of a point
 * or short streak. Internal to the generator. */
#ifndef BST_OBSGEN_MODEL_RESPONSE_H
#define BST_OBSGEN_MODEL_RESPONSE_H

#include <stdbool.h>

#include "obsgen/model/matched_filter_theory.h"
#include "sim/optics/psf.h"

/* Equivalent Gaussian widths of the product of two images, read-out px, pixel included: of the line
 * spread function, and along a streak. At rest the integral of the product is 1 / (4 pi across
 * along). */
typedef struct bst_obsgen_image_width {
    double across_px, along_px;
} bst_obsgen_image_width;

/* Samples of the falloff: per pixel, and in all. */
enum { BST_FALLOFF_PER_PX = 6, BST_FALLOFF_DISTANCES = 24 * BST_FALLOFF_PER_PX };

/* Widths for which the falloff is tabulated: Chebyshev nodes of the root of the product's variance
 * relative to that of the widened product, from the root of BST_FALLOFF_LEAST to 1. With eight of
 * them interpolation is accurate to 3e-5 of the peak for an Airy pattern. */
enum { BST_FALLOFF_WIDTHS = 8 };
#define BST_FALLOFF_LEAST 0.2

/* Output of the point filter beside a point, by distance in read-out px; mean over all directions.
 */
typedef struct bst_falloff {
    bool tabulated;                     /* false: Gaussian, see bst_matched_falloff */
    float value[BST_FALLOFF_DISTANCES]; /* relative to its peak */
    float widened[BST_FALLOFF_WIDTHS][BST_FALLOFF_DISTANCES];
    /* share of a point's light on a pixel at a distance: of the fitted PSF, and of the source for
     * the same kind of widths */
    float model[BST_FALLOFF_DISTANCES], image[BST_FALLOFF_DISTANCES];
    float widened_image[BST_FALLOFF_WIDTHS][BST_FALLOFF_DISTANCES];
} bst_falloff;

typedef struct bst_response {
    bst_obsgen_image_width source, filter,
        both;                /* source x source, filter x filter, source x filter */
    double maxima_sigma_px;  /* Gaussian whose filtered noise has the same density of maxima */
    double nearest_sigma_px; /* Gaussian nearest to the filter's image, without the pixel */
    bst_falloff falloff;     /* of source x filter */
    double product_px2;      /* variance of source x filter for which the falloff is tabulated */
    double widened_px2;      /* variance by which the source has been widened since */
    double falloff_scale;    /* table distance per px: 1, less for the widest images */
    double image_px2;        /* variance of the source for which its image is tabulated */
    double image_scale;      /* as falloff_scale */
} bst_response;

/* An image model: PSF at a field position, sensor px, widened by a Gaussian. */
typedef struct bst_response_side {
    const bst_psf *psf; /* lent; NULL: Gaussian of sigma_px only */
    double sigma_px;    /* before pixel integration; with `psf`: widening only */
} bst_response_side;

/* Nodes of the PSF's field grid about a position. */
typedef struct bst_response_nodes {
    int node[4], count;
    double weight[4];
} bst_response_nodes;

/* Nodes of the PSF's field grid about a position, with weights; none for a PSF that does not vary.
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates */
void bst_response_nodes_at(const bst_response_side *side, double x_px, double y_px,
                           bst_response_nodes *out);

/* OTF of an image including a pixel of binning x binning sensor pixels, at a frequency in cycles
 * per sensor pixel: out = {real, imaginary}. */
void bst_response_otf(const bst_response_side *side, const bst_response_nodes *nodes, int binning,
                      double fx, double fy, double out[2]);

/* Frequency beyond which the OTF is negligible, cycles per sensor pixel. */
double bst_response_cutoff(const bst_response_side *side);

/* Computes the response for a frame of given binning at field position (x_px, y_px).
 *
 * Notes:     Gaussians are closed-form, with 1/12 px^2 for the pixel. A PSF uses sums over its OTF
 *            (Parseval), exact for the pixel: the mean over sub-pixel positions of sum p q is the
 *            integral of Re(P conj Q); the gradient covariance of the filter output is that of (2
 *            pi)^2 f f^T |Q|^2.
 * Reference: King 1983, PASP 95, 163 */
void bst_response_set(bst_response *out, const bst_response_side *source,
                      const bst_response_side *filter, int binning, double x_px, double y_px);

/* Response for images wider by variance_px2 than those of `response`, as by a Gaussian.
 *
 * Notes:     A tabulated falloff is that of the product of spectra times exp(-2 pi^2 variance f^2):
 *            the core widens and rings disappear, but wings keep their light. */
bst_response bst_response_widened(const bst_response *response, double variance_px2);

/* Overlap integral of two images of this width smeared along p and q, 1/px^2, as
 * bst_matched_product. */
double bst_response_product(const bst_obsgen_image_width *width, bst_obsgen_path_px p,
                            bst_obsgen_path_px q);

/* SNR of the filter for path `filter` on an image smeared along `source`, relative to its matched
 * filter. */
double bst_response_efficiency(const bst_response *response, bst_obsgen_path_px source,
                               bst_obsgen_path_px filter);

/* Filter output for an image smeared by length_px, at a position along and across its path,
 * relative to its peak. */
double bst_response_falloff(const bst_response *response, double along_px, double across_px,
                            double length_px);

/* Weight of light at a distance in the position of a noise-limited fit of a point, relative to
 * light at its place: gradient of the filter's output per distance, at least 0. For Gaussian images
 * it equals the output. */
double bst_response_pull(const bst_response *response, double distance_px);

/* Share of a point's light on a pixel whose centre is this far from it, read-out px; mean over all
 * directions. The falloff must be tabulated. */
double bst_response_image_share(const bst_response *response, double distance_px);
/* The same for the PSF that image processing fits, with its first two derivatives by distance. */
double bst_response_model_share(const bst_response *response, double distance_px, double *slope,
                                double *curvature);

/* sqrt(sum p^2) of a real image of unit flux smeared by length_px, relative to a Gaussian of the
 * same noise-equivalent area at rest; 1 for a Gaussian. */
double bst_response_norm_ratio(const bst_response *response, double length_px);

#endif
