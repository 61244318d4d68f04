/* Inside of a view of the onboard knowledge, shared by knowledge*.c only. */
#ifndef BST_ONBOARD_KNOWLEDGE_INTERNAL_H
#define BST_ONBOARD_KNOWLEDGE_INTERNAL_H

#include "sim/core/quintic.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/world_internal.h"

struct bst_knowledge {
    const bst_world
        *world;           /* for the nominal orbits and Earth orientation only; never handed out */
    bst_stars *own_stars; /* NULL: the world's */
    bst_stars *altered;   /* those with the catalogue's errors; NULL: it has none */
    bst_camera camera;
    const struct bst_psf *psf; /* lent by the world; NULL: the camera's Gaussian */
    int observer, sensor;
    double julian_year;
};

/* The cue's direction is kept at whole seconds and interpolated by six of them. */
enum { BST_CUE_KNOTS = 16 };

typedef struct bst_onboard_cue_knot {
    bool made, known; /* known: there is a direction */
    int64_t second;
    bst_vec3 direction;
} bst_onboard_cue_knot;

struct bst_knowledge_view {
    const bst_knowledge *knowledge;
    bst_sky_clock *clock;
    bst_onboard_cue_knot knots[BST_CUE_KNOTS];
    bst_quat cue_error; /* turns where the own cue's target nominally is to where the cue has it */
    /* the second that was looked at last, and the quintic about it, of where the cue has the
     * target */
    int64_t checked;
    bool any_checked, smooth;
    bst_vec3 cued[BST_QUINTIC_POINTS];
    bst_task task; /* the last one */
    bool tasked;   /* its object is the cue, without an error */
};

/* Onboard time, and where the observer believes to be. */
bst_status bst_onboard_nav_eye(bst_ctx *ctx, bst_knowledge_view *view, double seconds, double *t,
                               bst_world_state *eye) BST_MUST_CHECK;

#endif
