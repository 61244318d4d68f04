/* The world coordinate system of a frame: a gnomonic (TAN) projection, with polynomials (TAN-SIP)
 * where the camera distorts, as an astrometric solution of the frame would give it. */
#ifndef BST_IO_WCS_H
#define BST_IO_WCS_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"
#include "sim/io/sip.h"

/* FITS pixels count from 1. xi, eta (deg, east and north on the tangent plane at crval) =
 * cd * (pixel - crpix), the pixel undistorted by `sip`. Calabretta and Greisen (2002), section
 * 5.1.3. */
typedef struct bst_wcs {
    double crpix[2];     /* FITS pixel of the boresight */
    double crval_deg[2]; /* ICRS right ascension and declination there */
    double cd_deg[2][2]; /* deg per pixel */
    double residual_px;  /* largest misfit of the projection over the sensor */
    bst_sip sip;         /* order 0: none */
} bst_wcs;

/* The TAN projection that takes ICRS catalogue places to pixels of the whole sensor as the frame
 * shows them: `q_cam_from_gcrf` is the attitude averaged over the exposure and `light` holds the
 * observer's aberration and the Sun's deflection, which the solution absorbs. Least squares over a
 * 9 x 9 grid of pixels; bst_sip_fit for a camera with distortion. BST_ERR_NUMERIC when the field is
 * too wide for one tangent plane. */
bst_status bst_wcs_fit(bst_ctx *ctx, const bst_camera *camera, bst_quat q_cam_from_gcrf,
                       const bst_light *light, bst_wcs *out) BST_MUST_CHECK;

/* How far (px) the polynomials of a frame's solution miss the distortion of the camera, at worst
 * over the sensor, for an observer at rest: WCSRESID without aberration. 0 for a camera without
 * distortion, INFINITY when the field is too wide for a solution. */
double bst_wcs_distortion_misfit_px(const bst_camera *camera);

/* The same solution for the pixels of a read-out window, binned `binning` times. */
bst_wcs bst_wcs_window(const bst_wcs *wcs, bst_window window, int binning);

/* Our pixel (0-based) of an ICRS place (rad); false when it is 90 deg or more away from crval. */
bool bst_wcs_sky_to_px(const bst_wcs *wcs, double ra_rad, double dec_rad, double *x_px,
                       double *y_px);
/* ICRS place (rad) of our pixel (0-based). */
void bst_wcs_px_to_sky(const bst_wcs *wcs, double x_px, double y_px, double *ra_rad,
                       double *dec_rad);

#endif
