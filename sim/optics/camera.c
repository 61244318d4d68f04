#include "boresight/camera.h"
#include "sim/optics/band.h"
#include "sim/optics/pixel_flicker.h"
#include "sim/optics/ramp_fit.h"

#define DISTORTION(k, doc) BST_REAL(bst_camera_distortion, k, "", -1e30, 1e30, "0", doc)
const bst_config_desc bst_distortion_config[] = {
    DISTORTION(k1,
               "Radial, factor of r^2, r the tangent of the angle from the boresight (Brown "
               "1971; sign and order of OpenCV)."),
    DISTORTION(k2, "Radial, factor of r^4."),
    DISTORTION(k3, "Radial, factor of r^6."),
    DISTORTION(p1, "Tangential: 2 p1 x y in x, p1 (r^2 + 2 y^2) in y."),
    DISTORTION(p2, "Tangential: p2 (r^2 + 2 x^2) in x, 2 p2 x y in y."),
    BST_CONFIG_END,
};
#undef DISTORTION

const bst_config_desc bst_camera_config[] = {
    BST_INT(bst_camera, width_px, "px", 1, 16384, "1024", "Columns of the sensor."),
    BST_INT(bst_camera, height_px, "px", 1, 16384, "1024", "Rows of the sensor."),
    BST_OPEN_REAL(bst_camera, pixel_scale_arcsec, "arcsec/px", 1e-3, 600,
                  "Angle that a pixel spans at the boresight (gnomonic projection). It, the focal "
                  "length and the pixel's side follow from each other: two of them give the third; "
                  "the scale alone is enough."),
    BST_OPEN_REAL(bst_camera, focal_length_m, "m", 1e-4, 1e3, "Focal length."),
    BST_OPEN_REAL(bst_camera, f_number, "", 0.1, 1e4,
                  "Focal length over aperture_m, in its place."),
    BST_OPEN_REAL(bst_camera, pixel_pitch_um, "um", 0.01, 1e4, "Side of a pixel."),
    BST_FORMER("pixel_um", "pixel_pitch_um"),
    BST_REAL(bst_camera, aperture_m, "m", 1e-3, 20, NULL, "Diameter of the entrance pupil."),
    BST_REAL(bst_camera, obscuration, "", 0, 0.99, "0",
             "Fraction of the pupil's area that is blocked."),
    BST_REAL(bst_camera, throughput, "", 0, 1, "0.8", "Transmission of the optics, band mean."),
    BST_REAL(bst_camera, quantum_efficiency, "", 0, 1, "0.8", "Quantum efficiency, band mean."),
    BST_REAL(bst_camera, photon_flux_v0_per_s_m2, "1/s/m2", 1, 1e15, "8.8e9",
             "Photons of a star of V = 0 in the camera's band, above the optics. The default is "
             "the V band itself: "
             "995.5 photons/s/cm2/A (Bessell, Castelli and Plez 1998) over 88 nm; an unfiltered "
             "silicon detector sees "
             "four to five times as many."),
    BST_REAL(bst_camera, psf_fwhm_px, "px", 0.3, 50, "2",
             "Full width at half maximum of a Gaussian or Moffat PSF."),
    BST_OPEN_REAL(
        bst_camera, zero_point_mag, "mag", 1, 45,
        "V of a Sun-like star of 1 electron/s, in place of photon_flux_v0_per_s_m2 (with "
        "the band's preset v) or of throughput (with other bands), which follow from it."),
    BST_OPEN_REAL(bst_camera, ensquared_energy, "", 1e-4, 0.9999,
                  "Share of a point's light in the pixel on whose centre it lies, in place of "
                  "psf_fwhm_px, which follows from it. For a Gaussian or Moffat PSF."),
    BST_REAL(bst_camera, background_mag_arcsec2, "mag/arcsec2", 5, 40, "22",
             "V surface brightness of the sky (zodiacal light and the like), uniform."),
    BST_REAL(bst_camera, dark_current_e_per_s, "e/s", 0, 1e6, "0", "Dark current per pixel."),
    BST_REAL(bst_camera, read_noise_e, "e", 0, 1e4, "8", "RMS of the read noise."),
    BST_REAL(bst_camera, full_well_e, "e", 1, 1e8, "100000", "Charge at which a pixel saturates."),
    BST_REAL(bst_camera, gain_e_per_dn, "e/DN", 1e-4, 1e6, "1.5", "Electrons per digital number."),
    BST_REAL(bst_camera, offset_dn, "DN", 0, 60000, "500",
             "Digital number of a pixel without charge."),
    BST_INT(bst_camera, bits, "", 8, 16, "16", "Bits of the quantisation."),
    BST_REAL(bst_camera, rotation_deg, "deg", -360, 360, "0",
             "Rotation of the focal plane about the boresight, from the gimbal's +x towards its "
             "+y."),
    BST_REALS(bst_camera, boresight_offset_px, "px", -8192, 8192, "[0, 0]",
              "Where the boresight meets the focal plane, from the sensor's centre."),
    BST_OBJECT(bst_camera, distortion, bst_distortion_config, "{}",
               "Lens distortion, in the focal plane's axes about the boresight. It must not fold "
               "the image inside the sensor."),
    BST_OBJECT(bst_camera, optics, bst_optics_config_table, "{}",
               "Point spread function beyond a plain Gaussian, and vignetting."),
    BST_OBJECT(bst_camera, detector, bst_detector_table, "{}",
               "Effects of the detector beyond the numbers above; all are off by default."),
    BST_OBJECT(bst_camera, band, bst_band_config_table, "{}",
               "What wavelengths the camera sees, and the warmth of its optics."),
    BST_OBJECT(bst_camera, background, bst_background_config_table, "{}",
               "Light between the sources: sky, bright bodies, stray light, gradients."),
    BST_LIST(bst_camera, ghosts, bst_ghost_config, bst_ghost_config_table, 0, 64, "[]",
             "Ghosts: faint second images that every bright star and object has."),
    BST_CONFIG_END,
};

