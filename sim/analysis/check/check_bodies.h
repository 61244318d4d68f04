/* Predicts when Earth, Moon or Sun are in a sensor's field, and when the sky at its boresight is
 * too bright, without a simulation. */
#ifndef BST_ANALYSIS_CHECK_CHECK_BODIES_H
#define BST_ANALYSIS_CHECK_CHECK_BODIES_H

#include "sim/engine/simulation.h"
#include "sim/world/world.h"

typedef enum bst_check_field_body {
    BST_FIELD_EARTH,
    BST_FIELD_MOON,
    BST_FIELD_SUN,
    BST_FIELD_BRIGHT_SKY, /* no body: the sky at the boresight fills the well of a pixel, and the
                             boresight is off the Earth's disc */
    BST_FIELD_BODIES
} bst_check_field_body;

/* A time span in which a body's disc overlaps the circle around the sensor, or the sky is too
 * bright. */
typedef struct bst_check_body_span {
    bst_check_field_body body;
    double from_s, until_s; /* after the epoch, to 0.1 s; until_s: at most the duration, or
                               BST_CHECK_LOOKED_S */
} bst_check_body_span;

typedef struct bst_check_body_spans {
    bst_check_body_span *items; /* [capacity] */
    int capacity;
    int count; /* may exceed the capacity */
} bst_check_body_spans;

/* Predicts the times at which bodies are in the field of a sensor, if its pointing is known.
 *
 * Given:    observer, sensor  indices in the scenario
 *           out->items        room for out->capacity
 * Returned: *out, by the time of their end; none if the pointing is unknown: strategies
 *           fixed and scan, a region as cue, tasks, scripted and external mounts
 * Errors: those of orbits and cues
 * Notes: the boresight is on the cue (strategies track and rate; stare: at stare_time_s, without
 * moving) or on the ideal mount's target. Steps of a thousandth of the run, 0.5 to 10 s: shorter
 * events may be missed. */
bst_status bst_check_bodies_in_field(bst_ctx *ctx, const bst_scenario *scenario,
                                     const bst_world *world, int observer, int sensor,
                                     bst_check_body_spans *out) BST_MUST_CHECK;

/* Logs a warning for each body that enters a sensor's field, and of a sky at the boresight that
 * exceeds the full well in an exposure: first time span, number and total duration. */
bst_status bst_check_bodies(bst_ctx *ctx, const bst_scenario *scenario,
                            const bst_simulation *simulation) BST_MUST_CHECK;

#endif
