#include "sim/satellite/heat_history.h"

#include <stdint.h>
#include <stdlib.h>

enum { TIME_CONSTANTS = 8, STEPS_MAX = 20000 };

struct bst_heat_history {
    const bst_satellite *satellite;
    double step_s;
    int64_t block;       /* steps after which the integration starts anew */
    double *load, *next; /* of the nodes `node` and node + 1 */
    double *kelvin, *after;
    double *result;
    bool valid;
    int64_t chain, node; /* of kelvin; `after` belongs to node + 1 */
};

/* Time constant at 280 K of a surface that emits. */
static double time_constant_s(const bst_satellite *s, int material) {
    double emissivity = fmax(s->materials[material].emissivity, 0.02);
    return s->surfaces[material].capacity_jpm2k /
           (4.0 * emissivity * BST_STEFAN_BOLTZMANN * 280.0 * 280.0 * 280.0);
}

bst_status bst_heat_history_create(bst_ctx *ctx, const bst_satellite *s, bst_heat_history **out) {
    bst_heat_history *h = *out = calloc(1, sizeof *h);
    double shortest = INFINITY, longest = 0.0;
    for (int i = 0; i < s->material_count; i++) {
        double t = time_constant_s(s, i);
        shortest = t > 0.0 ? fmin(shortest, t) : shortest;
        longest = fmax(longest, t);
    }
    if (h) {
        size_t n = (size_t)s->facet_count + 1;
        h->satellite = s;
        h->step_s = fmin(fmax(0.25 * shortest, 1.0), 60.0);
        h->step_s = fmax(h->step_s, TIME_CONSTANTS * longest / STEPS_MAX);
        h->block = (int64_t)ceil(TIME_CONSTANTS * longest / h->step_s) + 1;
        h->load = calloc(n, sizeof *h->load);
        h->next = calloc(n, sizeof *h->next);
        h->kelvin = calloc(n, sizeof *h->kelvin);
        h->after = calloc(n, sizeof *h->after);
        h->result = calloc(n, sizeof *h->result);
    }
    if (!h || !h->load || !h->next || !h->kelvin || !h->after || !h->result) {
        bst_heat_history_free(h);
        *out = NULL;
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the temperatures of %d facets",
                        s->facet_count);
    }
    return BST_OK;
}

void bst_heat_history_free(bst_heat_history *h) {
    if (h) {
        free(h->load);
        free(h->next);
        free(h->kelvin);
        free(h->after);
        free(h->result);
        free(h);
    }
}

/* Loads at a node. */
static bool loads_at(const bst_heat_history *h, bst_satellite_pose *pose, int64_t node,
                     bst_heat_source *source, void *user, double *load) {
    bst_heat_environment e;
    if (!source(user, pose, (double)node * h->step_s, &e)) {
        return false;
    }
    bst_heat_loads(pose, &e, load);
    return true;
}

static double emissivity_of(const bst_satellite *s, int facet) {
    return s->materials[s->facets[facet].material].emissivity;
}

/* Temperatures at the node after the current one, from the loads at both. */
static void integrate(bst_heat_history *h) {
    const bst_satellite *s = h->satellite;
    for (int i = 0; i < s->facet_count; i++) {
        double capacity = s->surfaces[s->facets[i].material].capacity_jpm2k;
        const double load[2] = {h->load[i], h->next[i]};
        h->after[i] = capacity > 0.0 ? bst_heat_after(h->kelvin[i], load, emissivity_of(s, i),
                                                      capacity, h->step_s)
                                     : bst_heat_steady_k(load[1], emissivity_of(s, i));
    }
}

static void swap(double **a, double **b) {
    double *c = *a;
    *a = *b;
    *b = c;
}

/* Brings the chain to a node and the one after it. */
static bool advance(bst_heat_history *h, bst_satellite_pose *pose, int64_t chain, int64_t node,
                    bst_heat_source *source, void *user) {
    const bst_satellite *s = h->satellite;
    if (!h->valid || h->chain != chain || h->node > node) {
        h->valid = false;
        h->chain = chain;
        h->node = (chain - 1) * h->block;
        if (!loads_at(h, pose, h->node, source, user, h->load)) {
            return false;
        }
        for (int i = 0; i < s->facet_count; i++) {
            h->kelvin[i] = bst_heat_steady_k(h->load[i], emissivity_of(s, i));
        }
        if (!loads_at(h, pose, h->node + 1, source, user, h->next)) {
            return false;
        }
        integrate(h);
    }
    while (h->node < node) {
        swap(&h->load, &h->next);
        swap(&h->kelvin, &h->after);
        h->node++;
        h->valid = loads_at(h, pose, h->node + 1, source, user, h->next);
        if (!h->valid) {
            return false;
        }
        integrate(h);
    }
    return h->valid = true;
}

const double *bst_heat_history_at(bst_heat_history *h, bst_satellite_pose *pose, double seconds,
                                  bst_heat_source *source, void *user) {
    double place = floor(seconds / h->step_s);
    if (!(fabs(place) < 1e15)) {
        return NULL;
    }
    int64_t node = (int64_t)place;
    int64_t chain = node / h->block - (node % h->block < 0 ? 1 : 0);
    if (!advance(h, pose, chain, node, source, user)) {
        return NULL;
    }
    double part = seconds / h->step_s - place;
    for (int i = 0; i < h->satellite->facet_count; i++) {
        h->result[i] = h->kelvin[i] + part * (h->after[i] - h->kelvin[i]);
    }
    return h->result;
}