double bst_camera_illumination(const bst_camera *c, double x_px, double y_px) {
    const bst_optics_vignetting *v = &c->optics.vignetting;
    if (v->model == BST_VIGNETTING_NONE && !(v->limit_px > 0.0)) {
        return 1.0;
    }
    double dx = x_px - bst_camera_centre_x(c), dy = y_px - bst_camera_centre_y(c);
    double r2 = dx * dx + dy * dy;
    if (v->limit_px > 0.0 && r2 > v->limit_px * v->limit_px) {
        return 0.0;
    }
    if (v->model == BST_VIGNETTING_COS4) {
        double scale = bst_camera_scale_rad(c), secant2 = 1.0 + r2 * scale * scale;
        return 1.0 / (secant2 * secant2);
    }
    if (v->model == BST_VIGNETTING_POLYNOMIAL) {
        double width = (double)c->width_px, height = (double)c->height_px;
        double s = r2 / (0.25 * (width * width + height * height));
        return fmax(0.0, 1.0 + s * (v->coefficients[0] +
                                    s * (v->coefficients[1] + s * v->coefficients[2])));
    }
    return 1.0;
}

/* Effective area: pupil area times throughput and quantum efficiency. */
static double effective_m2(const bst_camera *c) {
    double area_m2 = 0.25 * BST_PI * c->aperture_m * c->aperture_m * (1.0 - c->obscuration);
    return area_m2 * c->throughput * c->quantum_efficiency;
}

double bst_camera_electrons_per_s(const bst_camera *c, double v_mag) {
    if (c->spectrum) {
        return bst_band_sun(c->spectrum) * pow(10.0, -0.4 * (v_mag - BST_SUN_V_MAG)) *
               effective_m2(c);
    }
    double area_m2 = 0.25 * BST_PI * c->aperture_m * c->aperture_m * (1.0 - c->obscuration);
    return c->photon_flux_v0_per_s_m2 * pow(10.0, -0.4 * v_mag) * area_m2 * c->throughput *
           c->quantum_efficiency;
}

