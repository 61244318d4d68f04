/* Cameras, tracks and star fields that the renderer's tests and bench share. */
#ifndef BST_TESTS_SCENE_SUPPORT_H
#define BST_TESTS_SCENE_SUPPORT_H

#include <stdlib.h>

#include "boresight/rng.h"
#include "scenegen/renderer.h"

/* A camera like the demonstration's. */
static inline bst_camera scene_camera(int width, int height) {
    return (bst_camera){.width_px = width,
                        .height_px = height,
                        .pixel_scale_arcsec = 3.0,
                        .aperture_m = 0.15,
                        .throughput = 0.7,
                        .quantum_efficiency = 0.8,
                        .photon_flux_v0_per_s_m2 = 1e10,
                        .psf_fwhm_px = 2.0,
                        .read_noise_e = 8.0,
                        .full_well_e = 65000.0,
                        .gain_e_per_dn = 1.0,
                        .offset_dn = 100.0,
                        .bits = 16};
}

/* A track with room of its own. */
typedef struct scene_track {
    bst_los_track track;
    double *time_s;
    bst_quat *q;
} scene_track;

/* Motion of the image at the sensor's centre, in px, and the camera's roll in rad; u in [0, 1]. */
typedef struct scene_motion {
    double x_px, y_px; /* travel during the exposure */
    double bend_px;    /* quadratic part, across */
    double roll_rad;   /* during the exposure */
    double jitter_px;  /* RMS per axis, tones from 5 to 200 Hz */
    double duration_s;
    int samples;
    uint64_t seed;
} scene_motion;

static inline double scene_jitter(const scene_motion *m, int axis, double t) {
    enum { TONES = 24 };
    double sum = 0.0;
    bst_rng_key key = bst_rng_make_key(m->seed, 0, "scene", "jitter");
    for (int i = 0; i < TONES; i++) {
        double f = 5.0 * pow(40.0, (i + 0.5) / TONES);
        double phase = 2.0 * BST_PI * bst_rng_uniform(key, (uint64_t)axis, (uint64_t)i);
        sum += sin(2.0 * BST_PI * f * t + phase);
    }
    return m->jitter_px * sum * sqrt(2.0 / TONES);
}

static inline scene_track scene_track_make(const bst_camera *camera, const scene_motion *m) {
    scene_track out = {{m->samples, NULL, NULL},
                       malloc((size_t)m->samples * sizeof(double)),
                       malloc((size_t)m->samples * sizeof(bst_quat))};
    double a = bst_camera_scale_rad(camera);
    for (int k = 0; k < m->samples; k++) {
        double u = (double)k / (m->samples - 1), t = u * m->duration_s;
        double x = m->x_px * (u - 0.5) + scene_jitter(m, 0, t);
        double y =
            m->y_px * (u - 0.5) + m->bend_px * 4.0 * (u - 0.5) * (u - 0.5) + scene_jitter(m, 1, t);
        /* rotation of coordinates that moves the image by (x, y) at the centre */
        out.time_s[k] = t;
        out.q[k] = bst_quat_from_rotvec((bst_vec3){-y * a, x * a, m->roll_rad * (u - 0.5)});
    }
    out.track.time_s = out.time_s;
    out.track.q_cam_from_gcrf = out.q;
    return out;
}

static inline void scene_track_free(scene_track *t) {
    free(t->time_s);
    free(t->q);
}

/* A star that sits at pixel x, y in the identity attitude. */
static inline bst_scene_source scene_star(const bst_camera *camera, double x, double y,
                                          double electrons_per_s) {
    bst_vec3 v = bst_camera_unproject(camera, x, y);
    return (bst_scene_source){
        .kind = BST_SOURCE_STAR, .apparent_mid = v, .electrons_per_s = electrons_per_s};
}

/* `count` stars over the sensor and a rim of 40 px; fluxes over `magnitudes`, counts growing as
 * 10^(0.4 m), the brightest at `brightest` electrons per second. */
static inline bst_scene_source *scene_stars(const bst_camera *camera, int count, double brightest,
                                            double magnitudes, uint64_t seed) {
    bst_scene_source *stars = malloc((size_t)count * sizeof *stars);
    bst_rng_key key = bst_rng_make_key(seed, 0, "scene", "stars");
    double top = pow(10.0, 0.4 * magnitudes);
    for (int i = 0; i < count; i++) {
        double u = bst_rng_uniform(key, (uint64_t)i, 0);
        double v = bst_rng_uniform(key, (uint64_t)i, 1);
        double w = bst_rng_uniform(key, (uint64_t)i, 2);
        stars[i] = scene_star(camera, -40.0 + u * ((double)camera->width_px + 80.0),
                              -40.0 + v * ((double)camera->height_px + 80.0),
                              brightest / (1.0 + w * (top - 1.0)));
    }
    return stars;
}

#endif
