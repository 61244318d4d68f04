#include "boresight/psf_config.h"

static const char *const psf_models[] = {"gaussian", "moffat", "diffraction", "file", NULL};
static const char *const spectra[] = {"flat", "solar", "sources", NULL};
static const char *const file_centres[] = {"centroid", "array", NULL};
static const char *const vignetting_models[] = {"none", "cos4", "polynomial", NULL};

/* Zernike term j of Noll with radial degree n and azimuthal order m (negative: sine). */
#define ZERNIKE(j, n, m)                                                                          \
    {                                                                                             \
        .key = "z" #j, .type = BST_CONFIG_REAL, .unit = "waves", .minimum = -100, .maximum = 100, \
        .fallback = "0", .doc = "RMS of Noll's term " #j ", n = " #n ", m = " #m ".",             \
        .offset =                                                                                 \
            offsetof(bst_optics_zernike_waves, waves) + (j - BST_ZERNIKE_FIRST) * sizeof(double), \
        .size = sizeof(double)                                                                    \
    }

static const bst_config_desc zernike_table[] = {
    ZERNIKE(2, 1, 1),  ZERNIKE(3, 1, -1),  ZERNIKE(4, 2, 0),  ZERNIKE(5, 2, -2),
    ZERNIKE(6, 2, 2),  ZERNIKE(7, 3, -1),  ZERNIKE(8, 3, 1),  ZERNIKE(9, 3, -3),
    ZERNIKE(10, 3, 3), ZERNIKE(11, 4, 0),  ZERNIKE(12, 4, 2), ZERNIKE(13, 4, -2),
    ZERNIKE(14, 4, 4), ZERNIKE(15, 4, -4), ZERNIKE(16, 5, 1), ZERNIKE(17, 5, -1),
    ZERNIKE(18, 5, 3), ZERNIKE(19, 5, -3), ZERNIKE(20, 5, 5), ZERNIKE(21, 5, -5),
    ZERNIKE(22, 6, 0), ZERNIKE(23, 6, -2), ZERNIKE(24, 6, 2), ZERNIKE(25, 6, -4),
    ZERNIKE(26, 6, 4), ZERNIKE(27, 6, -6), ZERNIKE(28, 6, 6), ZERNIKE(29, 7, -1),
    ZERNIKE(30, 7, 1), ZERNIKE(31, 7, -3), ZERNIKE(32, 7, 3), ZERNIKE(33, 7, -5),
    ZERNIKE(34, 7, 5), ZERNIKE(35, 7, -7), ZERNIKE(36, 7, 7), ZERNIKE(37, 8, 0),
    BST_CONFIG_END,
};

static const bst_config_desc spiders_table[] = {
    BST_INT(bst_optics_spiders, count, "", 0, 32, "0",
            "Vanes that hold the secondary, from the rim to the centre, evenly spread."),
    BST_REAL(bst_optics_spiders, width_m, "m", 0, 1, "0", "Width of each vane."),
    BST_REAL(bst_optics_spiders, angle_deg, "deg", -360, 360, "0",
             "Direction of the first vane, from the focal plane's +x towards its +y."),
    BST_CONFIG_END,
};

static const bst_config_desc field_node_table[] = {
    BST_REAL(bst_psf_field_node, psf_fwhm_px, "px", 0, 50, "0",
             "gaussian and moffat: width at this node; 0: the camera's psf_fwhm_px."),
    BST_REAL(bst_psf_field_node, defocus_um, "um", -1e5, 1e5, "0",
             "diffraction: added to the defocus of the whole field."),
    BST_OBJECT(bst_psf_field_node, zernike_waves, zernike_table, "{}",
               "diffraction: added to the terms of the whole field."),
    BST_CONFIG_END,
};

static const bst_config_desc vignetting_table[] = {
    BST_ENUM(bst_optics_vignetting, model, vignetting_models, "\"none\"",
             "Illumination over the field: even, the fourth power of the cosine of the angle to "
             "the boresight, or a polynomial of the distance from it."),
    BST_REALS(bst_optics_vignetting, coefficients, "", -10, 10, "[0, 0, 0]",
              "polynomial: c1, c2, c3 of 1 + c1 r^2 + c2 r^4 + c3 r^6, r in half diagonals of the "
              "sensor; never below 0."),
    BST_REAL(bst_optics_vignetting, limit_px, "px", 0, 1e5, "0",
             "No light beyond this distance from the boresight; 0: no limit."),
    BST_CONFIG_END,
};

