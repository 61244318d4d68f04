/* Selection of the track for `boresight orbit`, with the knowledge about its object. */
#ifndef BST_ANALYSIS_ORBIT_ORBIT_CHOICE_H
#define BST_ANALYSIS_ORBIT_ORBIT_CHOICE_H

#include "sim/analysis/orbit/tdm_observations.h"
#include "sim/run/run_observations.h"
#include "sim/world/world.h"

typedef struct bst_orbit_request {
    const char *sensor; /* NULL: any sensor */
    int64_t track; /* 0: the track of interest with most observations, else the longest track */
    bst_tdm_request angles; /* for a TDM */
} bst_orbit_request;

/* A copy of the selected track. */
typedef struct bst_orbit_choice {
    bst_run_track track;
    bst_run_observation *items;
    bst_run_sensor sensor;
    bst_time epoch; /* time zero of the observations */
    int norad;      /* 0: unknown */
    double area_m2; /* cross-section of the object in the scenario; 0: unknown */
    bst_run_reader *run;
    bst_run_scene scene; /* scene.world NULL: from a TDM */
    bst_world_motion_law
        motion; /* motion law of the object in the scenario; borrowed from the scene */
} bst_orbit_choice;

/* Selects a track from a run's folder or a TDM; zero `out` before. Free with bst_orbit_choice_free,
 * also after an error. BST_ERR_NOT_FOUND: no such track; errors of bst_run_observations and
 * bst_tdm_observations. */
bst_status bst_orbit_choose(bst_ctx *ctx, const bst_orbit_request *request, const char *path,
                            bst_orbit_choice *out) BST_MUST_CHECK;

/* Frees the tracks of a choice and closes its run and scene; the struct itself belongs to the
 * caller. */
void bst_orbit_choice_free(bst_orbit_choice *choice);

#endif
