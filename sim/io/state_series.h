/* A series of orbit states that a writer requests row by row, in constant memory. */
#ifndef BST_IO_STATE_SERIES_H
#define BST_IO_STATE_SERIES_H

#include "boresight/vec.h"
#include "sim/astro/time.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Rows 0 to rows - 1 in order of time. Writers request the last row first if a header needs it,
 * then all rows. Position in m and velocity in m/s, geocentric, in the writer's frame. An error
 * ends the output and is returned. */
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
