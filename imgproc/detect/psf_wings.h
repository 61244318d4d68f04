/* Wings of the PSF about bright stars: diffraction spikes and rings that mimic sources. */
#ifndef BST_IMGPROC_DETECT_PSF_WINGS_H
#define BST_IMGPROC_DETECT_PSF_WINGS_H

#include <stdbool.h>

#include "boresight/messages.h"
#include "boresight/status.h"
#include "sim/optics/psf.h"

/* Largest distance from a star, along x or y, at which its wings are modelled, px. */
enum { BST_WINGS_REACH_PX = 256 };

typedef struct bst_psf_wings bst_psf_wings;

/* Creates a wing model from a PSF (field average over a sensor of width_px x height_px) widened by
 * a Gaussian of blur_px. Errors: BST_ERR_MEMORY. */
bst_status bst_psf_wings_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_psf_wings **out) BST_MUST_CHECK;
/* Frees a wing model; NULL is allowed. */
void bst_psf_wings_free(bst_psf_wings *wings);

/* Flux, e-, above which a star's wings can cause detections above `threshold_snr`.
 *
 * Given:     noise_e  noise of a sensor pixel, e- */
double bst_psf_wings_bright_e(const bst_psf_wings *wings, double noise_e, double threshold_snr);

/* Starts a new frame. Stars move by (dx_px, dy_px) during its exposure. */
void bst_psf_wings_begin(bst_psf_wings *wings, double dx_px, double dy_px);
/* Adds a bright star on the sensor or near it; stars beyond the capacity are ignored. */
void bst_psf_wings_add(bst_psf_wings *wings, double x_px, double y_px, double flux_e);
/* True if a bright star was added within radius_px of (x_px, y_px). */
bool bst_psf_wings_holds(const bst_psf_wings *wings, double x_px, double y_px, double radius_px);

/* Background level and noise at a position on the sensor, per pixel of the frame. */
typedef struct bst_psf_wings_ground {
    double level_e, noise_e;
} bst_psf_wings_ground;
typedef void (*bst_psf_wings_ground_fn)(const void *user, double x_px, double y_px,
                                        bst_psf_wings_ground *out);

/* Labels UNKNOWN detections as ARTEFACT if wing light of the added stars can explain them;
 * label_probability becomes 0.9.
 *
 * L is the stars' wing light at the position (maximum within a pixel), less the local background's
 * excess above the frame's median. A is the detection's noise-equivalent area. The flux less 1.5 A
 * L must exceed threshold_snr times the noise including L. Detections where L is negligible, and
 * the stars themselves, are not labelled.
 *
 * Given:     binning  side of a pixel of the frame, sensor px */
void bst_psf_wings_label(const bst_psf_wings *wings, bst_psf_wings_ground_fn ground,
                         const void *user, int binning, bst_detections *detections);

#endif
