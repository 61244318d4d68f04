/* The camera: focal-plane geometry, radiometry and detector numbers, one description for rendering,
 * truth and the onboard side. */
#ifndef BORESIGHT_CAMERA_H
#define BORESIGHT_CAMERA_H

#include <math.h>
#include <stdbool.h>

#include "boresight/background_config.h"
#include "boresight/band_config.h"
#include "boresight/config.h"
#include "boresight/detector_config.h"
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

/* What bst_camera_prepare works out. */
typedef struct bst_camera_geometry {
    bool general; /* rotated or distorted: the general formulae are needed */
    double cos_rotation, sin_rotation;
    double domain;       /* tangent radius, undistorted, within which the map is one to one */
    double image_radius; /* tangent radius, distorted, within which every place has an original */
    double stretch, shrink; /* bounds of the local scale over that of the boresight, in the field */
    double curvature;       /* bound of the map's second derivative in the field */
} bst_camera_geometry;

typedef struct bst_camera {
    int64_t width_px, height_px;
    double pixel_scale_arcsec;                 /* at the boresight; tangent (gnomonic) projection */
    double focal_length_m, f_number, pixel_um; /* NAN: not known; they serve the scale alone */
    double aperture_m;                         /* diameter of the entrance pupil */
    double obscuration;                        /* fraction of the pupil's area that is blocked */
    double throughput;                         /* optics, 0..1 */
    double quantum_efficiency;                 /* band mean, 0..1 */
    double photon_flux_v0_per_s_m2;            /* photons of a V = 0 star in the camera's band */
    double psf_fwhm_px;                        /* Gaussian, Moffat */
    double background_mag_arcsec2;             /* uniform sky, V per square arcsecond */
    double dark_current_e_per_s;
    double read_noise_e;
    double full_well_e;
    double gain_e_per_dn;
    double offset_dn;
    int64_t bits;
    double rotation_deg; /* of the focal plane about the boresight, from camera +x towards +y */
    double boresight_offset_px[2]; /* place of the boresight, from the sensor's centre */
    bst_camera_distortion distortion;
    bst_optics_config optics;  /* PSF (see psf.h) and vignetting */
    const struct bst_psf *psf; /* made of this camera, lent to its copies, or NULL; a copy whose
                                  optics, aperture or scale are changed must clear it */
    bst_detector_config detector;
    bst_band_config band;
    const struct bst_band *spectrum; /* made from `band` and kept by the world; NULL: the V band of
                                 photon_flux_v0_per_s_m2, the same for all colours */
    bst_background_config background;
    const struct bst_scene_pst *pst; /* made from `background` and kept by the world; NULL: none */
    bst_camera_geometry
        geometry; /* by bst_camera_prepare; all zero: neither turned nor distorted */
} bst_camera;

extern const bst_config_desc bst_camera_config[];
extern const bst_config_desc bst_distortion_config[];

/* What a configuration leaves open (NAN) of pixel scale, focal length, focal ratio and pixel pitch,
 * from what it gives; the scale is that of a gnomonic projection, pitch over focal length. Where
 * more is given than is needed the scale counts. BST_ERR_CONFIG, with the keys but without their
 * place, when the scale does not follow, or when keys contradict each other by more than a
 * thousandth, those of the blocks `optics` and `background` too. */
bst_status bst_camera_resolve_scale(bst_ctx *ctx, bst_camera *camera) BST_MUST_CHECK;

/* Makes `geometry` from rotation and distortion; to be called once they are set, and again when
 * they or the sensor's size or scale change. A camera with neither needs no call.
 * BST_ERR_CONFIG when the distortion folds the image inside the sensor, so that two directions
 * would meet in one pixel: the map must be one to one on a disc about the boresight whose image
 * holds the sensor (the smallest eigenvalue of the Jacobian, bounded below by min(d(r L)/dr, L) - 6
 * |p| r with L = 1 + k1 r^2 + k2 r^4 + k3 r^6, stays positive there). */
bst_status bst_camera_prepare(bst_ctx *ctx, bst_camera *camera) BST_MUST_CHECK;

/* Position of the boresight on the focal plane, px: the sensor's centre ((N-1)/2) plus the offset.
 */
static inline double bst_camera_centre_x(const bst_camera *c) {
    return 0.5 * (double)(c->width_px - 1) + c->boresight_offset_px[0];
}
static inline double bst_camera_centre_y(const bst_camera *c) {
    return 0.5 * (double)(c->height_px - 1) + c->boresight_offset_px[1];
}
static inline double bst_camera_scale_rad(const bst_camera *c) {
    return c->pixel_scale_arcsec * BST_ARCSEC_RAD;
}
/* Of the Gaussian profile with charge diffusion, before integration over the pixel. */
static inline double bst_camera_psf_sigma_px(const bst_camera *c) {
    double sigma = c->psf_fwhm_px / 2.3548200450309493; /* 2 sqrt(2 ln 2) */
    return c->optics.diffusion_px > 0.0 ? hypot(sigma, c->optics.diffusion_px) : sigma;
}
/* Angle from the boresight to the sensor's farthest corner (outer edge of the pixel), rad. */
double bst_camera_half_diagonal_rad(const bst_camera *c);

