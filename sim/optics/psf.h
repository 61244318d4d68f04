/* The point spread function of a camera as its optical transfer function (OTF): optics averaged
 * over the band, defocus, charge diffusion and the pixel's own aperture in one complex number per
 * spatial frequency. Made once from the camera, then read only: any number of threads may ask.
 *
 * Frequencies are in cycles per pixel along the image's x and y. The image of a point at the pixel
 * place x0 is, per pixel at x,
 *     image(x) = integral of OTF(f) exp(2 pi i f . (x - x0)) df   (real: OTF(-f) = conj OTF(f)),
 * and sums to 1 over all pixels, as OTF(0) = 1. */
#ifndef BST_OPTICS_PSF_H
#define BST_OPTICS_PSF_H

#include <stdbool.h>

#include "boresight/camera.h"
#include "sim/optics/band.h"

typedef struct bst_psf bst_psf;

/* Relative photon spectrum of the light through the camera's band. */
typedef struct bst_psf_spectrum {
    const double *wavelength_m; /* [count], ascending */
    const double *weight;       /* [count], >= 0, not all zero */
    int count;
} bst_psf_spectrum;

/* PSF samples before integration over the pixel, any scale: `planes` images [height][width], one
 * per node of the field grid, row by row. */
typedef struct bst_psf_samples {
    const float *samples;
    int width, height, planes;
    double oversampling; /* samples per pixel and axis */
} bst_psf_samples;

/* Additional inputs of a PSF; NULL members: not given. */
typedef struct bst_psf_inputs {
    const bst_psf_samples *samples;   /* for BST_PSF_FILE; copied */
    const bst_psf_spectrum *spectrum; /* for BST_PSF_DIFFRACTION, instead of optics.spectrum and
                                         band_nm; each entry becomes a wavelength of the average */
} bst_psf_inputs;

/* Creates the PSF of a camera, or takes a reference to the one that it has (camera->psf).
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_CONFIG, with the key of `optics`: defocus without a focal ratio, a field list
 *            of the wrong length, a completely obstructed aperture, aberrations of a slope above 64
 *            waves per aperture diameter, samples that are missing or empty; BST_ERR_MEMORY
 * Ownership: release *out with bst_psf_free */
bst_status bst_psf_create(bst_ctx *ctx, const bst_camera *camera, bst_psf **out) BST_MUST_CHECK;

/* bst_psf_create with samples or a spectrum from the caller.
 *
 * Given:     inputs  samples of a PSF file and spectrum; NULL members: not given
 * Returned:  *out  NULL on error
 * Errors:    those of bst_psf_create
 * Ownership: release *out with bst_psf_free
 * Notes:     with neither samples nor spectrum, a camera that has a PSF shares it. */
bst_status bst_psf_create_from(bst_ctx *ctx, const bst_camera *camera, const bst_psf_inputs *inputs,
                               bst_psf **out) BST_MUST_CHECK;
/* Releases a reference to a PSF; the last one frees it. NULL is allowed. */
void bst_psf_free(bst_psf *psf);

/* Copies a camera with its PSF widened by fast line-of-sight motion: each OTF times exp(-2 pi^2
 * sigma^2 f^2), like charge diffusion. The caller frees out->psf. */
bst_status bst_psf_camera_blurred(bst_ctx *ctx, const bst_camera *camera, double sigma_px,
                                  bst_camera *out) BST_MUST_CHECK;

/* Copies a camera with another pixel scale, its PSF widened by line-of-sight jitter of this
 * variance per axis. *psf: to be freed after the camera; NULL without jitter. BST_ERR_CONFIG as
 * bst_camera_prepare. */
bst_status bst_psf_camera_trembling(bst_ctx *ctx, const bst_camera *camera,
                                    double pixel_scale_arcsec, double jitter_rad2, bst_camera *out,
                                    bst_psf **psf) BST_MUST_CHECK;

/* OTF of a node at (fx, fy): out = {real, imaginary}. */
void bst_psf_otf(const bst_psf *psf, int node, double fx, double fy, double out[2]);

/* Frequency, cycles/px, above which the OTF without the pixel is below 1e-9. */
double bst_psf_cutoff(const bst_psf *psf);

