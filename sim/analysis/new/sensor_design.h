/* Pixel scale, frame period and exposure of the telescope in a new scenario. */
#ifndef BST_ANALYSIS_NEW_SENSOR_DESIGN_H
#define BST_ANALYSIS_NEW_SENSOR_DESIGN_H

#include "sim/analysis/new/scene_search.h"

/* Completeness of the star catalogue, V, from which small fields hold the stars for an attitude.
 * Within a square degree there are 3 stars of V < 9 (the limit of those built into the program) and
 * 30 of V < 11.5; an attitude needs about 8 in the field. */
#define BST_NEW_ENOUGH_STARS_V_MAG 11.0
/* Pixel scales at which a field of V < 9 has enough stars: slow and fast targets. */
#define BST_NEW_FEW_STARS_ARCSEC 8.0
#define BST_NEW_FEW_STARS_FAST_ARCSEC 10.0
/* Slower targets can be followed with the attitude telemetry alone, if no time with stars is found.
 */
#define BST_NEW_STARLESS_RATE_ARCSEC_PER_S 60.0
/* Least SNR of the target in a frame. */
#define BST_NEW_LEAST_SNR 12.0

/* SNR of a point source in a circular aperture whose diameter is twice the FWHM, with the reference
 * sensor (reference_sensor.h).
 *
 * Given:     aperture_m    diameter of the telescope
 *            pixel_arcsec  pixel scale
 *            sky_mag       of the sky, V per square arcsecond
 *            v_mag         of the source
 *            exposure_s
 * Reference: Janesick, Photon Transfer, 2007: shot noise of source, sky and dark, and read noise */
double bst_new_snr(double aperture_m, double pixel_arcsec, double sky_mag, double v_mag,
                   double exposure_s);

/* Pixel scale in arcsec: the request's if it gives one, else by rate and stars.
 *
 * Given:     rate_arcsec_per_s  of the target among the stars
 *            complete_v_mag     limit to which the star catalogue is complete in the field */
double bst_new_pixel_arcsec(const bst_new_request *request, double rate_arcsec_per_s,
                            double complete_v_mag);

/* Time from frame to frame in s: the request's if it gives one, else short enough that stars move
 * by a few pixels only. The mount follows the target, so stars make streaks. */
double bst_new_period_s(const bst_new_request *request, double rate_arcsec_per_s,
                        double pixel_arcsec);

/* Exposure in s at which the faintest target of the run has BST_NEW_LEAST_SNR, rounded up to two
 * digits.
 *
 * Given:     scene            period, pixel scale, rate, sky_mag_arcsec2 and faintest_v_mag
 *            brightest_v_mag  of the run: its peak stays below half of the full well if possible
 * Returned:  0 if no exposure that fits into the period is long enough */
double bst_new_exposure_s(const bst_new_request *request, const bst_new_scene *scene,
                          double brightest_v_mag);

#endif
