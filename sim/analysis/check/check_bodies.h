/* When the Earth, the Moon or the Sun is in a sensor's field, foreseen without simulating. */
#ifndef BST_ANALYSIS_CHECK_CHECK_BODIES_H
#define BST_ANALYSIS_CHECK_CHECK_BODIES_H

#include "sim/engine/simulation.h"
#include "sim/world/world.h"

typedef enum bst_check_field_body {
    BST_FIELD_EARTH,
    BST_FIELD_MOON,
    BST_FIELD_SUN,
    BST_FIELD_BODIES
} bst_check_field_body;

/* A time in which the circle about the sensor meets a body's disc. */
typedef struct bst_check_body_span {
    bst_check_field_body body;
    double from_s, until_s; /* after the epoch, to 0.1 s; until_s: at most the run's duration,
                             * of longer runs BST_CHECK_LOOKED_S */
} bst_check_body_span;

typedef struct bst_check_body_spans {
    bst_check_body_span *items; /* [capacity] */
    int capacity;
    int count; /* may exceed the capacity */
} bst_check_body_spans;

/* Times at which bodies are in the field of a sensor whose boresight is known beforehand.
 *
 * Given:    observer, sensor  indices in the scenario
 *           out->items        room for out->capacity
 * Returned: *out, by the time of their end; none where the boresight is not known: strategies fixed
 *           and scan, a region for a cue, tasks, scripted and external mounts
 * Errors:   what orbits and cues fail with
 * Notes: the boresight is on the cue (strategies track and rate; stare: at stare_time_s, without
 * moving) or on the ideal mount's target. It is looked at in steps of a thousandth of the run, 0.5
 * to 10 s: shorter meetings may be missed. */
bst_status bst_check_bodies_in_field(bst_ctx *ctx, const bst_scenario *scenario,
                                     const bst_world *world, int observer, int sensor,
                                     bst_check_body_spans *out) BST_MUST_CHECK;

/* Logs a warning for each body that comes into a sensor's field, with the first time span, and
 * number and sum of all. */
bst_status bst_check_bodies(bst_ctx *ctx, const bst_scenario *scenario,
                            const bst_simulation *simulation) BST_MUST_CHECK;

#endif
