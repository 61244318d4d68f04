/* A series of states that a writer asks for row by row, so that its length takes no memory. */
#ifndef BST_IO_STATE_SERIES_H
#define BST_IO_STATE_SERIES_H

#include "boresight/vec.h"
#include "sim/astro/time.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Rows 0 to rows - 1, in order of time. Writers ask for the last row first, where a head names it,
 * then for all rows in order. Position in m and velocity in m/s, geocentric, in the axes that the
 * writer says. An error ends the writing and is passed on. */
typedef struct bst_state_series {
    int64_t rows;
    bst_status (*state)(void *user, bst_ctx *ctx, int64_t row, bst_time *time, bst_vec3 *position_m,
                        bst_vec3 *velocity_mps);
    void *user;
} bst_state_series;

#ifdef __cplusplus
}
#endif

#endif
