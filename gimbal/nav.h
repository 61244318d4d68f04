/* Navigation telemetry, which both gimbal types publish. */
#ifndef BST_GIMBAL_NAV_H
#define BST_GIMBAL_NAV_H

#include "sim/core/messages.h"
#include "sim/world/world.h"

/* Fills navigation telemetry with the state that the spacecraft believes itself in at `tick`
 * (seconds after the epoch), the errors of its orbit and clock in it. */
bst_status bst_gimbal_nav(bst_ctx *ctx, bst_view *view, int observer, int sensor, int64_t tick,
                          double seconds, bst_nav_telemetry *out) BST_MUST_CHECK;

#endif
