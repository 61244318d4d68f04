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
/* tasking_uncertainty.c. Sets the uncertainty of all objects to that of the catalogue. */
void bst_tasking_uncertainty_init(bst_tasking *tasking);
/* Standard deviation of an object's place along its orbit at `now_s`, not before its last track, m.
 */
double bst_tasking_sigma_m(const bst_tasking *tasking, int object, double now_s);
/* Information that a measured direction has about a displacement along the orbit, 1/m^2: a
 * displacement d moves the direction by d u / range across it, u the direction of motion.
 *
 * Given:     direction   unit, geometric, GCRF
 *            motion      of the object, any length
 *            covariance  of the direction along the tangent axes of bst_track, rad^2
 * Returned:  0 also for a singular covariance */
double bst_tasking_information_m2(bst_vec3 direction, double range_m, bst_vec3 motion,
                                  const double covariance[2][2]);
/* Updates an object's place along the orbit and its drift with a place that was measured with
 * `information_m2`; the errors of its other elements count as noise of the measurement, with the
 * variance of the catalogue. Kalman filter (Bar-Shalom, Li and Kirubarajan 2001, ch. 5.2). */
void bst_tasking_uncertainty_update(bst_tasking *tasking, int object, double seen_s,
                                    double information_m2);
/* Updates the object of a sensor's task, which ends, with its last track; nothing if its orbit has
 * ended. */
void bst_tasking_take_track(bst_tasking *tasking, int sensor);
/* Sets the sensor's pixel noise and noise-equivalent area. */
void bst_tasking_noise(bst_tasking_sensor *sensor);

#endif
