/* Configuration block `optics` of a camera: point spread function and vignetting. All zero:
 * Gaussian of psf_fwhm_px with full pixels. */
#ifndef BORESIGHT_PSF_CONFIG_H
#define BORESIGHT_PSF_CONFIG_H

#include "boresight/config.h"

#pragma GCC visibility push(default)

enum { BST_PSF_GAUSSIAN, BST_PSF_MOFFAT, BST_PSF_DIFFRACTION, BST_PSF_FILE };

enum { BST_SPECTRUM_FLAT, BST_SPECTRUM_SOLAR, BST_SPECTRUM_SOURCES };

/* Number of spectra that are mixed for a source's PSF with BST_SPECTRUM_SOURCES, and of their
 * fractions: all but the first, the Sun's, which has the remainder. */
enum { BST_PSF_SPECTRA = 4, BST_PSF_COLOURS = BST_PSF_SPECTRA - 1 };

enum { BST_PSF_CENTROID, BST_PSF_ARRAY };

enum { BST_VIGNETTING_NONE, BST_VIGNETTING_COS4, BST_VIGNETTING_POLYNOMIAL };

/* Noll's index of the first and last Zernike term (1, piston, has no effect). */
enum { BST_ZERNIKE_FIRST = 2, BST_ZERNIKE_LAST = 37, BST_ZERNIKE_TERMS = 36 };

/* maximum nodes of the field grid per axis */
enum { BST_PSF_FIELD_MAX = 16 };

/* Root mean square over the full circular aperture, term j at [j - 2]. */
typedef struct bst_optics_zernike_waves {
    double waves[BST_ZERNIKE_TERMS];
} bst_optics_zernike_waves;

typedef struct bst_optics_spiders {
    int64_t count;    /* vanes from the rim to the centre, evenly spaced */
    double width_m;   /* of each, at the aperture */
    double angle_deg; /* of the first, from the focal plane's +x towards its +y */
} bst_optics_spiders;

/* Values of one node of the field grid, in addition to those for the whole field. */
typedef struct bst_psf_field_node {
    double psf_fwhm_px; /* Gaussian, Moffat: instead of the camera's; 0: the camera's */
    double defocus_um;  /* added */
    bst_optics_zernike_waves zernike_waves; /* added */
} bst_psf_field_node;

typedef struct bst_optics_vignetting {
    int32_t model;          /* BST_VIGNETTING_... */
    double coefficients[3]; /* polynomial: c1, c2, c3 of 1 + c1 r^2 + c2 r^4 + c3 r^6 */
    double limit_px;        /* no light beyond this distance from the boresight; 0: unlimited */
} bst_optics_vignetting;

typedef struct bst_optics_config {
    int32_t psf;                /* BST_PSF_... */
    double moffat_beta;         /* 0: 2.5 */
    double q, f_number;         /* 0: from the aperture and the pixel scale */
    double pixel_pitch_um;      /* pitch */
    double band_nm[2];          /* both 0: the camera's spectrum, else 507 and 595 */
    int32_t spectrum;           /* BST_SPECTRUM_... */
    int64_t wavelengths;        /* of the band's quadrature; 0: 8 */
    double central_obstruction; /* diameter over that of the aperture; 0: sqrt(obscuration) */
    bst_optics_spiders spiders;
    double zernike_nm; /* wavelength of the waves; 0: 550 */
    bst_optics_zernike_waves zernike_waves;
    double defocus_um;       /* distance of the detector behind the focus */
    double diffusion_px;     /* charge diffusion, standard deviation of a Gaussian */
    double fill_factor[2];   /* light-sensitive part of the pitch, along x and y; 0: 1 */
    char psf_file[512];      /* FITS, for BST_PSF_FILE */
    double psf_oversampling; /* of psf_file, samples per pixel; 0: its keyword OVERSAMP */
    int32_t file_centre;     /* BST_PSF_CENTROID, BST_PSF_ARRAY */
    int64_t field_columns;   /* of the field grid; 0: 1 */
    int64_t field_rows;
    bst_config_list field; /* bst_psf_field_node, row by row; empty: uniform field */
    bst_optics_vignetting vignetting;
} bst_optics_config;

extern const bst_config_desc bst_optics_config_table[];

#pragma GCC visibility pop

#endif
