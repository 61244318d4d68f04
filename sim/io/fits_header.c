#include <math.h>
#include <string.h>

#include "sim/io/fits_internal.h"

#define DIGITS (-15) /* significant digits of real values */
/* digits of a modified Julian date: 1e-11 d, the resolution of a double */
#define MJD_DIGITS (-16)

static void put_real(fitsfile *file, const char *key, double value, const char *comment,
                     int *code) {
    if (isfinite(value)) {
        fits_write_key_dbl(file, key, value, DIGITS, comment, code);
    } else {
        fits_write_key_null(file, key, comment, code);
    }
}

static void put_text(fitsfile *file, const char *key, const char *value, const char *comment,
                     int *code) {
    if (value[0]) {
        fits_write_key_str(file, key, value, comment, code);
    }
}

static void put_int(fitsfile *file, const char *key, long long value, const char *comment,
                    int *code) {
    fits_write_key_lng(file, key, value, comment, code);
}

double bst_fits_saturation_dn(const bst_camera *camera, int bits) {
    double full = camera->offset_dn + bst_camera_full_e(camera) / camera->gain_e_per_dn;
    return fmin(full, (double)((1 << bits) - 1));
}

/* Photometric zero point: V magnitude of a source with one detected electron per second, in the
 * camera's band. */
static double zero_point_mag(const bst_camera *c) {
    return 2.5 * log10(bst_camera_electrons_per_s(c, 0.0));
}

double bst_fits_date(const bst_fits_frame *frame, bst_fits_moment moment, char text[40]) {
    bst_time t = bst_time_add(frame->start, 0.5 * (double)moment * frame->exposure_s);
    bst_time_to_utc(t, 6, text, 40);
    char *z = strchr(text, 'Z');
    if (z) {
        *z = '\0';
    }
    double jd1, jd2;
    bst_time_utc(t, &jd1, &jd2);
    return (jd1 - 2400000.5) + jd2;
}

void bst_fits_put_run_keys(fitsfile *file, const bst_fits_names *names, int *code) {
    const bst_camera *c = &names->camera;
    put_text(file, "CREATOR", names->program, "program that made this file", code);
    put_text(file, "TELESCOP", names->observer, "observing spacecraft", code);
    put_text(file, "OBSERVER", names->observer, "observing spacecraft", code);
    put_text(file, "INSTRUME", names->instrument, "sensor", code);
    put_text(file, "OBJECT", names->object, "target of interest", code);
    put_text(file, "IMAGETYP", names->image_type, "kind of frame", code);
    fits_write_key_str(file, "BUNIT", "adu", "unit of the pixel values", code);
    put_real(file, "GAIN", c->gain_e_per_dn, "[e-/adu] electrons per count", code);
    put_real(file, "RDNOISE", bst_camera_read_noise_e(c), "[e-] read noise, 1 sigma", code);
    put_real(file, "OFFSET", c->offset_dn, "[adu] value of a pixel without charge", code);
    put_real(file, "SATURATE", bst_fits_saturation_dn(c, (int)c->bits),
             "[adu] full well or end of the converter", code);
    put_int(file, "BITS", c->bits, "[bit] of the converter", code);
    put_real(file, "PIXSCALE", c->pixel_scale_arcsec, "[arcsec/pixel] at the boresight, unbinned",
             code);
    put_real(file, "ZEROPNT", zero_point_mag(c), "[mag] V of a source of 1 detected e-/s", code);
    put_real(file, "DARKCUR", bst_camera_dark_e_per_s(c), "[e-/s] dark current per pixel", code);
    put_real(file, "APTDIA", c->aperture_m, "[m] diameter of the entrance pupil", code);
    bst_fits_put_lens(file, c, code);
    fits_write_key_str(file, "TIMESYS", "UTC", "time scale of the dates", code);
    fits_write_key_str(file, "RADESYS", "ICRS", "reference system of the WCS", code);
}

