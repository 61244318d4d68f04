#include "sim/astro/trajectory.h"

#include <stdlib.h>
#include <threads.h>

#include "sim/astro/atmosphere.h"
#include "sim/astro/trajectory_internal.h"

#define DEFAULT_TOLERANCE 1e-9
#define LAST_TIME_S 1e10

/* Mutable state, protected by the mutex. */
typedef struct core {
    mtx_t mutex;
    bst_trajectory_chain_context context;
    bst_trajectory_chain forward;
    bst_trajectory_chain *backward; /* NULL until needed */
} core;

struct bst_trajectory {
    double at_s;
    bst_vec3 position_m, velocity_mps;
    bst_trajectory_edges edges;
    bst_radau radau;
    core *core;
};

static bool finite(bst_vec3 v) {
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

/* Checks initial state and tolerance of a numerical orbit. */
static bst_status check(bst_ctx *ctx, const bst_trajectory_options *o) {
    if (!finite(o->position_m) || !finite(o->velocity_mps) || !(fabs(o->at_s) <= LAST_TIME_S)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the initial state of an orbit must be finite, its time within 1e10 s");
    }
    double height = bst_astro_height_m(o->position_m);
    if (!(height >= BST_TRAJECTORY_FLOOR_M)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the initial state lies at a height of %.1f km, orbits end below %.0f km",
                        1e-3 * height, 1e-3 * BST_TRAJECTORY_FLOOR_M);
    }
    if (!(o->tolerance == 0.0 || (o->tolerance >= 1e-11 && o->tolerance <= 1e-3))) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "tolerance %g of an orbit (allowed: 1e-11 to 1e-3)",
                        o->tolerance);
    }
    for (int i = 0; i < o->burn_count; i++) {
        const bst_astro_thrust *b = &o->burns[i];
        if (!finite(b->dv_rtn_mps) || !(fabs(b->time_s) <= LAST_TIME_S) ||
            !(b->duration_s >= 0.0 && b->duration_s <= LAST_TIME_S)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "burn %d: its time, duration (0 and above) and change of velocity must "
                            "be finite",
                            i);
        }
    }
    return BST_OK;
}

bst_status bst_trajectory_create(bst_ctx *ctx, const bst_trajectory_options *o,
                                 bst_trajectory **out) {
    *out = NULL;
    BST_TRY(check(ctx, o));
    bst_trajectory *t = calloc(1, sizeof *t);
    core *c = calloc(1, sizeof *c);
    if (!t || !c || mtx_init(&c->mutex, mtx_plain) != thrd_success) {
        free(t);
        free(c);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a numerical orbit");
    }
    t->core = c;
    t->at_s = o->at_s;
    t->position_m = o->position_m;
    t->velocity_mps = o->velocity_mps;
    bst_radau_init(&t->radau);
    bst_status status = bst_trajectory_edges_make(ctx, o->burns, o->burn_count, &t->edges);
    if (status == BST_OK) {
        status = bst_forces_create(ctx, &o->forces, o->epoch, &c->context.forces);
    }
    if (status != BST_OK) {
        bst_trajectory_free(t);
        return status;
    }
    c->context.radau = &t->radau;
    c->context.edges = &t->edges;
    c->context.tolerance = o->tolerance > 0.0 ? o->tolerance : DEFAULT_TOLERANCE;
    bst_trajectory_chain_start(&c->forward, &c->context, 1.0, o->at_s, o->position_m,
                               o->velocity_mps);
    *out = t;
    return BST_OK;
}

void bst_trajectory_free(bst_trajectory *t) {
    if (t) {
        mtx_destroy(&t->core->mutex);
        bst_forces_free(t->core->context.forces);
        bst_trajectory_edges_free(&t->edges);
        free(t->core->backward);
        free(t->core);
        free(t);
    }
}

/* Starts the integration backward in time at its first use. */
static bst_status need_backward(bst_ctx *ctx, const bst_trajectory *t) {
    core *c = t->core;
    if (!c->backward) {
        c->backward = malloc(sizeof *c->backward);
        if (!c->backward) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a numerical orbit");
        }
        bst_trajectory_chain_start(c->backward, &c->context, -1.0, t->at_s, t->position_m,
                                   t->velocity_mps);
    }
    return BST_OK;
}

bst_status bst_trajectory_state(bst_ctx *ctx, const bst_trajectory *t, double seconds,
                                bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    if (!(fabs(seconds) <= LAST_TIME_S)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "an orbit at %g s after the epoch", seconds);
    }
    core *c = t->core;
    (void)mtx_lock(&c->mutex);
    bst_trajectory_chain *chain = &c->forward;
    bst_status status = BST_OK;
    if (seconds < t->at_s) {
        status = need_backward(ctx, t);
        chain = c->backward;
    }
    const bst_trajectory_chain_step *step = NULL;
    if (status == BST_OK) {
        status = bst_trajectory_chain_find(ctx, chain, &c->context, seconds, &step);
    }
    if (status == BST_OK) {
        double s = ((seconds - step->time_s) - step->time_low_s) / step->motion.h_s;
        bst_radau_state(&step->motion, s, position_m, velocity_mps);
    }
    (void)mtx_unlock(&c->mutex);
    return status;
}
