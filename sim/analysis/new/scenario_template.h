/* The text of the scenario that `boresight new` writes. */
#ifndef BST_ANALYSIS_NEW_SCENARIO_TEMPLATE_H
#define BST_ANALYSIS_NEW_SCENARIO_TEMPLATE_H

#include <stdio.h>

#include "sim/analysis/new/scene_search.h"

/* Writes a scenario as JSON with descriptions: a telescope on the observer, a mount on a shaking
 * platform, and a closed loop that follows the target.
 *
 * Given:     request  satellites, names and the sensor's aperture and focal length
 *            scene    epoch, duration, exposure and pixel scale; finite except v_mag
 * Errors:    none returned; the caller checks `stream` when it closes it */
void bst_new_scenario_write(FILE *stream, const bst_new_request *request,
                            const bst_new_scene *scene);

#endif
