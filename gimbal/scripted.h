/* Scripted line of sight: attitudes at ticks from a file of frame updates, with slerp at constant
 * rate between them. */
#ifndef BST_GIMBAL_SCRIPTED_H
#define BST_GIMBAL_SCRIPTED_H

#include "sim/world/frame_updates.h"

typedef struct bst_scripted bst_scripted; /* immutable except for the last look-up position */

/* Handling of a frame without pointing. */
typedef enum bst_scripted_missing {
    BST_SCRIPTED_ERROR, /* an error, up to the file's last pointing */
    BST_SCRIPTED_HOLD,  /* the line of sight stays at the end of the previous frame */
} bst_scripted_missing;

/* Places the file's pointings at the ticks of the sensor's frames. Between two frames the line of
 * sight turns from the end of one to the start of the next; before the first and after the last it
 * is constant.
 *
 * Errors:    BST_ERR_CONFIG with file, frame and key for no pointing at all, a frame without one,
 *            or two attitudes at one time (adjacent frames that differ by more than 1e-9 rad) */
bst_status bst_scripted_create(bst_ctx *ctx, const bst_frame_updates *updates,
                               const bst_camera *camera, const bst_exposure_config *exposure,
                               int64_t tick_rate_hz, bst_scripted_missing missing,
                               bst_scripted **out) BST_MUST_CHECK;
/* Frees a scripted line of sight; NULL is allowed. */
void bst_scripted_free(bst_scripted *scripted);

/* Attitude at a tick; ascending ticks are fast. */
bst_quat bst_scripted_at(bst_scripted *scripted, int64_t tick);
/* First tick after `tick` at which the rate changes (the ticks on either side of an attitude
 * between ticks); INT64_MAX: none. */
int64_t bst_scripted_next(const bst_scripted *scripted, int64_t tick);
/* Largest number of attitudes of the file within any interval of `ticks` ticks. */
int bst_scripted_crowd(const bst_scripted *scripted, double ticks);

#endif
