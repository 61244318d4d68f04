/* Declarations shared by the files of the tasking. */
#ifndef BST_CONTROL_TASKING_TASKING_INTERNAL_H
#define BST_CONTROL_TASKING_TASKING_INTERNAL_H

#include "control/tasking/tasking.h"

/* tasking_look.c: quick visibility check of a geocentric position from the spacecraft's current
 * position: Earth, keep-out cones and shadow. */
bst_tasking_why bst_tasking_glance(const bst_tasking_sensor *sensor, bst_vec3 place_m,
                                   bst_vec3 *direction);
/* Sets the sensor's pixel noise and noise-equivalent area. */
void bst_tasking_noise(bst_tasking_sensor *sensor);

#endif
