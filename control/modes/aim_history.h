/* History of commanded directions, looked up by time. */
#ifndef BST_CONTROL_MODES_AIM_HISTORY_H
#define BST_CONTROL_MODES_AIM_HISTORY_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/archive.h"
#include "boresight/vec.h"

enum { BST_AIM_HISTORY_SAMPLES = 256 };

typedef struct bst_aim_sample {
    int64_t tick; /* time of effect */
    bst_vec3 direction, rate_radps;
    bool joined; /* intermediate samples since the previous one were omitted */
} bst_aim_sample;

/* Ring buffer over a given time: samples closer than `spacing_ticks` are omitted and interpolated.
 * Plain data. */
typedef struct bst_aim_history {
    double tick_rate_hz;
    int64_t spacing_ticks;
    int64_t kept; /* number of samples so far */
    bool any;
    bst_aim_sample last; /* latest sample, stored or not */
    bst_aim_sample items[BST_AIM_HISTORY_SAMPLES];
} bst_aim_history;

/* Initialises an empty history for look-ups up to reach_s before the latest sample. */
void bst_aim_history_init(bst_aim_history *history, double tick_rate_hz, double reach_s);

/* Saves or restores a history, for bst_module_desc.archive. */
void bst_aim_history_archive(bst_aim_history *history, bst_archive *archive);

/* Latest sample extrapolated to a tick at its rate; false if there is none. */
bool bst_aim_history_predict(const bst_aim_history *history, int64_t tick, bst_vec3 *out);

/* Adds a sample at a tick not before the latest one; it replaces a sample of the same tick.
 *
 * Given:     jumped  no interpolation between the two */
void bst_aim_history_add(bst_aim_history *history, int64_t tick, bst_vec3 direction,
                         bst_vec3 rate_radps, bool jumped);

/* Direction (unit) at a tick: extrapolated from the previous sample at its rate, or a cubic between
 * both neighbours if samples between them were omitted. Returns false if the history does not reach
 * back so far. */
bool bst_aim_history_at(const bst_aim_history *history, int64_t tick, bst_vec3 *out);

#endif
