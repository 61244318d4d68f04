/* Figures of a scenario that follow from its configuration: limiting magnitudes, SNR of the
 * targets, disk space. */
#ifndef BST_ANALYSIS_CHECK_CHECK_FIGURES_H
#define BST_ANALYSIS_CHECK_CHECK_FIGURES_H

#include "sim/engine/simulation.h"

struct cJSON;

/* SNR of the limiting magnitude in the figures. */
#define BST_CHECK_LIMIT_SNR 5.0

/* Computes the figures of a scenario without simulating it.
 *
 * Given:     scenario, simulation  created, not run
 * Returned:  *out  {duration_s, objects, frame_bytes, sensors: [{observer, sensor, field_deg [2],
 *                  pixel_scale_arcsec, frames, frame_bytes, sky_e, dark_e, noise_e, psf_fwhm_px,
 *                  v_mag_at_snr_5, target}]}. target: null without cue, else {object, states} with
 *                  the target at begin, middle and end of the run: {time_s, v_mag, range_m,
 *                  rate_arcsec_per_s, occulted, sunlit_fraction, snr}. Electrons are those of a
 *                  pixel in an exposure
 * Errors:    BST_ERR_MEMORY; those of PSF and orbits
 * Ownership: free *out with cJSON_Delete
 * Notes:     a source at rest in the middle of the field, uniform sky, no stars, no binning. SNR is
 *            sqrt(sum s^2) over the noise of a pixel, as in `boresight pd`; a PSF that is not
 *            Gaussian counts as a Gaussian of the same FWHM. */
bst_status bst_check_figures(bst_ctx *ctx, const bst_scenario *scenario,
                             const bst_simulation *simulation, struct cJSON **out) BST_MUST_CHECK;

#endif
