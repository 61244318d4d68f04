/* The PSF that is known on board where it is no circular Gaussian: sums of products of a function
 * of x and one of y, so that images of points and streaks are made of one-dimensional profiles.
 *
 * The nodes of the field grid have their functions of y in common; what differs are those of x,
 * which mix as the nodes do. */
#ifndef BST_IMGPROC_DETECT_KNOWN_PSF_H
#define BST_IMGPROC_DETECT_KNOWN_PSF_H

#include "boresight/status.h"
#include "sim/optics/psf.h"

enum { BST_KNOWN_PSF_TERMS = 10, BST_KNOWN_PSF_POINTS = 8 };

typedef struct bst_known_psf {
    const bst_psf *psf; /* lent */
    int nodes, terms;
    int reach_px; /* light further from a source than this and half a pixel, in x or y, counts for
                     nothing */
    int per_px, side; /* samples of a function: per pixel, in all */
    double *across;   /* [nodes + 1][terms][side]; the last: the mean of the field */
    double *down;     /* [terms][side] */
    double sigma_px;  /* of the Gaussian that is most like the mean of the field */
    double like_flux; /* what that Gaussian as matched filter says of a source of unit flux */
    double lagrange[BST_KNOWN_PSF_POINTS][BST_KNOWN_PSF_POINTS]; /* [point][power] */
} bst_known_psf;

/* Of a camera of width_px x height_px, its PSF widened by a Gaussian of blur_px. What the sums miss
 * is 1e-4 of the square of the PSF at most, unless ten terms do not reach that. `psf` must outlive
 * what is made. BST_ERR_MEMORY. */
bst_status bst_known_psf_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_known_psf **out) BST_MUST_CHECK;
/* Frees a table; NULL is allowed. */
void bst_known_psf_free(bst_known_psf *known);

/* Weights of the neighbouring samples of a function at d px from the source, for its value and its
 * first and second derivative by d. Returns the first sample's number, -1: it is 0 there. */
typedef double bst_known_psf_taps[3][BST_KNOWN_PSF_POINTS];

/* Interpolation weights for value, slope and curvature of the profile.
 *
 * Given:     d  distance along an axis, px
 * Returned:  index of the first point; -1 if d is beyond the profile
 *            out  [0], [1], [2]: weights of the value and of its first and second derivative by px
 */
int bst_known_psf_taps_at(const bst_known_psf *known, double d, bst_known_psf_taps out);

/* Share of the light in a pixel of `binning` x `binning` sensor pixels whose centre lies (dx, dy)
 * of such pixels from the source, by the PSF of a node; node = known->nodes: the mean of the field.
 */
double bst_known_psf_share(const bst_known_psf *known, int node, int binning, double dx, double dy);

#endif
