/* SGP4 of many sets: eight of a kind at a time. */
#include <assert.h>

#include "sim/astro/sgp4_lanes.h"

/* beyond this time, min, the scalar code does a set: angles may get too large for the vectors. It
 * also does the sets near another one. */
#define LONGEST_MIN 2e6

typedef struct pending {
    bst_sgp4_lanes lanes;
    const bst_sgp4 *set[BST_SGP4_LANES]; /* whose constants the lanes hold; NULL: none */
    int index[BST_SGP4_LANES];           /* in the arrays of the caller */
    int count;
} pending;

static bst_sgp4_kind kind_of(const bst_sgp4 *s) {
    return !s->deep_space                               ? BST_SGP4_NEAR
           : s->deep.resonance != BST_SGP4_NOT_RESONANT ? BST_SGP4_RESONANT
                                                        : BST_SGP4_DEEP;
}

/* Copies the constants of a set into a lane. */
static void fill_lane(bst_sgp4_kind kind, const bst_sgp4 *s, bst_sgp4_lanes *lanes, int lane) {
#define PUT(name, value) lanes->row[BST_SGP4_##name##_ROW][lane] = (value);
    BST_SGP4_ROWS(PUT)
    if (kind == BST_SGP4_NEAR) {
        BST_SGP4_NEAR_ROWS(PUT)
        return;
    }
    BST_SGP4_DEEP_ROWS(PUT)
    if (kind == BST_SGP4_RESONANT) {
        BST_SGP4_RESONANT_ROWS(PUT)
    }
#undef PUT
}

static void add(pending *p, bst_sgp4_kind kind, const bst_sgp4 *s, double minutes, int index) {
    int lane = p->count++;
    if (p->set[lane] != s) {
        fill_lane(kind, s, &p->lanes, lane);
        p->set[lane] = s;
    }
    p->lanes.minutes[lane] = minutes;
    p->index[lane] = index;
    if (kind == BST_SGP4_RESONANT) {
        bst_sgp4_knot knot;
        double left = bst_sgp4_resonance_knot(s, minutes, &knot);
        double(*row)[BST_SGP4_LANES] = p->lanes.row;
        row[BST_SGP4_KNOT_LEFT_ROW][lane] = left;
        row[BST_SGP4_KNOT_N_ROW][lane] = knot.n;
        row[BST_SGP4_KNOT_LAMBDA_ROW][lane] = knot.lambda;
        row[BST_SGP4_KNOT_PERIGEE_RE_ROW][lane] = knot.perigee.re;
        row[BST_SGP4_KNOT_PERIGEE_IM_ROW][lane] = knot.perigee.im;
    }
}

/* Propagates the pending sets and hands out their states. */
static void flush(pending *p, bst_sgp4_kind kind, bst_sgp4_state *states) {
    if (p->count == 0) {
        return;
    }
    for (int lane = p->count; lane < BST_SGP4_LANES; lane++) { /* unused ones repeat the first */
        if (p->set[lane] == NULL) {
            fill_lane(kind, p->set[0], &p->lanes, lane);
        }
        p->lanes.minutes[lane] = p->lanes.minutes[0];
    }
    bst_sgp4_propagate_lanes(kind, &p->lanes);
    for (int lane = 0; lane < p->count; lane++) {
        bst_sgp4_state *out = &states[p->index[lane]];
        if (p->lanes.valid[lane] == 0.0) {
            out->error = bst_sgp4_propagate(p->set[lane], p->lanes.minutes[lane],
                                            out->position_teme_km, out->velocity_teme_kmps);
            continue;
        }
        for (int j = 0; j < 3; j++) {
            out->position_teme_km[j] = p->lanes.state[j][lane];
            out->velocity_teme_kmps[j] = p->lanes.state[3 + j][lane];
        }
        out->error = BST_SGP4_OK;
    }
    p->count = 0;
}

void bst_sgp4_propagate_many(const bst_sgp4 *const *sets, const double *minutes, int count,
                             bst_sgp4_state *states) {
    assert(count >= 0 && (count == 0 || (sets && minutes && states)));
    pending kinds[BST_SGP4_KINDS];
    for (int k = 0; k < BST_SGP4_KINDS; k++) {
        kinds[k].count = 0;
        for (int lane = 0; lane < BST_SGP4_LANES; lane++) {
            kinds[k].set[lane] = NULL;
        }
    }
    for (int i = 0; i < count; i++) {
        if (!(fabs(minutes[i]) <= LONGEST_MIN) || sets[i]->middle) {
            states[i].error = bst_sgp4_propagate(sets[i], minutes[i], states[i].position_teme_km,
                                                 states[i].velocity_teme_kmps);
            continue;
        }
        bst_sgp4_kind kind = kind_of(sets[i]);
        add(&kinds[kind], kind, sets[i], minutes[i], i);
        if (kinds[kind].count == BST_SGP4_LANES) {
            flush(&kinds[kind], kind, states);
        }
    }
    for (int k = 0; k < BST_SGP4_KINDS; k++) {
        flush(&kinds[k], (bst_sgp4_kind)k, states);
    }
}