void bst_fits_put_content(fitsfile *file, bst_fits_content content, int *code) {
    static const char *const keys[] = {"GAIN", "RDNOISE", "OFFSET", "SATURATE", "BITS"};
    if (content == BST_FITS_COUNTS) {
        return;
    }
    for (size_t i = 0; i < sizeof keys / sizeof *keys && *code == 0; i++) {
        fits_delete_key(file, keys[i], code);
    }
    if (content == BST_FITS_ELECTRONS) {
        fits_update_key_str(file, "BUNIT", "electron", "expected, before the detector", code);
    } else if (content == BST_FITS_ITEMS) {
        fits_update_key_str(file, "BUNIT", "", "0, or item of the table truth", code);
    } else if (content == BST_FITS_PARTS) {
        fits_update_key_str(file, "BUNIT", "", "0, or number of the table parts", code);
    } else {
        fits_update_key_str(file, "BUNIT", "", "1: full well, 2: converter at its top, 3: both",
                            code);
    }
}

void bst_fits_put_statements(fitsfile *file, int *code) {
    /* a COMMENT card holds 72 characters */
    static const char *const lines[] = {
        "Pixels: first row in the file is y = 0 of the sensor. DATE-OBS is the",
        "start of the exposure, UTC at the observer.",
        "Stellar aberration and the Sun's light deflection: absorbed. The WCS",
        "takes ICRS catalogue places (with proper motion, without parallax) to",
        "pixels as an astrometric solution of this frame would; the attitude is",
        "averaged over the exposure. No aberration needs to be applied to",
        "places read from it.",
        "Light time: moving objects are seen where they were when the light",
        "left. A place read from the WCS is the astrometric place: object at",
        "emission minus observer at reception, not corrected for light time.",
        "OBSPOS and OBSVEL: observer, geocentric, GCRF axes, at mid exposure.",
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        fits_write_comment(file, lines[i], code);
    }
}

static void put_wcs(fitsfile *file, const bst_wcs *w, int *code) {
    bool sip = w->sip.order > 0;
    const char *what = sip ? "gnomonic projection, SIP polynomials" : "gnomonic projection";
    fits_write_key_str(file, "CTYPE1", sip ? "RA---TAN-SIP" : "RA---TAN", what, code);
    fits_write_key_str(file, "CTYPE2", sip ? "DEC--TAN-SIP" : "DEC--TAN", what, code);
    fits_write_key_str(file, "CUNIT1", "deg", "", code);
    fits_write_key_str(file, "CUNIT2", "deg", "", code);
    put_real(file, "CRPIX1", w->crpix[0], "[pixel] boresight; first pixel's centre is 1", code);
    put_real(file, "CRPIX2", w->crpix[1], "[pixel]", code);
    put_real(file, "CRVAL1", w->crval_deg[0], "[deg] right ascension at CRPIX", code);
    put_real(file, "CRVAL2", w->crval_deg[1], "[deg] declination at CRPIX", code);
    put_real(file, "CD1_1", w->cd_deg[0][0], "[deg/pixel]", code);
    put_real(file, "CD1_2", w->cd_deg[0][1], "[deg/pixel]", code);
    put_real(file, "CD2_1", w->cd_deg[1][0], "[deg/pixel]", code);
    put_real(file, "CD2_2", w->cd_deg[1][1], "[deg/pixel]", code);
    put_real(file, "WCSRESID", w->residual_px, "[pixel] largest misfit of the WCS", code);
    fits_write_key_str(file, "ABERRAT", "absorbed", "stellar aberration is in the WCS", code);
    if (sip) {
        bst_fits_put_sip(file, &w->sip, code);
    }
}

