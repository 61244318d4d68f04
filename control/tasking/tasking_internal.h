/* Declarations shared by the files of the tasking. */
#ifndef BST_CONTROL_TASKING_TASKING_INTERNAL_H
#define BST_CONTROL_TASKING_TASKING_INTERNAL_H

#include "control/tasking/tasking.h"

/* tasking_look.c: quick visibility check of a geocentric position from the spacecraft's current
 * position: Earth, keep-out cones and shadow. */
bst_tasking_why bst_tasking_glance(const bst_tasking_sensor *sensor, bst_vec3 place_m,
                                   bst_vec3 *direction);
/* Visibility of a target from a sensor, as bst_tasking_look has it. The table of positions
 * `place_m` rejects first, with a margin for its error and for the age of the navigation message;
 * where it does not decide, and without such a message, bst_tasking_look does. */
bst_status bst_tasking_survey_look(bst_ctx *ctx, const bst_tasking *tasking, int sensor, int object,
                                   double seconds, bst_tasking_why *why) BST_MUST_CHECK;
/* Sets the sensor's pixel noise and noise-equivalent area. */
void bst_tasking_noise(bst_tasking_sensor *sensor);

#endif