/* Distance, px, beyond which the mean light per pixel of a point is below this part of its peak, at
 * least 1e-9. */
double bst_psf_reach_px(const bst_psf *psf, double part);

/* Number of nodes: those of the field grid (1: uniform PSF) for each spectrum, one spectrum after
 * the other. */
int bst_psf_nodes(const bst_psf *psf);

/* Number of spectra: 1, or BST_PSF_SPECTRA if the PSF depends on a source's spectrum: the Sun's,
 * which is the first, and other black bodies, mixed with fractions that sum to 1. */
int bst_psf_spectra(const bst_psf *psf);

/* Fractions of the spectra after the first for a black body; they preserve the photons' mean, mean
 * square and mean cube of the wavelength in the band. They may be negative; for mixed light they
 * mix like the photons. All 0 with one spectrum, and within 2e-5 of it for the Sun. Temperatures
 * are held above 2400 K, in a thermal band (bst_band_is_thermal, or a middle beyond 3 um) above 150
 * K. */
void bst_psf_colour(const bst_psf *psf, double temperature_k, float colour[BST_PSF_COLOURS]);

/* Fraction of one spectrum in light of a colour. */
static inline double bst_psf_share(const float colour[BST_PSF_COLOURS], int spectrum) {
    double rest = 1.0;
    for (int s = 0; s < BST_PSF_COLOURS; s++) {
        if (s + 1 == spectrum) {
            return (double)colour[s];
        }
        rest -= (double)colour[s];
    }
    return rest;
}

/* Upper limit of a pixel's error by mixing spectra, relative to the peak, for the unaberrated
 * aperture and the colours of stars (in a thermal band: from 200 K); 0 with one spectrum. */
double bst_psf_mixing_error(const bst_psf *psf);

/* Nodes of the first spectrum for bilinear interpolation at a pixel position, and their weights
 * (sum 1). The outer nodes are at the centres of the sensor's corner pixels; beyond them the border
 * value holds. Returns their number, 1 to 4; no weight is 0. */
int bst_psf_weights(const bst_psf *psf, double x_px, double y_px, int node[4], double weight[4]);

/* True if the PSF is one circular Gaussian over the field, integrated over full pixels; *sigma_px:
 * before integration, including charge diffusion. */
bool bst_psf_gaussian(const bst_psf *psf, double *sigma_px);

/* Noise-equivalent area of a node's image, px^2: 1 / integral |OTF|^2 df, the mean over places in
 * the pixel of 1 / sum p^2 (King 1983, PASP 95, 163). The signal-to-noise ratio of E electrons on
 * white noise of variance v per pixel is E / sqrt(v area). */
double bst_psf_noise_area_px2(const bst_psf *psf, int node);

/* Centroid of a point's image relative to its chief ray, px: by tilt, coma and other odd
 * aberrations, for light of a colour. */
void bst_psf_centroid_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                         double y_px, double out[2]);

/* FWHM of the Gaussian that, integrated over pixels, has the noise-equivalent area of the PSF at a
 * pixel position (mean of the interpolated nodes): the width for Gaussian filters and for the SNR
 * of smeared images. At least 0.1. */
double bst_psf_equivalent_fwhm_px(const bst_psf *psf, double x_px, double y_px);
/* FWHM as bst_psf_equivalent_fwhm_px, for light of a colour: widths mix with the fractions. */
double bst_psf_coloured_fwhm_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS],
                                double x_px, double y_px);

/* Integral of the squared image, 1/px^2, at a pixel position, for light of a colour, widened by
 * Gaussian variances along and across a direction (px^2, >= 0) and smeared by length_px along it,
 * including the pixel. Without either 1 / bst_psf_noise_area_px2. Of a PSF that is no Gaussian;
 * mean over the directions of the PSF, within 3 % of the integral of |OTF|^2 exp(-4 pi^2 sigma^2
 * f^2) sinc^2 over the frequencies (tests/optics/test_psf_gaussians.c). */
double bst_psf_squared_image(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                             double y_px, double along_px2, double across_px2, double length_px);

#endif
