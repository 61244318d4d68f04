/* World coordinate system of a frame: gnomonic projection (TAN), with SIP polynomials for a
 * distorted camera (TAN-SIP), as an astrometric solution. */
#ifndef BST_IO_WCS_H
#define BST_IO_WCS_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"
#include "sim/io/sip.h"

/* FITS pixels start at 1. xi, eta (deg, east and north on the tangent plane at crval) = cd * (pixel
 * - crpix), after removing the distortion `sip`. Calabretta and Greisen (2002), section 5.1.3. */
typedef struct bst_wcs {
    double crpix[2];     /* FITS pixel of the boresight */
    double crval_deg[2]; /* ICRS right ascension and declination there */
    double cd_deg[2][2]; /* deg per pixel */
    double residual_px;  /* largest error of the projection over the sensor */
    bst_sip sip;         /* order 0: none */
} bst_wcs;

/* Fits the WCS of the full sensor to ICRS catalogue directions: `q_cam_from_gcrf` is the mean
 * attitude of the exposure, `light` has the observer's aberration and the Sun's light deflection,
 * which the solution absorbs. Least squares over 9 x 9 pixels; bst_sip_fit for a distorted camera.
 * BST_ERR_NUMERIC: the field is too wide for one tangent plane. */
bst_status bst_wcs_fit(bst_ctx *ctx, const bst_camera *camera, bst_quat q_cam_from_gcrf,
                       const bst_light *light, bst_wcs *out) BST_MUST_CHECK;

/* Largest error (px) of the SIP polynomials for the camera's distortion over the sensor, for an
 * observer at rest: WCSRESID without aberration. 0 without distortion, INFINITY if the field is too
 * wide. */
double bst_wcs_distortion_misfit_px(const bst_camera *camera);

/* Adapts a full-sensor WCS to a readout window, binned `binning` times. */
bst_wcs bst_wcs_window(const bst_wcs *wcs, bst_window window, int binning);

/* Pixel (0-based) of an ICRS direction (rad); false: 90 degrees or more from crval. */
bool bst_wcs_sky_to_px(const bst_wcs *wcs, double ra_rad, double dec_rad, double *x_px,
                       double *y_px);
/* ICRS direction (rad) of a pixel (0-based). */
void bst_wcs_px_to_sky(const bst_wcs *wcs, double x_px, double y_px, double *ra_rad,
                       double *dec_rad);

#endif
