/* The camera: focal-plane geometry, radiometry and detector parameters; one description for
 * rendering, truth and onboard knowledge. */
#ifndef BORESIGHT_CAMERA_H
#define BORESIGHT_CAMERA_H

#include <math.h>
#include <stdbool.h>

#include "boresight/background_config.h"
#include "boresight/band_config.h"
#include "boresight/config.h"
#include "boresight/detector_config.h"
#include "boresight/ghost_config.h"
#include "boresight/psf_config.h"
#include "boresight/vec.h"

#pragma GCC visibility push(default)

/* Lens distortion in the focal plane's tangent coordinates u = (x, y), r^2 = x^2 + y^2, in units of
 * the focal length (Brown 1971, Photogrammetric Engineering 37, 855; the sign and order of the
 * coefficients are OpenCV's):
 *   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
 *   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y */
typedef struct bst_camera_distortion {
    double k1, k2, k3; /* radial */
    double p1, p2;     /* tangential */
} bst_camera_distortion;

/* Computed by bst_camera_prepare. */
typedef struct bst_camera_geometry {
    bool general; /* rotated or distorted: the general formulae are needed */
    double cos_rotation, sin_rotation;
    double domain;       /* tangent radius, undistorted, within which the map is one to one */
    double image_radius; /* tangent radius, distorted, within which every point has an original */
    double stretch, shrink; /* limits of the local scale relative to the boresight, in the field */
    double curvature;       /* upper limit of the map's second derivative in the field */
} bst_camera_geometry;

typedef struct bst_camera {
    int64_t width_px, height_px;
    double pixel_scale_arcsec; /* at the boresight; tangent (gnomonic) projection */
    double focal_length_m, f_number, pixel_pitch_um; /* NAN: unknown; used for the scale only */
    double aperture_m;                               /* diameter of the entrance pupil */
    double obscuration;             /* fraction of the pupil's area that is blocked */
    double throughput;              /* optics, 0..1 */
    double quantum_efficiency;      /* band mean, 0..1 */
    double photon_flux_v0_per_s_m2; /* photons of a V = 0 star in the camera's band */
    double psf_fwhm_px;             /* Gaussian, Moffat */
    /* in place of throughput or photon_flux_v0_per_s_m2, and of psf_fwhm_px, which follow from them
     * (bst_camera_resolve_figures); NAN or 0: not given */
    double zero_point_mag;   /* V of a Sun-like star of 1 electron/s */
    double ensquared_energy; /* share of a point's light in the pixel on whose centre it lies */
    double background_mag_arcsec2; /* uniform sky, V per square arcsecond */
    double dark_current_e_per_s;
    double read_noise_e;
    double full_well_e;
    double gain_e_per_dn;
    double offset_dn;
    int64_t bits;
    double rotation_deg; /* of the focal plane about the boresight, from camera +x towards +y */
    double boresight_offset_px[2]; /* position of the boresight relative to the sensor's centre */
    bst_camera_distortion distortion;
    bst_optics_config optics;  /* PSF (see psf.h) and vignetting */
    const struct bst_psf *psf; /* made from this camera, borrowed by its copies, or NULL; a copy
                                  with other optics, aperture or scale must clear it */
    bst_detector_config detector;
    bst_band_config band;
    const struct bst_band *spectrum; /* made from `band`, owned by the world; NULL: V band of
                                        photon_flux_v0_per_s_m2, equal for all colours */
    bst_background_config background;
    const struct bst_scene_pst *pst; /* made from `background`, owned by the world; NULL: none */
    const struct bst_stray_map *stray_map; /* read from `background`, owned by the world; or NULL */
    bst_config_list ghosts;                /* bst_ghost_config */
    const struct bst_ghosts *ghost_images; /* made from `ghosts`, owned by the world; NULL: none */
    bst_camera_geometry geometry; /* by bst_camera_prepare; all zero: no rotation, no distortion */
} bst_camera;

extern const bst_config_desc bst_camera_config[];
extern const bst_config_desc bst_distortion_config[];

/* Fills in those of pixel scale, focal length, focal ratio and pixel pitch that are NAN (not
 * given).
 *
 * Given:     camera  as read from a configuration; all but the four members are unchanged
 * Errors:    BST_ERR_CONFIG if the scale does not follow from the given values, is outside 0.001 to
 *            600 arcsec, or if values differ by more than one part in 1000; the message names the
 *            keys, without their path
 * Notes:     scale = pitch / focal length (gnomonic projection). If values are redundant, the given
 *            scale is kept. f_number and pixel_pitch_um of the blocks `optics` and `background` are
 *            compared too. */
