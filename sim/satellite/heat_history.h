/* Temperatures of facets with heat capacity: a function of time alone, computed when asked for. */
#ifndef BST_SATELLITE_HEAT_HISTORY_H
#define BST_SATELLITE_HEAT_HISTORY_H

#include "sim/satellite/heat.h"

/* Sets a pose as it is at a time and gives what heats it then. False: unknown, such as before the
 * first state of an orbit. */
typedef bool bst_heat_source(void *user, bst_satellite_pose *pose, double seconds,
                             bst_heat_environment *out);

/* Work memory of one thread for one model. */
typedef struct bst_heat_history bst_heat_history;

/* Allocates a history.
 *
 * Given:     satellite  outlives the history
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_heat_history_free */
bst_status bst_heat_history_create(bst_ctx *ctx, const bst_satellite *satellite,
                                   bst_heat_history **out) BST_MUST_CHECK;
/* Frees a history; NULL is allowed. */
void bst_heat_history_free(bst_heat_history *history);

/* Temperatures of all facets.
 *
 * Given:     pose     of the model; left as the source last set it
 *            seconds  after the epoch
 *            source   with `user`: the loads at other times
 * Returned:  [facets], K; they belong to the history, until the next call; NULL: the loads are not
 *            known at a time that they need
 * Notes:     loads are computed at whole multiples of a step: a quarter of the shortest time
 *            constant, 1 to 60 s; temperatures are linear between. Integration starts at a steady
 *            state 8 to 16 of the longest time constants earlier, at a time that depends on
 *            `seconds` alone, so that results do not depend on the order of calls. Time constants:
 *            heat capacity over 4 emissivity sigma T^3 at 280 K. */
const double *bst_heat_history_at(bst_heat_history *history, bst_satellite_pose *pose,
                                  double seconds, bst_heat_source *source, void *user);

#endif
