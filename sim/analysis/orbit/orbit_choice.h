/* Which track `boresight orbit` fits, and what is known of its object. */
#ifndef BST_ANALYSIS_ORBIT_ORBIT_CHOICE_H
#define BST_ANALYSIS_ORBIT_ORBIT_CHOICE_H

#include "sim/analysis/orbit/tdm_observations.h"
#include "sim/run/run_observations.h"
#include "sim/world/world.h"

typedef struct bst_orbit_request {
    const char *sensor; /* NULL: of any */
    int64_t track;      /* 0: the track of interest with the most observations, or the longest */
    bst_tdm_request angles; /* for a TDM */
} bst_orbit_request;

/* The track that is chosen, copied. */
typedef struct bst_orbit_choice {
    bst_run_track track;
    bst_run_observation *items;
    bst_run_sensor sensor;
    bst_time epoch; /* of the observations' seconds */
    int norad;      /* 0: not known */
    bst_run_reader *run;
    bst_run_scene scene;         /* its world NULL: a TDM */
    bst_world_motion_law motion; /* of the object in the scenario; lent by the scene */
} bst_orbit_choice;

/* From the folder of a run, or a TDM; `out` zeroed before. Freed with bst_orbit_choice_free, also
 * after an error. BST_ERR_NOT_FOUND when there is no such track; errors of bst_run_observations and
 * bst_tdm_observations. */
bst_status bst_orbit_choose(bst_ctx *ctx, const bst_orbit_request *request, const char *path,
                            bst_orbit_choice *out) BST_MUST_CHECK;

/* Frees the tracks of a choice and closes its run and scene; the struct itself belongs to the
 * caller. */
void bst_orbit_choice_free(bst_orbit_choice *choice);

#endif
