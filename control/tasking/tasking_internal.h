/* Declarations shared by the files of the tasking. */
#ifndef BST_CONTROL_TASKING_TASKING_INTERNAL_H
#define BST_CONTROL_TASKING_TASKING_INTERNAL_H

#include "control/tasking/tasking.h"

/* tasking_look.c: quick checks of a geocentric position: keep-out zones, among them the Earth, seen
 * from the spacecraft's current position; and the Earth's shadow. */
bst_tasking_why bst_tasking_glance(const bst_tasking_sensor *sensor, bst_vec3 place_m,
                                   bst_vec3 *direction);
bool bst_tasking_in_shadow(const bst_tasking_sensor *sensor, bst_vec3 place_m);
/* Visibility of a target from a sensor, as bst_tasking_look has it. The table of positions
 * `place_m` rejects first, with a margin for its error and for the age of the navigation message;
 * where it does not decide, and without such a message, bst_tasking_look does. */
bst_status bst_tasking_survey_look(bst_ctx *ctx, const bst_tasking *tasking, int sensor, int object,
                                   double seconds, bst_tasking_why *why) BST_MUST_CHECK;
/* tasking_heap.c. Makes a heap of choices: the first is that of the largest value, among equal ones
 * that of the object that comes first in the catalogue. */
void bst_tasking_heap_make(bst_tasking_choice *heap, int count);
/* Restores the order after the first choice's value was lowered. */
void bst_tasking_heap_lower(bst_tasking_choice *heap, int count);
/* Takes the first choice of at least one. */
bst_tasking_choice bst_tasking_heap_take(bst_tasking_choice *heap, int *count);
/* Sets the sensor's pixel noise and noise-equivalent area. */
void bst_tasking_noise(bst_tasking_sensor *sensor);

#endif
