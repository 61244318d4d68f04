/* Detections that are no sources of the truth. Inside of the generator. */
#ifndef BST_OBSGEN_MODEL_FALSE_ALARMS_H
#define BST_OBSGEN_MODEL_FALSE_ALARMS_H

#include "obsgen/generator.h"

/* A detection of this SNR at (x, y) px of the frame: a point, or a star's streak of this length. */
bst_detection bst_false_alarms_point(const bst_generator *generator, double x, double y, double snr,
                                     double length);

/* Noise above the threshold: a Poisson number, anywhere on the frame, with the upper tail of the
 * filter's output. */
void bst_false_alarms_draw(bst_generator *generator);

/* Radiation hits by the detector's law: straight tracks at random angles (cosine law) through the
 * sensitive layer, with a Landau-like spread of charge, as far as the filter shows them. */
void bst_false_alarms_cosmic_rays(bst_generator *generator);

#endif