void bst_fits_put_frame_keys(fitsfile *file, const bst_fits_names *names,
                             const bst_fits_frame *frame, int *code) {
    static const char *const date_keys[] = {"DATE-BEG", "DATE-AVG", "DATE-END"};
    static const char *const mjd_keys[] = {"MJD-BEG", "MJD-AVG", "MJD-END"};
    static const char *const moments[] = {"start of the exposure", "middle of the exposure",
                                          "end of the exposure"};
    char date[40];
    put_int(file, "FRAMEID", frame->id, "number of the exposure", code);
    put_text(file, "IMAGETYP", names->image_type, "kind of frame", code);
    double mjd = bst_fits_date(frame, BST_FITS_BEGIN, date);
    fits_write_key_str(file, "DATE-OBS", date, "start of the exposure, UTC", code);
    fits_write_key_dbl(file, "MJD-OBS", mjd, MJD_DIGITS, "[d] start of the exposure, UTC", code);
    for (int k = 0; k < 3; k++) {
        mjd = bst_fits_date(frame, (bst_fits_moment)k, date);
        fits_write_key_str(file, date_keys[k], date, moments[k], code);
        fits_write_key_dbl(file, mjd_keys[k], mjd, MJD_DIGITS, "[d] UTC", code);
    }
    fits_write_key_str(file, "TIMESYS", "UTC", "time scale of the dates", code);
    put_real(file, "EXPTIME", frame->exposure_s, "[s] exposure", code);
    fits_write_key_str(file, "BUNIT", "adu", "unit of the pixel values", code);
    put_int(file, "BITS", frame->bits, "[bit] of the converter", code);
    put_real(file, "GAIN", names->camera.gain_e_per_dn, "[e-/adu] electrons per count", code);
    put_real(file, "RDNOISE", bst_camera_read_noise_e(&names->camera), "[e-] read noise, 1 sigma",
             code);
    put_real(file, "OFFSET", names->camera.offset_dn, "[adu] value of a pixel without charge",
             code);
    put_real(file, "ZEROPNT", zero_point_mag(&names->camera),
             "[mag] V of a source of 1 detected e-/s", code);
    put_real(file, "SATURATE", bst_fits_saturation_dn(&names->camera, frame->bits),
             "[adu] full well or end of the converter", code);
    put_text(file, "OBJECT", names->object, "target of interest", code);
    put_text(file, "INSTRUME", names->instrument, "sensor", code);
    put_text(file, "OBSERVER", names->observer, "observing spacecraft", code);
    int binning = frame->binning > 1 ? frame->binning : 1;
    double scale = frame->pixel_scale_arcsec > 0.0 ? frame->pixel_scale_arcsec
                                                   : names->camera.pixel_scale_arcsec;
    put_real(file, "PIXSCALE", scale * binning, "[arcsec/pixel] at the boresight", code);
    bst_fits_put_lens(file, &names->camera, code);
    put_int(file, "WINX0", frame->window.x0, "[pixel] window's corner on the sensor, from 0", code);
    put_int(file, "WINY0", frame->window.y0, "[pixel] window's corner on the sensor, from 0", code);
    put_int(file, "BINNING", binning, "sensor pixels per pixel and axis", code);
    fits_write_key_str(file, "RADESYS", "ICRS", "reference system of the WCS", code);
    if (frame->has_wcs) {
        bst_wcs wcs = bst_wcs_window(&frame->wcs, frame->window, binning);
        put_wcs(file, &wcs, code);
    }
    if (frame->has_observer) {
        const double values[6] = {frame->observer_gcrf_m.x,   frame->observer_gcrf_m.y,
                                  frame->observer_gcrf_m.z,   frame->observer_gcrf_mps.x,
                                  frame->observer_gcrf_mps.y, frame->observer_gcrf_mps.z};
        static const char *const keys[6] = {"OBSPOSX", "OBSPOSY", "OBSPOSZ",
                                            "OBSVELX", "OBSVELY", "OBSVELZ"};
        for (int k = 0; k < 6; k++) {
            put_real(file, keys[k], values[k],
                     k < 3 ? "[m] observer, geocentric GCRF, mid exposure"
                           : "[m/s] observer, geocentric GCRF, mid exposure",
                     code);
        }
        static const char *const bodies[3] = {"EARTHFRC", "MOONFRC", "SUNFRC"};
        static const char *const meant[3] = {"[0..1] of the image that the Earth covers",
                                             "[0..1] of the image that the Moon covers",
                                             "[0..1] of the image that the Sun covers"};
        for (int k = 0; k < 3; k++) {
            put_real(file, bodies[k], frame->body_fraction[k], meant[k], code);
        }
    }
}
