/* Orbit determination from measured directions, with its output files (`boresight orbit`). */
#ifndef BST_ANALYSIS_ORBIT_ORBIT_DETERMINATION_H
#define BST_ANALYSIS_ORBIT_ORBIT_DETERMINATION_H

#include "sim/analysis/orbit/orbit_choice.h"

/* Force model: the motion law of the scenario, or another one. */
enum {
    BST_ORBIT_FORCES_SCENARIO,
    BST_ORBIT_FORCES_FULL, /* gravity to degree 20, Sun and Moon */
    BST_ORBIT_FORCES_J2,
    BST_ORBIT_FORCES_TWO_BODY,
    BST_ORBIT_FORCES_SGP4
};

/* Aberration in the angles of a TDM: removed or contained. */
enum {
    BST_ORBIT_ABERRATION_DEFAULT = -1, /* not given: removed */
    BST_ORBIT_ABERRATION_REMOVED,
    BST_ORBIT_ABERRATION_CONTAINED
};

typedef struct bst_orbit_determination {
    bst_orbit_request choice;                    /* track whose directions are used */
    const char *oem, *omm, *tdm, *json, *report; /* files to write; NULL: none */
    double sigma_arcsec;                         /* of a TDM's angles, per axis; 0: 1 arcsec */
    double radius_m;          /* of the object; negative: of its area in the scenario, TDM: 0 */
    double predict_s, step_s; /* of the OEM: extension beyond the arc, time step */
    double reject_chi2;       /* observations with a larger chi-square are rejected; 0: none */
    int forces, aberration;
} bst_orbit_determination;

/* The first option for angles of a TDM that a request has, such as "sigma"; NULL: none. */
const char *bst_orbit_tdm_option(const bst_orbit_determination *request);
/* The first option for the tracks of a run that a request has, such as "track"; NULL: none. */
const char *bst_orbit_run_option(const bst_orbit_determination *request);

/* Determines the orbit of a track of a run's folder or a TDM, `path`; prints it and writes the
 * files. Errors of reading, solution and writing. */
bst_status bst_orbit_determine(bst_ctx *ctx, const bst_orbit_determination *request,
                               const char *path) BST_MUST_CHECK;

#endif
