/* Search for a time at which one satellite can follow another with a telescope. */
#ifndef BST_ANALYSIS_NEW_SCENE_SEARCH_H
#define BST_ANALYSIS_NEW_SCENE_SEARCH_H

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

/* A time at which the target is in view for the whole run, and the sensor settings for it. */
typedef struct bst_new_scene {
    bst_time epoch;
    double duration_s, period_s, exposure_s, pixel_arcsec;
    double limb_rad;          /* least angle from the Earth's limb */
    double corner_clear_rad;  /* least such angle that the corner of the field may have */
    double sky_mag_arcsec2;   /* brightest sky at the target in the run */
    bool few_stars;           /* too few in the field for an attitude */
    int side_px;              /* of the square detector */
    double v_mag;             /* at the epoch */
    double faintest_v_mag;    /* in the run */
    double brightest_v_mag;   /* the same */
    double range_m;           /* least */
    double rate_arcsec_per_s; /* greatest, of the line of sight among the stars */
} bst_new_scene;

/* Decides if a scene is good enough: *holds; *why in words if it is not. */
typedef bst_status (*bst_new_judge)(void *user, bst_ctx *ctx, const bst_new_scene *scene,
                                    bool *holds, char why[256]);

/* Finds a time at which the target is sunlit, bright enough and clear of Earth, Moon and Sun for
 * the whole run, and slow, with the stars for an attitude in the field. Only if there is none, a
 * time of few stars is taken for a target that the attitude telemetry alone can follow.
 *
 * Given:     request
 *            judge    called with `user` for the best times, in order, until it accepts one
 * Errors:    BST_ERR_NOT_FOUND if two days hold no such time; the message lists the reasons with
 *            their shares of the time. BST_ERR_RANGE if the epochs of the element sets are too far
 *            apart. Those of the orbits and of the judge */
bst_status bst_new_scene_find(bst_ctx *ctx, const bst_new_request *request, bst_new_judge judge,
                              void *user, bst_new_scene *out) BST_MUST_CHECK;

#endif
