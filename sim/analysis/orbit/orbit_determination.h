/* An orbit from measured directions, and the files that say what it is. */
#ifndef BST_ANALYSIS_ORBIT_ORBIT_DETERMINATION_H
#define BST_ANALYSIS_ORBIT_ORBIT_DETERMINATION_H

#include "sim/analysis/orbit/orbit_choice.h"

/* What moves the object: the law of its orbit in the scenario, or another. */
enum {
    BST_ORBIT_FORCES_SCENARIO,
    BST_ORBIT_FORCES_FULL, /* gravity to degree 20, Sun and Moon */
    BST_ORBIT_FORCES_J2,
    BST_ORBIT_FORCES_TWO_BODY,
    BST_ORBIT_FORCES_SGP4
};

/* Whether the observer's stellar aberration is still in the angles of a TDM. */
enum { BST_ORBIT_ABERRATION_REMOVED, BST_ORBIT_ABERRATION_CONTAINED };

typedef struct bst_orbit_determination {
    bst_orbit_request choice;                    /* whose directions */
    const char *oem, *omm, *tdm, *json, *report; /* files to write; NULL: none */
    double sigma_arcsec;                         /* of a TDM's angles, per axis */
    double predict_s, step_s;                    /* of the OEM: beyond the arc, between states */
    double reject_chi2;                          /* observations beyond it are left out; 0: none */
    int forces, aberration;
} bst_orbit_determination;

/* Determines the orbit of the track that is chosen of a run's folder or a TDM, `path`, prints it
 * and writes the files. Errors: what reading, the solution and writing fail with. */
bst_status bst_orbit_determine(bst_ctx *ctx, const bst_orbit_determination *request,
                               const char *path) BST_MUST_CHECK;

#endif