/* The general forms of the two functions below. */
bool bst_camera_project_general(const bst_camera *c, bst_vec3 v_cam, double *x_px, double *y_px);
bst_vec3 bst_camera_unproject_general(const bst_camera *c, double x_px, double y_px);

/* Camera-frame direction (any length) to pixel; false and untouched outputs when it is not in front
 * of the camera, or so far out that the distortion has folded. */
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
/* Pixel to unit direction in the camera frame. A place outside the sensor that has no original
 * gives the direction at the border of what has one. */
static inline bst_vec3 bst_camera_unproject(const bst_camera *c, double x_px, double y_px) {
    if (c->geometry.general) {
        return bst_camera_unproject_general(c, x_px, y_px);
    }
    double s = bst_camera_scale_rad(c);
    return bst_vec3_unit(
        (bst_vec3){(x_px - bst_camera_centre_x(c)) * s, (y_px - bst_camera_centre_y(c)) * s, 1.0});
}

/* Whether a direction has no image because it lies beyond the fold of the distortion, but by no
 * more than margin_px of undistorted pixels. */
bool bst_camera_beyond_fold(const bst_camera *c, bst_vec3 v_cam, double margin_px);

/* Derivative of the pixel by the direction's tangent coordinates in camera axes, a = v.x / v.z and
 * b = v.y / v.z, times the pixel scale: d(x, y) / d(a, b) = k / bst_camera_scale_rad.
 * Dimensionless; the identity without rotation and distortion. */
void bst_camera_jacobian(const bst_camera *c, bst_vec3 v_cam, double k[2][2]);

/* Angle from `centre` (unit, camera frame) within which all directions lie that fall into the
 * rectangle of pixel places [x0, x1] x [y0, y1], or may move into it by margin_px from beyond the
 * fold. For rotated or distorted cameras; includes what lies between the places of the border that
 * are tried. */
double bst_camera_reach_rad(const bst_camera *c, bst_vec3 centre, double x0, double y0, double x1,
                            double y1, double margin_px);

/* Sides of a rectangle about the boresight, in undistorted pixels along the focal plane's axes, all
 * of which the sensor sees: what a search may count on. */
void bst_camera_field_px(const bst_camera *c, double *width_px, double *height_px);

static inline bool bst_camera_distorted(const bst_camera *c) {
    const bst_camera_distortion *d = &c->distortion;
    return d->k1 != 0.0 || d->k2 != 0.0 || d->k3 != 0.0 || d->p1 != 0.0 || d->p2 != 0.0;
}

/* Largest (at least 1) and smallest (at most 1) scale of the image in the field, over that at the
 * boresight, from distortion alone. */
static inline double bst_camera_stretch(const bst_camera *c) {
    return c->geometry.general ? c->geometry.stretch : 1.0;
}
static inline double bst_camera_shrink(const bst_camera *c) {
    return c->geometry.general ? c->geometry.shrink : 1.0;
}

/* Share of the light, of sources and of the sky, that vignetting leaves on a pixel: at least 0; 1
 * without. r is the distance from the boresight: (1 + (r scale)^2)^-2 for the fourth power of the
 * cosine, and the polynomial in half diagonals. As a flat field has it, the pixel counts, not the
 * place of the source. */
double bst_camera_illumination(const bst_camera *c, double x_px, double y_px);

/* Detected electrons per second of a source of magnitude v_mag, pi/4 D^2 (1 - obscuration) *
 * throughput * QE times: photon_flux_v0 10^(-0.4 V); with a spectrum bst_band_sun 10^(-0.4 (V -
 * BST_SUN_V_MAG)), that is of a source that reflects sunlight and is as bright as V says. */
double bst_camera_electrons_per_s(const bst_camera *c, double v_mag);
/* The inverse: V of a rate of detected electrons. */
double bst_camera_v_mag(const bst_camera *c, double electrons_per_s);
/* The same of a star of colour B-V (NAN: unknown), as bst_band_star; without a spectrum the colour
 * does not matter. */
double bst_camera_star_electrons_per_s(const bst_camera *c, double v_mag, double b_minus_v);
/* Of a black body of temperature_k that fills solid_angle_sr, times its emissivity; 0 without a
 * spectrum. */
double bst_camera_thermal_electrons_per_s(const bst_camera *c, double temperature_k,
                                          double solid_angle_sr);
/* The optics' own emission, electrons per second and pixel: emissivity * radiance * pupil * the
 * pixel's solid angle * optics_beam_factor * QE (area times solid angle is the same at the detector
 * as at the pupil); 0 without a spectrum. */
double bst_camera_optics_e_per_s(const bst_camera *c);
/* Electrons per second and pixel of the sky and the optics: those of the pixel at the boresight.
 * They are the same all over the sensor, whatever solid angle gnomonic projection and distortion
 * give a pixel there, as after a flat field. */
double bst_camera_background_e_per_s(const bst_camera *c);
/* Mean dark current at the detector's temperature, e-/s, without hot pixels and maps. */
double bst_camera_dark_e_per_s(const bst_camera *c);

#pragma GCC visibility pop

#endif
