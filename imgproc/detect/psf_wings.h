/* The far light of bright stars: what spikes and rings of the PSF pretend to be sources. */
#ifndef BST_IMGPROC_DETECT_PSF_WINGS_H
#define BST_IMGPROC_DETECT_PSF_WINGS_H

#include <stdbool.h>

#include "boresight/messages.h"
#include "boresight/status.h"
#include "sim/optics/psf.h"

/* Pixels to either side of a star over which its light is known. */
enum { BST_WINGS_REACH_PX = 256 };

typedef struct bst_psf_wings bst_psf_wings;

/* Of a PSF (the mean of the nodes that mix on the middle of a sensor of width_px x height_px),
 * widened by a Gaussian of blur_px. BST_ERR_MEMORY. */
bst_status bst_psf_wings_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_psf_wings **out) BST_MUST_CHECK;
/* Frees a work space; NULL is allowed. */
void bst_psf_wings_free(bst_psf_wings *wings);

/* The flux, e-, from which the wings of a star in noise of noise_e per sensor pixel are to be
 * counted with, for detections above `threshold_snr`. */
double bst_psf_wings_bright_e(const bst_psf_wings *wings, double noise_e, double threshold_snr);

/* A new frame, in which stars move by (dx_px, dy_px) during the exposure. */
void bst_psf_wings_begin(bst_psf_wings *wings, double dx_px, double dy_px);
/* A bright star on the sensor or beside it; the first so many count. */
void bst_psf_wings_add(bst_psf_wings *wings, double x_px, double y_px, double flux_e);
/* Whether a star was added within radius_px. */
bool bst_psf_wings_holds(const bst_psf_wings *wings, double x_px, double y_px, double radius_px);

/* Background at a place of the sensor, per pixel of the frame. */
typedef struct bst_psf_wings_ground {
    double level_e, noise_e;
} bst_psf_wings_ground;
typedef void (*bst_psf_wings_ground_fn)(const void *user, double x_px, double y_px,
                                        bst_psf_wings_ground *out);

/* Labels as ARTEFACT those UNKNOWN detections whose light could be that of the stars that were
 * added: with L the stars' light at the place (its greatest within a pixel) less what the
 * background there holds above the frame's median, A the area over which the detection gathers
 * light, what is left of its flux without 1.5 A L must exceed threshold_snr times the noise that L
 * brings. Where L matters little nothing is labelled, nor are the stars themselves. Their
 * label_probability is 0.9. `binning`: sensor pixels of a pixel's side. */
void bst_psf_wings_label(const bst_psf_wings *wings, bst_psf_wings_ground_fn ground,
                         const void *user, int binning, bst_detections *detections);

#endif
