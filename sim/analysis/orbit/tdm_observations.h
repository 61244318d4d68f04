/* Observations for orbit determination from a TDM, with observer states from an OEM. */
#ifndef BST_ANALYSIS_ORBIT_TDM_OBSERVATIONS_H
#define BST_ANALYSIS_ORBIT_TDM_OBSERVATIONS_H

#include "sim/run/run_observations.h"

typedef struct bst_tdm_request {
    const char *path;     /* of the TDM */
    const char *observer; /* OEM with the observer's states */
    const char
        *observer_name; /* its object name; NULL: the participant's name, or the only object */
    const char *object; /* observed participant; NULL: the one with most angles */
    double sigma_rad;   /* of the angles, per axis */
    bool aberrated;     /* the angles contain the observer's aberration */
} bst_tdm_request;

/* Reads the angles of one pair of participants from all segments, sorted by time; seconds since the
 * first one.
 *
 * Returned:  *items  (*count, at least 1); free() it. *sensor: names of observer and object
 * Errors:    BST_ERR_ARGUMENT: no OEM; BST_ERR_NOT_FOUND: no such object;
 *            BST_ERR_NUMERIC: no OEM state at an angle; as bst_tdm_load and bst_oem_load */
bst_status bst_tdm_observations(bst_ctx *ctx, const bst_tdm_request *request,
                                bst_run_sensor *sensor, bst_run_observation **items,
                                int64_t *count) BST_MUST_CHECK;

#endif