const bst_config_desc bst_optics_config_table[] = {
    BST_ENUM(bst_optics_config, psf, psf_models, "\"gaussian\"",
             "Point spread function: a Gaussian or a Moffat profile of psf_fwhm_px, diffraction by "
             "the aperture with its aberrations, or an image from a file."),
    BST_REAL(bst_optics_config, moffat_beta, "", 1.5, 100, "2.5", "moffat: exponent."),
    BST_REAL(bst_optics_config, q, "", 0, 100, "0",
             "diffraction: wavelength times focal ratio over pixel pitch, at the middle of the "
             "band; 0: from f_number and pixel_pitch_um, or else from aperture_m and "
             "pixel_scale_arcsec."),
    BST_REAL(bst_optics_config, f_number, "", 0, 1000, "0",
             "diffraction: focal ratio, for defocus, and for q where that is 0."),
    BST_REAL(bst_optics_config, pixel_pitch_um, "um", 0, 1000, "0",
             "diffraction: pixel pitch, for q where that is 0."),
    BST_FORMER("pixel_um", "pixel_pitch_um"),
    BST_REALS(bst_optics_config, band_nm, "nm", 0, 1e6, "[0, 0]",
              "diffraction: ends of the band that the PSF is averaged over, evenly; both 0: the "
              "response of camera.band, or 507 to 595 where that has no spectrum."),
    BST_ENUM(
        bst_optics_config, spectrum, spectra, "\"flat\"",
        "diffraction: photons per wavelength in the band, before its response: equal, those of a "
        "black body of 5772 K, or each source's own: sunlight as before, a star by its colour "
        "B-V, emission by its temperature. `sources` takes four transforms of the frame instead of "
        "one."),
    BST_INT(bst_optics_config, wavelengths, "", 0, 64, "8",
            "diffraction: wavelengths of the average (Gauss-Legendre); 1: the middle of the band "
            "alone."),
    BST_REAL(bst_optics_config, central_obstruction, "", 0, 0.99, "0",
             "diffraction: diameter of the central obstruction over that of the aperture; 0: the "
             "root of the camera's obscuration. What it and the spiders block counts for the PSF's "
             "shape, obscuration alone for its light."),
    BST_OBJECT(bst_optics_config, spiders, spiders_table, "{}",
               "diffraction: vanes across the aperture."),
    BST_REAL(bst_optics_config, zernike_nm, "nm", 1, 1e6, "550",
             "diffraction: wavelength that the waves of the Zernike terms are counted in."),
    BST_OBJECT(bst_optics_config, zernike_waves, zernike_table, "{}",
               "diffraction: wavefront aberration in Noll's Zernike terms, RMS over the full "
               "aperture."),
    BST_REAL(bst_optics_config, defocus_um, "um", -1e5, 1e5, "0",
             "diffraction: distance of the detector behind the focus; needs f_number."),
    BST_REAL(bst_optics_config, diffusion_px, "px", 0, 20, "0",
             "Charge diffusion: standard deviation of a Gaussian."),
    BST_REALS(bst_optics_config, fill_factor, "", 0.05, 1, "[1, 1]",
              "Light-sensitive part of the pixel's pitch in x and y, for the PSF's shape; the "
              "light lost beside it belongs to quantum_efficiency."),
    BST_FORMER("pixel_fill", "fill_factor"),
    BST_PATH(bst_optics_config, psf_file, "\"\"",
             "file: FITS image of the PSF before integration over the pixel, or a cube with one "
             "plane for each node of the field grid; relative to the scenario's folder."),
    BST_REAL(bst_optics_config, psf_oversampling, "", 0, 1000, "0",
             "file: samples per pixel and axis; 0: its keyword OVERSAMP."),
    BST_ENUM(bst_optics_config, file_centre, file_centres, "\"centroid\"",
             "file: what sits on the source's place: the centre of the light, or that of the "
             "array."),
    BST_INT(bst_optics_config, field_columns, "", 0, BST_PSF_FIELD_MAX, "1",
            "Nodes of the field grid along x, from the sensor's first to its last column; the PSF "
            "is mixed bilinearly between them."),
    BST_INT(bst_optics_config, field_rows, "", 0, BST_PSF_FIELD_MAX, "1", "The same along y."),
    BST_LIST(bst_optics_config, field, bst_psf_field_node, field_node_table, 0,
             BST_PSF_FIELD_MAX *BST_PSF_FIELD_MAX, "[]",
             "What each node of the field grid has of its own, row by row; empty: nothing."),
    BST_OBJECT(bst_optics_config, vignetting, vignetting_table, "{}",
               "Illumination of sources and sky over the field."),
    BST_CONFIG_END,
};
