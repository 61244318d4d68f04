/* Directions from a TDM with the observer's states from an OEM. */
#ifndef BST_ANALYSIS_ORBIT_TDM_OBSERVATIONS_H
#define BST_ANALYSIS_ORBIT_TDM_OBSERVATIONS_H

#include "sim/run/run_observations.h"

typedef struct bst_tdm_request {
    const char *path;          /* of the TDM */
    const char *observer;      /* OEM with the observer's states */
    const char *observer_name; /* its object there; NULL: the participant's name, or the only one */
    const char *object;        /* participant that is observed; NULL: the one with most angles */
    double sigma_rad;          /* of the angles, per axis */
    bool aberrated;            /* the observer's aberration is contained in them */
} bst_tdm_request;

/* The angles of one pair of participants, of all its segments, by time; seconds count from the
 * first one. *items (*count, at least 1) is the caller's to free(). *sensor names the observer, and
 * the object as its target. BST_ERR_ARGUMENT without an OEM; BST_ERR_NOT_FOUND when there is no
 * such object; BST_ERR_NUMERIC where the OEM has no state at the time of an angle; other errors as
 * bst_tdm_load and bst_oem_load. */
bst_status bst_tdm_observations(bst_ctx *ctx, const bst_tdm_request *request,
                                bst_run_sensor *sensor, bst_run_observation **items,
                                int64_t *count) BST_MUST_CHECK;

#endif
