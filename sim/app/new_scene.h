/* A scenario for two satellites: when one sees the other, and what sensor and loop follow it. */
#ifndef BST_APP_NEW_SCENE_H
#define BST_APP_NEW_SCENE_H

#include <stdio.h>

#include "boresight/status.h"
#include "sim/astro/tle.h"

/* One satellite and the file of its element set. */
typedef struct bst_new_satellite {
    bst_elements elements;
    char file[4096];                                         /* full path */
    char line1[BST_TLE_CHARS + 1], line2[BST_TLE_CHARS + 1]; /* the set as a scenario has it */
    char name[64];                                           /* in the scenario */
} bst_new_satellite;

typedef struct bst_new_request {
    bst_new_satellite observer, target;
    double aperture_m;
    double pixel_arcsec; /* 0: chosen */
    double focal_m;      /* 0: not given */
    double period_s;     /* 0: chosen */
    double duration_s;   /* 0: chosen */
    const char *start;   /* UTC from which a time is looked for; NULL: near the element sets */
    const char *name;    /* of the scenario */
    const char *observer_label; /* name of the observer in it: letters, digits, _ - . */
} bst_new_request;

/* A time at which the target is in view for the whole run, and what the loop needs for it. */
typedef struct bst_new_scene {
    bst_time epoch;
    double duration_s, period_s, exposure_s, pixel_arcsec;
    double limb_rad;          /* least angle from the Earth's limb */
    int side_px;              /* of the square detector */
    double v_mag;             /* at the epoch */
    double faintest_v_mag;    /* in the run */
    double range_m;           /* least */
    double rate_arcsec_per_s; /* greatest, of the line of sight among the stars */
} bst_new_scene;

/* Whether a scene will do; *why: in words, where it will not. */
typedef bst_status (*bst_new_judge)(void *user, bst_ctx *ctx, const bst_new_scene *scene,
                                    bool *holds, char why[256]);

/* Finds a scene.
 * Given: request; judge, which is asked of each of the best times until it says yes.
 * Errors: BST_ERR_NOT_FOUND where there is no such time within two days, with the reasons and how
 * often each was met; BST_ERR_RANGE where the element sets are too far apart in time; those of the
 * orbits and of the judge. */
bst_status bst_new_scene_find(bst_ctx *ctx, const bst_new_request *request, bst_new_judge judge,
                              void *user, bst_new_scene *out) BST_MUST_CHECK;

/* Writes the scenario as JSON with descriptions. */
void bst_new_scene_write(FILE *stream, const bst_new_request *request, const bst_new_scene *scene);

#endif
