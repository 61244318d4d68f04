/* Attitudes of a satellite that another program sends during a run. */
#ifndef BST_SATELLITE_COMMANDED_ATTITUDE_H
#define BST_SATELLITE_COMMANDED_ATTITUDE_H

#include "boresight/archive.h"
#include "boresight/status.h"
#include "boresight/vec.h"

/* Ring of the latest commands; several threads may use it. */
typedef struct bst_commanded_attitude bst_commanded_attitude;

/* Creates an empty ring. Errors: BST_ERR_MEMORY. Ownership: free *out with
 * bst_commanded_attitude_free. */
bst_status bst_commanded_attitude_create(bst_ctx *ctx, bst_commanded_attitude **out) BST_MUST_CHECK;
/* Frees a ring; NULL is allowed. */
void bst_commanded_attitude_free(bst_commanded_attitude *ring);

/* Sets the attitude from a time on; the body turns at a constant rate until the next command.
 *
 * Given:     seconds           after the epoch
 *            q_body_from_gcrf  unit
 *            rate_body_radps   body frame
 * Errors:    BST_ERR_ARGUMENT: not later than the command before */
bst_status bst_commanded_attitude_add(bst_ctx *ctx, bst_commanded_attitude *ring, double seconds,
                                      bst_quat q_body_from_gcrf,
                                      bst_vec3 rate_body_radps) BST_MUST_CHECK;

/* Attitude at a time.
 *
 * Returned:  false: no command holds then
 *            *q_body_from_gcrf, *rate_radps (its size)  if true */
bool bst_commanded_attitude_at(bst_commanded_attitude *ring, double seconds,
                               bst_quat *q_body_from_gcrf, double *rate_radps);

/* Archives the commands. */
void bst_commanded_attitude_archive(bst_commanded_attitude *ring, bst_archive *archive);

#endif
