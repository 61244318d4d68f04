/* The camera: focal-plane geometry, radiometry and detector numbers, one description for rendering,
 * truth and the onboard side. */
#ifndef BST_WORLD_CAMERA_H
#define BST_WORLD_CAMERA_H

#include <stdbool.h>

#include "sim/core/config.h"
#include "sim/core/vec.h"

typedef struct bst_camera {
    int64_t width_px, height_px;
    double pixel_scale_arcsec;      /* at the boresight; tangent (gnomonic) projection */
    double aperture_m;              /* diameter of the entrance pupil */
    double obscuration;             /* fraction of the pupil's area that is blocked */
    double throughput;              /* optics, 0..1 */
    double quantum_efficiency;      /* band mean, 0..1 */
    double photon_flux_v0_per_s_m2; /* photons of a V = 0 star in the camera's band */
    double psf_fwhm_px;             /* Gaussian */
    double background_mag_arcsec2;  /* uniform sky, V per square arcsecond */
    double dark_current_e_per_s;
    double read_noise_e;
    double full_well_e;
    double gain_e_per_dn;
    double offset_dn;
    int64_t bits;
} bst_camera;

extern const bst_config_desc bst_camera_config[];

/* Position of the boresight on the focal plane, px: the sensor's centre ((N-1)/2). */
static inline double bst_camera_centre_x(const bst_camera *c) {
    return 0.5 * (double)(c->width_px - 1);
}
static inline double bst_camera_centre_y(const bst_camera *c) {
    return 0.5 * (double)(c->height_px - 1);
}
static inline double bst_camera_scale_rad(const bst_camera *c) {
    return c->pixel_scale_arcsec * BST_ARCSEC_RAD;
}
static inline double bst_camera_psf_sigma_px(const bst_camera *c) {
    return c->psf_fwhm_px / 2.3548200450309493; /* 2 sqrt(2 ln 2) */
}
/* Half the sensor's diagonal, rad. */
double bst_camera_half_diagonal_rad(const bst_camera *c);

/* Camera-frame direction (any length) to pixel; false and untouched outputs when it is not in front
 * of the camera. */
static inline bool bst_camera_project(const bst_camera *c, bst_vec3 v_cam, double *x_px,
                                      double *y_px) {
    if (!(v_cam.z > 0.0)) {
        return false;
    }
    double f = 1.0 / (bst_camera_scale_rad(c) * v_cam.z);
    *x_px = bst_camera_centre_x(c) + v_cam.x * f;
    *y_px = bst_camera_centre_y(c) + v_cam.y * f;
    return true;
}
/* Pixel to unit direction in the camera frame. */
static inline bst_vec3 bst_camera_unproject(const bst_camera *c, double x_px, double y_px) {
    double s = bst_camera_scale_rad(c);
    return bst_vec3_unit(
        (bst_vec3){(x_px - bst_camera_centre_x(c)) * s, (y_px - bst_camera_centre_y(c)) * s, 1.0});
}

/* Detected electrons per second of a source of magnitude v_mag:
 * photon_flux_v0 10^(-0.4 V) * pi/4 D^2 (1 - obscuration) * throughput * QE. */
double bst_camera_electrons_per_s(const bst_camera *c, double v_mag);
/* The inverse: V of a rate of detected electrons. */
double bst_camera_v_mag(const bst_camera *c, double electrons_per_s);
/* Sky electrons per second and pixel. */
double bst_camera_background_e_per_s(const bst_camera *c);

#endif
