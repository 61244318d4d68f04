/* A line of sight that a file of frame updates prescribes: attitudes at ticks, and the shortest
 * turn at a constant rate between them. */
#ifndef BST_GIMBAL_SCRIPTED_H
#define BST_GIMBAL_SCRIPTED_H

#include "sim/world/frame_updates.h"

typedef struct bst_scripted bst_scripted; /* immutable but for where it was last asked */

/* What a frame without a pointing means. */
typedef enum bst_scripted_missing {
    BST_SCRIPTED_ERROR, /* it must not be, up to the file's last pointing */
    BST_SCRIPTED_HOLD,  /* the line of sight stays where the frame before it ended */
} bst_scripted_missing;

/* Lays the file's pointing along the ticks of the sensor's frames. Between two frames the line of
 * sight turns from the end of one to the start of the next; before the first and after the last it
 * rests. BST_ERR_CONFIG with file, frame and key: no pointing at all, a frame without one, or two
 * attitudes at one instant (frames that follow without a pause and do not meet to 1e-9 rad). */
bst_status bst_scripted_create(bst_ctx *ctx, const bst_frame_updates *updates,
                               const bst_camera *camera, const bst_exposure_config *exposure,
                               int64_t tick_rate_hz, bst_scripted_missing missing,
                               bst_scripted **out) BST_MUST_CHECK;
/* NULL is allowed. */
void bst_scripted_free(bst_scripted *scripted);

/* Attitude at a tick. Asking in the order of time is fast. */
bst_quat bst_scripted_at(bst_scripted *scripted, int64_t tick);
/* The first tick after `tick` at which the rate changes (the ticks on either side of an attitude
 * that lies between two); INT64_MAX when there is none. */
int64_t bst_scripted_next(const bst_scripted *scripted, int64_t tick);
/* Most attitudes of the file within any stretch of so many ticks. */
int bst_scripted_crowd(const bst_scripted *scripted, double ticks);

#endif
