/* Frames for tests, made from erf() and random numbers only, without the code under test. */
#ifndef BST_TESTS_IMGPROC_SYNTHETIC_H
#define BST_TESTS_IMGPROC_SYNTHETIC_H

#include "imgproc/imgproc.h"

typedef struct synthetic {
    bst_camera camera;
    bst_imgproc_config config;
    int width, height;
    double sky_e, read_e; /* per pixel */
    double *mean_e;       /* [height][width]: expected electrons */
    uint16_t *pixels;
} synthetic;

/* A sensor of width x height with FWHM 2 px, read noise 8 e-, gain 2 e-/DN, offset 100 DN, 16 bits,
 * sky 4 e- and the default processing configuration. */
void synthetic_init(synthetic *s, int width, int height);
void synthetic_free(synthetic *s);

/* mean_e = sky */
void synthetic_clear(synthetic *s);
/* Adds a source: a Gaussian drawn uniformly along (dx, dy) about (x, y), integrated over pixels, to
 * 1e-7 of its peak. */
void synthetic_add(synthetic *s, double x, double y, double flux_e, double dx, double dy);
/* Poisson, multiplication (detector.em_gain), read noise, gain, offset, quantisation and clipping.
 */
void synthetic_expose(synthetic *s, bst_rng_key key, uint64_t frame);

/* Matched-filter norm sqrt(sum p^2) of the source's image at unit flux. */
double synthetic_norm(const synthetic *s, double x, double y, double dx, double dy);
/* Noise of a background pixel, electrons: sky, multiplication, read noise and quantisation. */
double synthetic_noise(const synthetic *s);
/* Cramer-Rao bound of x and y (covariance xx, xy, yy) with unknown flux, the source's own shot
 * noise included, by numerical derivatives of the image. */
void synthetic_bound(const synthetic *s, double x, double y, double flux_e, double dx, double dy,
                     double cov[3]);

/* The motion that draws stars along (dx, dy) on the sensor's middle. */
bst_camera_motion synthetic_motion(const synthetic *s, double dx, double dy);
bst_imgproc_frame synthetic_frame(const synthetic *s);
bst_imgproc *synthetic_processor(bst_ctx *ctx, const synthetic *s);
/* Room for n detections. */
bst_detections *synthetic_detections(int n);
/* Number of the detection nearest to (x, y) within radius, -1 when none. */
int synthetic_nearest(const bst_detections *d, double x, double y, double radius);
/* Whether every number in it is finite and every covariance positive. */
int synthetic_sound(const bst_detections *d);

#endif
