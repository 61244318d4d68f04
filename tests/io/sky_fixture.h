/* A camera in orbit and a frame of it, shared by the tests of WCS and FITS. */
#ifndef BST_TESTS_IO_SKY_FIXTURE_H
#define BST_TESTS_IO_SKY_FIXTURE_H

#include <erfa.h>

#include "sim/io/wcs.h"

/* 1024 x 1024 pixels of 3 arcsec. */
static inline bst_camera fixture_camera(void) {
    return (bst_camera){.width_px = 1024,
                        .height_px = 1024,
                        .pixel_scale_arcsec = 3.0,
                        .aperture_m = 0.15,
                        .read_noise_e = 8.0,
                        .full_well_e = 80000.0,
                        .gain_e_per_dn = 1.5,
                        .offset_dn = 100.0,
                        .bits = 16};
}

/* Aberration of about 20 arcsec and a Sun that is 90 deg away. */
static inline bst_light fixture_light(void) {
    return (bst_light){.velocity_mps = {20000.0, -21000.0, 9000.0},
                       .sun_m = {2.0e10, 1.4e11, 5e10}};
}

/* Pixel (0-based) at which the camera shows an ICRS place, through ERFA alone. False when it is not
 * in front. */
static inline bool fixture_project(const bst_camera *camera, bst_quat q_cam_from_gcrf,
                                   const bst_light *light, double ra_rad, double dec_rad, double *x,
                                   double *y) {
    double star[3], bent[3], seen[3], sun_to_observer[3], beta[3];
    eraS2c(ra_rad, dec_rad, star);
    double distance_m = bst_vec3_norm(light->sun_m);
    const double c = 299792458.0, au_m = 149597870700.0;
    const double sun[3] = {light->sun_m.x, light->sun_m.y, light->sun_m.z};
    const double v[3] = {light->velocity_mps.x, light->velocity_mps.y, light->velocity_mps.z};
    double v2 = 0.0;
    for (int i = 0; i < 3; i++) {
        sun_to_observer[i] = -sun[i] / distance_m;
        beta[i] = v[i] / c;
        v2 += beta[i] * beta[i];
    }
    eraLdsun(star, sun_to_observer, distance_m / au_m, bent);
    eraAb(bent, beta, distance_m / au_m, sqrt(1.0 - v2), seen);
    bst_vec3 cam = bst_quat_rotate(q_cam_from_gcrf, (bst_vec3){seen[0], seen[1], seen[2]});
    return bst_camera_project(camera, cam, x, y);
}

#endif