double bst_camera_v_mag(const bst_camera *c, double electrons_per_s) {
    return -2.5 * log10(electrons_per_s / bst_camera_electrons_per_s(c, 0.0));
}

double bst_camera_star_electrons_per_s(const bst_camera *c, double v_mag, double b_minus_v) {
    if (!c->spectrum) {
        return bst_camera_electrons_per_s(c, v_mag);
    }
    return bst_band_star(c->spectrum, b_minus_v) * pow(10.0, -0.4 * v_mag) * effective_m2(c);
}

double bst_camera_thermal_electrons_per_s(const bst_camera *c, double temperature_k,
                                          double solid_angle_sr) {
    if (!c->spectrum || !(solid_angle_sr > 0.0)) {
        return 0.0;
    }
    return bst_band_radiance(c->spectrum, temperature_k) * solid_angle_sr * effective_m2(c);
}

double bst_camera_optics_e_per_s(const bst_camera *c) {
    if (!c->spectrum || !(c->throughput > 0.0)) {
        return 0.0;
    }
    double pixel_sr = bst_camera_scale_rad(c) * bst_camera_scale_rad(c);
    return bst_camera_thermal_electrons_per_s(c, c->band.optics_temperature_k, pixel_sr) *
           c->band.optics_emissivity * c->band.optics_beam_factor / c->throughput;
}

double bst_camera_background_e_per_s(const bst_camera *c) {
    double pixel_arcsec2 = c->pixel_scale_arcsec * c->pixel_scale_arcsec;
    return bst_camera_electrons_per_s(c, c->background_mag_arcsec2) * pixel_arcsec2 +
           bst_camera_optics_e_per_s(c);
}

double bst_camera_dark_e_per_s(const bst_camera *c) {
    return c->dark_current_e_per_s * bst_detector_dark_factor(&c->detector);
}

double bst_camera_readout_e(const bst_camera *c) {
    const bst_detector_config *d = &c->detector;
    double passed = 0.5 * (1.0 - 1.0 / (double)c->height_px); /* mean share of the rows */
    return d->readout_s * passed * bst_camera_dark_e_per_s(c) + d->clock_induced_e;
}

double bst_camera_dark_e(const bst_camera *c, double exposure_s) {
    return bst_camera_dark_e_per_s(c) * exposure_s + bst_camera_readout_e(c);
}

double bst_camera_excess_noise(const bst_camera *c) {
    if (c->detector.ramp.reads > 0) {
        return bst_ramp_excess(&c->detector.ramp);
    }
    return c->detector.em_gain > 1.0 ? 2.0 - 1.0 / c->detector.em_gain : 1.0;
}

double bst_camera_white_noise_e(const bst_camera *c) {
    return c->detector.double_sampling_s > 0.0 ? sqrt(2.0) * c->read_noise_e
                                               : hypot(c->read_noise_e, c->detector.reset_noise_e);
}

double bst_camera_read_noise_e(const bst_camera *c) {
    const bst_detector_ramp_config *ramp = &c->detector.ramp;
    return ramp->reads > 0
               ? bst_ramp_noise_e(ramp, c->read_noise_e, (int)ramp->reads)
               : hypot(bst_camera_white_noise_e(c), bst_pixel_flicker_noise_e(&c->detector));
}

double bst_camera_full_e(const bst_camera *c) {
    int64_t reads = c->detector.ramp.reads;
    return reads > 0 ? c->full_well_e * (double)(reads - 1) : c->full_well_e;
}

double bst_camera_noise_e(const bst_camera *c, double sky_e, double exposure_s) {
    double shot_e2 = bst_camera_excess_noise(c) * (sky_e + bst_camera_dark_e(c, exposure_s));
    double read_e = bst_camera_read_noise_e(c);
    return sqrt(shot_e2 + read_e * read_e);
}
