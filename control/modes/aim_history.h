/* Directions that were commanded, looked up by time. */
#ifndef BST_CONTROL_MODES_AIM_HISTORY_H
#define BST_CONTROL_MODES_AIM_HISTORY_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/vec.h"

enum { BST_AIM_HISTORY_SAMPLES = 256 };

typedef struct bst_aim_sample {
    int64_t tick; /* of effect */
    bst_vec3 direction, rate_radps;
    bool joined; /* samples between this one and the one before were left out */
} bst_aim_sample;

/* A ring that reaches back over a given time: samples closer than `spacing_ticks` are left out and
 * interpolated. Plain data. */
typedef struct bst_aim_history {
    double tick_rate_hz;
    int64_t spacing_ticks;
    int64_t kept; /* samples so far */
    bool any;
    bst_aim_sample last; /* the latest, kept or not */
    bst_aim_sample items[BST_AIM_HISTORY_SAMPLES];
} bst_aim_history;

/* Empty, for look-ups up to reach_s before the latest sample. */
void bst_aim_history_init(bst_aim_history *history, double tick_rate_hz, double reach_s);

/* The latest sample carried to a tick by its rate; false: there is none. */
bool bst_aim_history_predict(const bst_aim_history *history, int64_t tick, bst_vec3 *out);

/* Adds a sample of a tick not before the latest one, whose place it takes when the ticks are the
 * same. `jumped`: nothing is interpolated between the two. */
void bst_aim_history_add(bst_aim_history *history, int64_t tick, bst_vec3 direction,
                         bst_vec3 rate_radps, bool jumped);

/* The direction (unit) at a tick: carried by its rate from the sample before it, by a cubic through
 * the samples on both sides where some between them were left out. False: the history does not
 * reach back so far. */
bool bst_aim_history_at(const bst_aim_history *history, int64_t tick, bst_vec3 *out);

#endif