bst_status bst_camera_resolve_scale(bst_ctx *ctx, bst_camera *camera) BST_MUST_CHECK;

/* Computes what follows from a camera's zero point and ensquared energy; without them the camera is
 * unchanged.
 *
 * Given:     camera  as read from a configuration; all but the members below are unchanged
 * Returned:  *camera  throughput (with a spectrum) or photon_flux_v0_per_s_m2 (preset "v"), and
 *            psf_fwhm_px of a Gaussian or Moffat PSF, whatever they were; the same bits if repeated
 * Errors:    BST_ERR_CONFIG with the key: a value out of its range, or a PSF without a width
 * Notes:     a camera whose spectrum is made later keeps its throughput until then: it is resolved
 *            twice
 * Reference: ensquared energy of a Gaussian: erf(1 / (2 sqrt 2 sigma))^2 */
bst_status bst_camera_resolve_figures(bst_ctx *ctx, bst_camera *camera) BST_MUST_CHECK;

/* Computes `geometry` from rotation and distortion.
 *
 * Given:     camera  with rotation, distortion, size, boresight offset and scale set
 * Errors:    BST_ERR_CONFIG if the distortion folds the image inside the sensor, so that two
 *            directions fall on one pixel
 * Notes:     call it again when one of these members changes. A camera with neither rotation nor
 *            distortion needs no call. The map must be one to one on a disc about the boresight
 *            whose image contains the sensor. Criterion: the Jacobian's smallest eigenvalue stays
 *            positive there. Its lower bound is min(d(r L)/dr, L) - 6 |p| r, with L = 1 + k1 r^2 +
 *            k2 r^4 + k3 r^6. */
bst_status bst_camera_prepare(bst_ctx *ctx, bst_camera *camera) BST_MUST_CHECK;

/* Column of the boresight, px: the sensor's centre (width_px - 1) / 2 plus the offset. */
static inline double bst_camera_centre_x(const bst_camera *c) {
    return 0.5 * (double)(c->width_px - 1) + c->boresight_offset_px[0];
}
/* Row of the boresight, px: the sensor's centre (height_px - 1) / 2 plus the offset. */
static inline double bst_camera_centre_y(const bst_camera *c) {
    return 0.5 * (double)(c->height_px - 1) + c->boresight_offset_px[1];
}
/* Angle that a pixel spans at the boresight, rad. */
static inline double bst_camera_scale_rad(const bst_camera *c) {
    return c->pixel_scale_arcsec * BST_ARCSEC_RAD;
}

/* Standard deviation of the Gaussian PSF with charge diffusion, px, before integration over the
 * pixel. */
static inline double bst_camera_psf_sigma_px(const bst_camera *c) {
    double sigma = c->psf_fwhm_px / BST_FWHM_PER_SIGMA; /* 2 sqrt(2 ln 2) */
    return c->optics.diffusion_px > 0.0 ? hypot(sigma, c->optics.diffusion_px) : sigma;
}

/* Largest angle from the boresight to a corner of the sensor (outer edge of the corner pixel), rad.
 */
double bst_camera_half_diagonal_rad(const bst_camera *c);

/* bst_camera_project for a camera that is rotated or distorted (geometry.general).
 *
 * Given:     v_cam  direction in the camera frame, any length
 * Returned:  x_px, y_px  full-sensor pixel coordinates; unchanged if the result is false
 * Notes:     false if v_cam.z <= 0 or the direction lies beyond the fold of the distortion. */
bool bst_camera_project_general(const bst_camera *c, bst_vec3 v_cam, double *x_px, double *y_px);

/* bst_camera_unproject for a camera that is rotated or distorted (geometry.general).
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates
 * Returned:  unit direction in the camera frame
 * Notes:     inverts the distortion by Newton's method. A point without an original gives the
 *            direction at the border of the domain. */
bst_vec3 bst_camera_unproject_general(const bst_camera *c, double x_px, double y_px);

/* Projects a direction onto the sensor.
 *
 * Given:     v_cam  direction in the camera frame, any length
 * Returned:  x_px, y_px  full-sensor pixel coordinates; unchanged if the result is false
 * Notes:     false if the direction does not point to the front (v_cam.z <= 0) or lies beyond the
 *            fold of the distortion. True does not mean that the pixel is on the sensor. */
