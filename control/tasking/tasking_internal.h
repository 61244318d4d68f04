/* Shared by the files of the tasking rule. */
#ifndef BST_CONTROL_TASKING_TASKING_INTERNAL_H
#define BST_CONTROL_TASKING_TASKING_INTERNAL_H

#include "control/tasking/tasking.h"

/* tasking_look.c: a cheap look at a place (geocentric) from where the spacecraft is now: Earth,
 * keep-out cones and shadow. */
bst_tasking_why bst_tasking_glance(const bst_tasking_sensor *sensor, bst_vec3 place_m,
                                   bst_vec3 *direction);
/* Noise of a pixel, and how many of them a point's light fills. */
void bst_tasking_noise(bst_tasking_sensor *sensor);

#endif
