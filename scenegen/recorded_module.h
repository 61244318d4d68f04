/* Module of recorded frames: role "scenegen", type "recorded". */
#ifndef BST_SCENEGEN_RECORDED_MODULE_H
#define BST_SCENEGEN_RECORDED_MODULE_H

#include "boresight/module.h"

/* Triggered by `exposure`; reads `los_history`; writes `truth` for every exposure and `frame` for
 * every exposure whose frame the files have. The truth lists the scenario's objects and its stars
 * down to star_limit_v_mag: nothing that was measured in the frames. The summary counts
 * "frame_not_recorded", "pixels_clipped" and "pixels_blank" (frames with such pixels). */
extern const bst_module_desc bst_scenegen_recorded_module;

#endif
