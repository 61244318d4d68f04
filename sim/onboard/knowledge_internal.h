/* Internal state of an onboard knowledge view, shared by knowledge*.c. */
#ifndef BST_ONBOARD_KNOWLEDGE_INTERNAL_H
#define BST_ONBOARD_KNOWLEDGE_INTERNAL_H

#include "sim/core/quintic.h"
#include "sim/onboard/knowledge.h"
#include "sim/world/world_internal.h"

struct bst_knowledge {
    const bst_world *world; /* only for nominal orbits and Earth orientation; never exposed */
    bst_stars *own_stars;   /* NULL: the world's catalogue */
    bst_stars *altered;     /* stars with catalogue errors; NULL: no errors */
    bst_camera camera;
    const struct bst_psf *psf; /* borrowed from the world; NULL: Gaussian of the camera */
    int observer, sensor;
    double julian_year;
    struct bst_memo *memo;
};

/* the cue's direction is cached at whole seconds and interpolated from six of them */
enum { BST_CUE_KNOTS = 16 };

typedef struct bst_onboard_cue_knot {
    bool made, known; /* known: the direction exists */
    int64_t second;
    bst_vec3 direction;
} bst_onboard_cue_knot;

struct bst_knowledge_view {
    const bst_knowledge *knowledge;
    bst_sky_clock *clock;
    bst_onboard_cue_knot knots[BST_CUE_KNOTS];
    bst_quat cue_error; /* rotation from the nominal direction of the own cue to the cue */
    /* last tested second, and the quintic of the cue's direction around it */
    int64_t checked;
    bool any_checked, smooth;
    bst_vec3 cued[BST_QUINTIC_POINTS];
    bst_task task;         /* latest task */
    bool tasked;           /* the task's object is the cue, without cue error */
    double clock_offset_s; /* taken from the onboard time */
    bool cue_changed;      /* since the state was saved: the view was not asked yet */
};

/* Forgets the cached directions of the cue. */
void bst_onboard_forget_cue(bst_knowledge_view *view);

/* Onboard time as corrected, and the estimated observer state. */
bst_status bst_onboard_nav_eye(bst_ctx *ctx, bst_knowledge_view *view, double seconds, double *t,
                               bst_world_state *eye) BST_MUST_CHECK;

#endif
