/* Generated detections without a true source: false alarms and cosmic rays. Internal to the
 * generator. */
#ifndef BST_OBSGEN_MODEL_FALSE_ALARMS_H
#define BST_OBSGEN_MODEL_FALSE_ALARMS_H

#include "obsgen/generator.h"

/* Detection of a given SNR at (x, y), frame px: a point, or a star streak of `length` px. */
bst_detection bst_false_alarms_point(const bst_generator *generator, double x, double y, double snr,
                                     double length);

/* Draws noise detections: a Poisson number, uniform over the frame, with the upper tail of the
 * filter output; more of them on the wings of bright sources. Errors: BST_ERR_MEMORY. */
bst_status bst_false_alarms_draw(bst_ctx *ctx, bst_generator *generator) BST_MUST_CHECK;

/* Draws cosmic-ray hits by the detector model: straight tracks at random angles (cosine law)
 * through the sensitive layer, with a Landau-like charge distribution, as the filter detects them.
 */
void bst_false_alarms_cosmic_rays(bst_generator *generator);

#endif
