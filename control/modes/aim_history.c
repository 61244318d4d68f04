#include "control/modes/aim_history.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

/* Spare samples for jumps, each of which needs one. */
#include "sim/core/invariant.h"
enum { SPARE = 32 };

void bst_aim_history_init(bst_aim_history *history, double tick_rate_hz, double reach_s) {
    assert(history && tick_rate_hz > 0.0 && reach_s >= 0.0);
    *history = (bst_aim_history){.tick_rate_hz = tick_rate_hz};
    history->spacing_ticks =
        (int64_t)ceil(reach_s * tick_rate_hz / (BST_AIM_HISTORY_SAMPLES - SPARE));
}

void bst_aim_history_archive(bst_aim_history *history, bst_archive *archive) {
    bst_archive_bool(archive, &history->any);
    history->kept =
        bst_archive_integer(archive, history->kept, history->any ? 1 : 0, INT64_MAX / 2);
    BST_ARCHIVE(archive, history->last);
    size_t stored =
        history->kept < BST_AIM_HISTORY_SAMPLES ? (size_t)history->kept : BST_AIM_HISTORY_SAMPLES;
    bst_archive_bytes(archive, history->items, stored * sizeof *history->items);
}

static bst_aim_sample *item(bst_aim_history *history, int64_t i) {
    return &history->items[i % BST_AIM_HISTORY_SAMPLES];
}

static bst_vec3 carried(const bst_aim_history *history, const bst_aim_sample *from, int64_t tick) {
    double dt = (double)(tick - from->tick) / history->tick_rate_hz;
    return bst_vec3_axpy(from->direction, dt, from->rate_radps);
}

bool bst_aim_history_predict(const bst_aim_history *history, int64_t tick, bst_vec3 *out) {
    if (history->any) {
        *out = carried(history, &history->last, tick);
    }
    return history->any;
}

static void keep(bst_aim_history *history, bst_aim_sample sample, bool joined) {
    sample.joined = joined;
    *item(history, history->kept++) = sample;
}

void bst_aim_history_add(bst_aim_history *history, int64_t tick, bst_vec3 direction,
                         bst_vec3 rate_radps, bool jumped) {
    assert(history && bst_is_unit_vec3(direction, BST_UNIT_TOLERANCE));
    assert(bst_is_finite_vec3(rate_radps));
    bst_aim_sample sample = {tick, direction, rate_radps, false};
    const bst_aim_sample *newest = history->kept > 0 ? item(history, history->kept - 1) : NULL;
    bool again = history->any && tick <= history->last.tick;
    bool left_out = newest && history->last.tick > newest->tick;
    if (!newest) {
        keep(history, sample, false);
    } else if (again && !left_out) { /* replaces the stored sample of the same tick */
        history->kept--;
        keep(history, sample, newest->joined && !jumped);
    } else {
        if (jumped && left_out && !again) {
            keep(history, history->last, true);
            left_out = false;
        }
        if (jumped || tick - newest->tick >= history->spacing_ticks) {
            keep(history, sample, left_out && !jumped);
        }
    }
    history->any = true;
    history->last = sample;
}

/* Cubic Hermite interpolation of directions from values and rates at both ends. */
static bst_vec3 between(const bst_aim_history *history, const bst_aim_sample *a,
                        const bst_aim_sample *b, int64_t tick) {
    double dt = (double)(b->tick - a->tick) / history->tick_rate_hz;
    double u = (double)(tick - a->tick) / (double)(b->tick - a->tick), v = 1.0 - u;
    bst_vec3 d = bst_vec3_scale(a->direction, v * v * (1.0 + 2.0 * u));
    d = bst_vec3_axpy(d, u * u * (1.0 + 2.0 * v), b->direction);
    d = bst_vec3_axpy(d, dt * u * v * v, a->rate_radps);
    return bst_vec3_axpy(d, -dt * u * u * v, b->rate_radps);
}

bool bst_aim_history_at(const bst_aim_history *history, int64_t tick, bst_vec3 *out) {
    if (!history->any) {
        return false;
    }
    bst_aim_sample after = history->last;
    int64_t newest = history->kept - 1;
    after.joined = after.tick > history->items[newest % BST_AIM_HISTORY_SAMPLES].tick;
    if (tick >= after.tick) {
        *out = bst_vec3_unit(carried(history, &after, tick));
        return true;
    }
    int64_t oldest = newest - BST_AIM_HISTORY_SAMPLES + 1;
    for (int64_t i = newest; i >= (oldest > 0 ? oldest : 0); i--) {
        const bst_aim_sample *aim = &history->items[i % BST_AIM_HISTORY_SAMPLES];
        if (aim->tick <= tick) {
            *out = bst_vec3_unit(after.joined ? between(history, aim, &after, tick)
                                              : carried(history, aim, tick));
            return true;
        }
        after = *aim;
    }
    return false;
}
