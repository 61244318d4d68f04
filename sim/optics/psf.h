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

/* Photons per wavelength, of what the camera sees through its band, at any scale. */
typedef struct bst_psf_spectrum {
    const double *wavelength_m; /* [count], ascending */
    const double *weight;       /* [count], >= 0, not all zero */
    int count;
} bst_psf_spectrum;

/* Samples of a PSF before integration over the pixel, at any scale: `planes` images
 * [height][width], one for each node of the field grid, row by row. */
typedef struct bst_psf_samples {
    const float *samples;
    int width, height, planes;
    double oversampling; /* samples per pixel and axis */
} bst_psf_samples;

/* What a PSF may need beyond the camera's description; NULL members: nothing. */
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

/* A copy of the camera whose PSF is widened by line-of-sight motion that is fast against the
 * exposure: every OTF times exp(-2 pi^2 sigma^2 f^2), as charge diffusion does. out->psf is new and
 * the caller's to free. */
bst_status bst_psf_camera_blurred(bst_ctx *ctx, const bst_camera *camera, double sigma_px,
                                  bst_camera *out) BST_MUST_CHECK;

/* A camera at another pixel scale, its PSF widened by a line of sight that trembles with this
 * variance per axis. *psf: what the caller frees after the camera, NULL without jitter.
 * BST_ERR_CONFIG as bst_camera_prepare. */
bst_status bst_psf_camera_trembling(bst_ctx *ctx, const bst_camera *camera,
                                    double pixel_scale_arcsec, double jitter_rad2, bst_camera *out,
                                    bst_psf **psf) BST_MUST_CHECK;

/* The OTF at (fx, fy) of a node: out = {real, imaginary}. */
void bst_psf_otf(const bst_psf *psf, int node, double fx, double fy, double out[2]);

/* Frequency, cycles/px, beyond which the OTF without the pixel is below 1e-9. */
double bst_psf_cutoff(const bst_psf *psf);

/* Distance from its place, px, beyond which the light of a point per pixel, mean over the circle,
 * is below 1e-9 of its peak. */
double bst_psf_reach_px(const bst_psf *psf);

/* Nodes: those of the field grid (1: the same PSF all over) for each of the spectra, one spectrum
 * after the other. */
int bst_psf_nodes(const bst_psf *psf);

/* 1, or BST_PSF_SPECTRA where each source has the PSF of its own spectrum: that of the Sun, which
 * is the first, and of other black bodies mixed with shares that sum to 1. */
int bst_psf_spectra(const bst_psf *psf);

/* The shares of the spectra after the first for a black body: that keep the photons' mean, mean
 * square and mean cube of the wavelength in the band. May be negative; of a mix of light they mix
 * as the photons do. All 0 with one spectrum, and within 2e-5 of it for the Sun. Temperatures are
 * held above 2400 K, in a thermal band (bst_band_is_thermal, or a middle beyond 3 um) above 150 K.
 */
void bst_psf_colour(const bst_psf *psf, double temperature_k, float colour[BST_PSF_COLOURS]);

/* Share of one of the spectra in light of a colour. */
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

/* Bound of the error of a pixel by mixing, over the peak, for the aperture without aberrations and
 * the colours that stars have (in a thermal band: from 200 K on); 0 with one spectrum. */
double bst_psf_mixing_error(const bst_psf *psf);

/* The nodes of the first spectrum whose PSFs mix bilinearly at a pixel place, and their weights
 * (sum 1). The grid's outer nodes sit on the centres of the sensor's corner pixels; beyond it the
 * border holds. Returns how many there are, 1 to 4; none has weight 0. */
int bst_psf_weights(const bst_psf *psf, double x_px, double y_px, int node[4], double weight[4]);

/* Whether the PSF is one circular Gaussian all over the field, integrated over full pixels, and its
 * standard deviation before that. Charge diffusion is in it. */
bool bst_psf_gaussian(const bst_psf *psf, double *sigma_px);

/* Noise-equivalent area of a node's image, px^2: 1 / integral |OTF|^2 df, the mean over places in
 * the pixel of 1 / sum p^2 (King 1983, PASP 95, 163). The signal-to-noise ratio of E electrons on
 * white noise of variance v per pixel is E / sqrt(v area). */
double bst_psf_noise_area_px2(const bst_psf *psf, int node);

/* Centroid of the image of a point of light of a colour at a pixel place, px from that place (of
 * its chief ray): what tilt, coma and other odd aberrations of the PSF make. */
void bst_psf_centroid_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                         double y_px, double out[2]);

/* Full width at half maximum of the Gaussian that has, integrated over full pixels, the same
 * noise-equivalent area as the PSF at a pixel place (mean of the nodes that mix there): the width
 * for a Gaussian filter, and for the signal-to-noise ratio of a smeared image. At least 0.1. */
double bst_psf_equivalent_fwhm_px(const bst_psf *psf, double x_px, double y_px);
/* The same of light of a colour: widths mix with the shares, as does all that is smooth in the
 * wavelength. */
double bst_psf_coloured_fwhm_px(const bst_psf *psf, const float colour[BST_PSF_COLOURS],
                                double x_px, double y_px);

/* Integral of the squared image, 1/px^2, at a pixel place: of light of a colour that is widened by
 * Gaussian variances along a direction and across it (px^2, >= 0) and drawn along the first by
 * length_px, the pixel's own width included. Without either 1 / bst_psf_noise_area_px2. Of a PSF
 * that is no Gaussian; mean over the directions of the PSF, within 3 % of the integral of
 * |OTF|^2 exp(-4 pi^2 sigma^2 f^2) sinc^2 over the frequencies (tests/optics/test_psf_gaussians.c).
 */
double bst_psf_squared_image(const bst_psf *psf, const float colour[BST_PSF_COLOURS], double x_px,
                             double y_px, double along_px2, double across_px2, double length_px);

#endif