static inline bool bst_camera_project(const bst_camera *c, bst_vec3 v_cam, double *x_px,
                                      double *y_px) {
    if (c->geometry.general) {
        return bst_camera_project_general(c, v_cam, x_px, y_px);
    }
    if (!(v_cam.z > 0.0)) {
        return false;
    }
    double f = 1.0 / (bst_camera_scale_rad(c) * v_cam.z);
    *x_px = bst_camera_centre_x(c) + v_cam.x * f;
    *y_px = bst_camera_centre_y(c) + v_cam.y * f;
    return true;
}

/* Direction that falls on a point of the sensor.
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates; may lie outside the sensor
 * Returned:  unit direction in the camera frame
 * Notes:     a point outside the sensor that no direction reaches gives the direction at the border
 *            of the domain. */
static inline bst_vec3 bst_camera_unproject(const bst_camera *c, double x_px, double y_px) {
    if (c->geometry.general) {
        return bst_camera_unproject_general(c, x_px, y_px);
    }
    double s = bst_camera_scale_rad(c);
    return bst_vec3_unit(
        (bst_vec3){(x_px - bst_camera_centre_x(c)) * s, (y_px - bst_camera_centre_y(c)) * s, 1.0});
}

/* Directions that fall on points of the sensor: bst_camera_unproject of each.
 *
 * Given:     x_px, y_px  [count] full-sensor pixel coordinates
 * Returned:  v_cam       [count] unit directions in the camera frame */
void bst_camera_unproject_points(const bst_camera *c, const double *x_px, const double *y_px,
                                 int count, bst_vec3 *v_cam);

/* True if a direction lies beyond the fold of the distortion, but by no more than a margin.
 *
 * Given:     v_cam      direction in the camera frame, any length
 *            margin_px  margin, in undistorted pixels */
bool bst_camera_beyond_fold(const bst_camera *c, bst_vec3 v_cam, double margin_px);

/* Derivative of the pixel coordinates with respect to the direction's tangent coordinates.
 *
 * Given:     v_cam  direction in the camera frame, v_cam.z > 0
 * Returned:  k  d(x, y) / d(a, b) times the pixel scale in rad, a = v.x / v.z, b = v.y / v.z;
 *               dimensionless
 * Notes:     the identity for a camera with neither rotation nor distortion. */
void bst_camera_jacobian(const bst_camera *c, bst_vec3 v_cam, double k[2][2]);

/* Radius of a cone that contains all directions whose image lies in a rectangle.
 *
 * Given:     centre          axis of the cone, unit vector, camera frame
 *            x0, y0, x1, y1  rectangle [x0, x1] x [y0, y1], full-sensor pixel coordinates
 *            margin_px       motion across the fold of the distortion to allow for, px
 * Returned:  angle from `centre`, rad
 * Notes:     samples the border of the rectangle at 64 points and adds the largest gap between
 *            neighbours. margin_px is added only if the rectangle reaches the fold. Meant for
 *            rotated or distorted cameras. */
double bst_camera_reach_rad(const bst_camera *c, bst_vec3 centre, double x0, double y0, double x1,
                            double y1, double margin_px);

/* Size of a rectangle about the boresight that lies wholly on the sensor, for planning searches.
 *
 * Returned:  width_px, height_px  sides along the focal plane's axes, in undistorted pixels */
void bst_camera_field_px(const bst_camera *c, double *width_px, double *height_px);

/* True if a coefficient of the lens distortion is not zero. */
static inline bool bst_camera_distorted(const bst_camera *c) {
    const bst_camera_distortion *d = &c->distortion;
    return d->k1 != 0.0 || d->k2 != 0.0 || d->k3 != 0.0 || d->p1 != 0.0 || d->p2 != 0.0;
}

/* Upper bound of the local image scale in the field over that at the boresight, at least 1.
 * Distortion alone; 1 for a camera with neither rotation nor distortion. */
static inline double bst_camera_stretch(const bst_camera *c) {
    return c->geometry.general ? c->geometry.stretch : 1.0;
}

/* Lower bound of the local image scale in the field over that at the boresight, at most 1.
 * Distortion alone; 1 for a camera with neither rotation nor distortion. */
static inline double bst_camera_shrink(const bst_camera *c) {
    return c->geometry.general ? c->geometry.shrink : 1.0;
}

