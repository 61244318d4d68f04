/* SIP distortion polynomials of a frame's WCS (Shupe et al. 2005, ADASS XIV, ASP Conf. 347,
 * 491). */
#ifndef BST_IO_SIP_H
#define BST_IO_SIP_H

#include <stdbool.h>

#include "boresight/camera.h"
#include "sim/astro/bodies.h"

#define BST_SIP_ORDER 9 /* highest order that readers support */
#define BST_SIP_TERMS 55

/* u, v: FITS pixels from CRPIX; U, V: the same on an undistorted plane, so that (xi, eta) =
 * cd * (U, V).
 *   U = u + sum a[pq] u^p v^q,  V = v + sum b[pq] u^p v^q,    2 <= p + q <= order
 *   u = U + sum ap[pq] U^p V^q, v = V + sum bp[pq] U^p V^q,   0 <= p + q <= inverse_order
 * order 0: no distortion. */
typedef struct bst_sip {
    int order, inverse_order;
    double a[BST_SIP_TERMS], b[BST_SIP_TERMS], ap[BST_SIP_TERMS], bp[BST_SIP_TERMS];
} bst_sip;

/* Index of the term u^p v^q in the coefficient arrays: (0,0), (1,0), (0,1), (2,0), (1,1), (0,2)
 * ... */
static inline int bst_sip_term(int p, int q) {
    int n = p + q;
    return n * (n + 1) / 2 + q;
}

/* Fits a TAN-SIP solution to the camera's mapping from pixels to ICRS catalogue directions (see
 * bst_wcs_fit): crval (rad), cd (rad per pixel) and sip. Chebyshev interpolation over the sensor
 * with the lowest order, at most 9, that omits less than 1e-5 px; the inverse by least squares.
 * *residual_px: largest error over the sensor. False: the field is too wide for one tangent
 * plane. */
bool bst_sip_fit(const bst_camera *camera, bst_quat q_cam_from_gcrf, const bst_light *light,
                 double crval_rad[2], double cd_rad[2][2], bst_sip *out, double *residual_px);

/* Undistorted offsets (U, V) from pixel offsets (u, v), by the SIP polynomials. */
void bst_sip_undistort(const bst_sip *sip, double u, double v, double *big_u, double *big_v);

/* Distorted pixel offsets from undistorted ones: inverse polynomial, then refined by iteration.
 *
 * Given:     big_u, big_v  undistorted offsets from the reference pixel, px
 * Returned:  u, v  distorted offsets, px */
void bst_sip_distort(const bst_sip *sip, double big_u, double big_v, double *u, double *v);

/* Scales the SIP polynomials to pixels that are `binning` times larger. */
void bst_sip_bin(bst_sip *sip, double binning);

#endif
