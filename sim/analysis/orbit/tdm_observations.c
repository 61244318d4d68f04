#include "sim/analysis/orbit/tdm_observations.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/bodies.h"
#include "sim/astro/oem.h"
#include "sim/astro/tdm.h"
#include "tracker/orbit/orbit_photocentre.h"

static bool is_same(const bst_tdm_pair *a, const bst_tdm_pair *b) {
    return strcmp(a->observer, b->observer) == 0 && strcmp(a->object, b->object) == 0;
}

static int64_t count_of(const bst_tdm *tdm, const bst_tdm_pair *pair) {
    int64_t count = 0;
    for (int i = 0; i < bst_tdm_pair_count(tdm); i++) {
        const bst_tdm_pair *p = bst_tdm_pair_at(tdm, i);
        count += is_same(p, pair) ? p->count : 0;
    }
    return count;
}

/* Selects the requested pair of participants, or the one with most angles. */
static bst_status choose_pair(bst_ctx *ctx, const bst_tdm_request *q, const bst_tdm *tdm,
                              const bst_tdm_pair **out) {
    int64_t most = 0;
    *out = NULL;
    for (int i = 0; i < bst_tdm_pair_count(tdm); i++) {
        const bst_tdm_pair *p = bst_tdm_pair_at(tdm, i);
        int64_t count = count_of(tdm, p);
        if ((!q->object || strcmp(q->object, p->object) == 0) && p->count > 0 && count > most) {
            most = count;
            *out = p;
        }
    }
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: has no angles of \"%s\"", q->path,
                           q->object ? q->object : "");
}

static int by_time(const void *a, const void *b) {
    double d = bst_time_diff(((const bst_run_observation *)a)->time,
                             ((const bst_run_observation *)b)->time);
    return (d > 0.0) - (d < 0.0);
}

/* Angles of a TDM, and the source of observer states. */
typedef struct sources {
    const bst_tdm *tdm;
    const bst_oem *oem;
    int object; /* the observer in oem */
    bst_sky_clock *clock;
    bst_time epoch; /* of the first angles */
} sources;

/* Adds the observer state at reception, and converts the angles to a direction. */
static bst_status complete(bst_ctx *ctx, const bst_tdm_request *q, const sources *s,
                           const bst_tdm_angles *a, bst_run_observation *o) {
    bst_bodies bodies;
    bst_od_observer *eye = &o->od.observer;
    double variance = q->sigma_rad * q->sigma_rad;
    *o = (bst_run_observation){.time = a->time, .v_mag = a->mag, .snr = NAN};
    BST_TRY(bst_oem_state(ctx, s->oem, s->object, s->clock, a->time, &eye->position_m,
                          &eye->velocity_mps));
    bst_bodies_at(a->time, &bodies);
    eye->time_s = bst_time_diff(a->time, s->epoch);
    eye->earth_bary_mps = bodies.earth_bary_mps;
    o->od.cov_11 = o->od.cov_22 = variance;
    o->od.direction = bst_vec3_from_radec(a->ra_rad, a->dec_rad);
    if (q->aberrated) {
        bst_light light = bst_light_at(&bodies, eye->position_m, eye->velocity_mps);
        o->od.direction = bst_light_unaberrate(&light, o->od.direction);
    }
    o->od.sun = bst_vec3_unit(bodies.sun_m);
    o->od.photocentre_factor = bst_od_photocentre_factor_seen(o->od.sun, o->od.direction);
    return BST_OK;
}

/* Collects the observations of a sensor and object from the segments of a TDM. */
static bst_status gather(bst_ctx *ctx, const bst_tdm_request *q, sources *s,
                         const bst_tdm_pair *pair, bst_run_sensor *sensor,
                         bst_run_observation *items) {
    const bst_tdm *tdm = s->tdm;
    const char *name = q->observer_name ? q->observer_name : pair->observer;
    if (!q->observer_name && bst_oem_object_count(s->oem) == 1) {
        name = ""; /* there is only one: its name does not matter */
    }
    bst_status status = bst_oem_find(ctx, s->oem, name, &s->object);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "%s", q->observer);
    }
    s->epoch = pair->items[0].time;
    for (int i = 0; i < bst_tdm_pair_count(tdm); i++) {
        const bst_tdm_pair *p = bst_tdm_pair_at(tdm, i);
        if (is_same(p, pair) && p->count > 0 && bst_time_diff(p->items[0].time, s->epoch) < 0.0) {
            s->epoch = p->items[0].time;
        }
    }
    int64_t n = 0;
    for (int i = 0; i < bst_tdm_pair_count(tdm); i++) {
        const bst_tdm_pair *p = bst_tdm_pair_at(tdm, i);
        for (int64_t k = 0; k < p->count && is_same(p, pair); k++, n++) {
            status = complete(ctx, q, s, &p->items[k], &items[n]);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", q->observer);
            }
        }
    }
    qsort(items, (size_t)n, sizeof *items, by_time);
    *sensor = (bst_run_sensor){.index = -1};
    snprintf(sensor->observer, sizeof sensor->observer, "%.79s", pair->observer);
    snprintf(sensor->name, sizeof sensor->name, "TDM");
    snprintf(sensor->target, sizeof sensor->target, "%.79s", pair->object);
    return BST_OK;
}

bst_status bst_tdm_observations(bst_ctx *ctx, const bst_tdm_request *q, bst_run_sensor *sensor,
                                bst_run_observation **items, int64_t *count) {
    bst_tdm *tdm = NULL;
    bst_oem *oem = NULL;
    bst_astro_eop *eop = NULL;
    bst_sky_clock *clock = NULL;
    const bst_tdm_pair *pair = NULL;
    *items = NULL;
    *count = 0;
    if (!q->observer) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: angles of a TDM need the observer's states: add --observer FILE.oem",
                        q->path);
    }
    bst_status status = bst_tdm_load(ctx, q->path, &tdm);
    status = status == BST_OK ? bst_oem_load(ctx, q->observer, &oem) : status;
    status = status == BST_OK ? bst_astro_eop_builtin(ctx, &eop) : status;
    status = status == BST_OK ? bst_sky_clock_create(ctx, eop, &clock) : status;
    status = status == BST_OK ? choose_pair(ctx, q, tdm, &pair) : status;
    if (status == BST_OK) {
        *count = count_of(tdm, pair);
        *items = malloc((size_t)*count * sizeof **items);
        sources s = {.tdm = tdm, .oem = oem, .clock = clock};
        status = *items ? gather(ctx, q, &s, pair, sensor, *items)
                        : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for angles");
    }
    if (status != BST_OK) {
        free(*items);
        *items = NULL;
    }
    bst_sky_clock_free(clock);
    bst_astro_eop_free(eop);
    bst_oem_free(oem);
    bst_tdm_free(tdm);
    return status;
}
