/* Non-Gaussian PSF known on board as a sum of separable terms (x profile times y profile), so that
 * images of points and streaks are computed from one-dimensional profiles.
 *
 * All nodes of the field grid share the y profiles. Their x profiles differ and are interpolated
 * between nodes. */
#ifndef BST_IMGPROC_DETECT_KNOWN_PSF_H
#define BST_IMGPROC_DETECT_KNOWN_PSF_H

#include "boresight/status.h"
#include "sim/optics/psf.h"

enum { BST_KNOWN_PSF_TERMS = 10, BST_KNOWN_PSF_POINTS = 8 };

typedef struct bst_known_psf {
    const bst_psf *psf; /* lent */
    int nodes, terms;
    /* half width of the PSF, px: light more than half a pixel beyond it in x or y is neglected */
    int reach_px;
    int per_px, side; /* profile samples per pixel, and in all */
    double *across;   /* x profiles [nodes + 1][terms][side]; the last node: field average */
    double *down;     /* y profiles [terms][side] */
    double sigma_px;  /* of the Gaussian nearest to the field average */
    /* flux that this Gaussian as matched filter measures for a source of unit flux */
    double like_flux;
    double lagrange[BST_KNOWN_PSF_POINTS][BST_KNOWN_PSF_POINTS]; /* [point][power] */
} bst_known_psf;

/* Decomposes the PSF of a camera of width_px x height_px, widened by a Gaussian of blur_px. The
 * decomposition loses at most 1e-4 of the PSF's energy, unless ten terms do not suffice.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: `psf` must outlive *out; free with bst_known_psf_free */
bst_status bst_known_psf_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_known_psf **out) BST_MUST_CHECK;
/* Frees a table; NULL is allowed. */
void bst_known_psf_free(bst_known_psf *known);

/* Interpolation weights of neighbouring profile samples: for the value and its first and second
 * derivative. */
typedef double bst_known_psf_taps[3][BST_KNOWN_PSF_POINTS];

/* Interpolation weights for value, slope and curvature of the profile.
 *
 * Given:     d  distance along an axis, px
 * Returned:  index of the first point; -1 if d is beyond the profile
 *            out  [0], [1], [2]: weights of the value and of its first and second derivative by px
 */
int bst_known_psf_taps_at(const bst_known_psf *known, double d, bst_known_psf_taps out);

/* Share of a source's light in a binned pixel.
 *
 * Given:     node     field node; known->nodes: the field average
 *            binning  side of the pixel, sensor px
 *            dx, dy   pixel centre minus source, binned px */
double bst_known_psf_share(const bst_known_psf *known, int node, int binning, double dx, double dy);

#endif