/* Fraction of the light that vignetting leaves on a pixel, for sources and sky alike.
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates
 * Returned:  0 or more; 1 without vignetting
 * Notes:     with r the distance from the boresight: (1 + (r scale)^2)^-2 for the fourth power of
 *            the cosine; the polynomial takes r in half diagonals of the sensor. The factor belongs
 *            to the pixel, as in a flat field, not to the position of the source. */
double bst_camera_illumination(const bst_camera *c, double x_px, double y_px);

/* Detected electrons per second of a source of a given V magnitude.
 *
 * Given:     v_mag  V magnitude
 * Returned:  e-/s: area * throughput * QE * photon flux, with area = pi/4 D^2 (1 - obscuration)
 * Notes:     without a spectrum the flux is photon_flux_v0 10^(-0.4 V). With a spectrum it is
 *            bst_band_sun 10^(-0.4 (V - BST_SUN_V_MAG)): the source reflects sunlight. */
double bst_camera_electrons_per_s(const bst_camera *c, double v_mag);

/* V magnitude of a source from its detected electrons per second; inverse of
 * bst_camera_electrons_per_s. */
double bst_camera_v_mag(const bst_camera *c, double electrons_per_s);

/* Detected electrons per second of a star.
 *
 * Given:     v_mag      V magnitude
 *            b_minus_v  colour index B-V, mag; NAN: unknown
 * Returned:  e-/s
 * Notes:     the flux is that of bst_band_star. Without a spectrum the colour has no effect. */
double bst_camera_star_electrons_per_s(const bst_camera *c, double v_mag, double b_minus_v);

/* Detected electrons per second of a black body (emissivity 1).
 *
 * Given:     temperature_k   temperature, K
 *            solid_angle_sr  solid angle of the body, sr
 * Returned:  e-/s; 0 without a spectrum */
double bst_camera_thermal_electrons_per_s(const bst_camera *c, double temperature_k,
                                          double solid_angle_sr);

/* Thermal emission of the optics, electrons per second and pixel.
 *
 * Returned:  emissivity * radiance * pupil area * solid angle of a pixel * optics_beam_factor * QE;
 *            0 without a spectrum
 * Notes:     area times solid angle (etendue) is the same at the detector and at the pupil. */
double bst_camera_optics_e_per_s(const bst_camera *c);

/* Electrons per second and pixel of the uniform sky and of the optics, at the boresight.
 *
 * Notes:     the value holds for all pixels, as after flat-fielding: the solid angle of a pixel off
 *            axis is not taken into account. */
double bst_camera_background_e_per_s(const bst_camera *c);
/* Mean dark current of a pixel at the detector's temperature, e-/s, without hot pixels and maps. */
double bst_camera_dark_e_per_s(const bst_camera *c);
/* Mean charge of a pixel that is gathered outside the exposure, e-: dark current during read-out
 * and clock-induced charge, without hot pixels, maps and glow. */
double bst_camera_readout_e(const bst_camera *c);
/* Mean dark signal of a pixel in a frame, e-: dark current of the exposure and what
 * bst_camera_readout_e gives. */
double bst_camera_dark_e(const bst_camera *c, double exposure_s);
/* Variance of read charge over its mean: 2 - 1 / em_gain with a multiplication register (of the
 * charge itself); with a ramp, whose line weighs the charge of its intervals, up to 1.2; else 1. */
double bst_camera_excess_noise(const bst_camera *c);
/* RMS of what a pixel's read noise has anew in each frame, e-: of the read, and of the reset; or of
 * the two reads of double sampling. Not for a ramp. */
double bst_camera_white_noise_e(const bst_camera *c);
/* RMS of the read noise of a pixel in a frame, e-: bst_camera_white_noise_e and 1/f noise of the
 * pixel, or noise of the line through the reads of a ramp. */
double bst_camera_read_noise_e(const bst_camera *c);
/* Light of an exposure that fills a pixel's well before a frame shows that it is full, e-:
 * full_well_e, with a ramp of N reads N - 1 times as much. */
double bst_camera_full_e(const bst_camera *c);
/* Noise of a pixel, e-: shot noise of a sky of sky_e and of the dark signal, as multiplied, and
 * read noise. */
double bst_camera_noise_e(const bst_camera *c, double sky_e, double exposure_s);

#pragma GCC visibility pop

#endif
