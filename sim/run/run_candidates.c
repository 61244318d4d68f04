#include "sim/run/run_candidates.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/sky_clock.h"
#include "sim/world/world_config.h"
#include "tracker/orbit/orbit_link.h"

/* Tracks are linked within a day. */
static const double WITHIN_S = BST_DAY_S;
/* tracks that confirm a candidate: two of different objects may fit one orbit by chance */
enum { CONFIRMED = 3 };
/* half the radius of a sphere of 1 m^2 per quarter of its cross-section, as in run_custody.c, m */
static const double UNKNOWN_PHOTOCENTRE_M = 0.5;

struct bst_run_candidates {
    bst_sky_clock *clock;
    bst_od_sgp4 sgp4;
    bst_od_motion motion;
    bst_od_linker linker;
    /* of each item of the linker: object of its first track, -1: none; tracks of others too */
    int32_t object[BST_OD_LINK_ORBITS];
    bool mixed[BST_OD_LINK_ORBITS];
    bst_io_table *table;
    bst_candidate_figures figures;
};

static const bst_io_column columns[] = {
    {"sensor", BST_COLUMN_INT, "", "row of the table sensors"},
    {"track_id", BST_COLUMN_INT, "", "of the sensor's tracker"},
    {"time_s", BST_COLUMN_REAL, "s", "last detection of the track, since the epoch"},
    {"candidate", BST_COLUMN_INT, "", "1, 2, ...: orbit, or track that waits for another"},
    {"tracks", BST_COLUMN_INT, "", "of the candidate so far; 1: it waits"},
    {"chi2", BST_COLUMN_REAL, "", "of the fit to all its directions; NULL: none"},
    {"degrees", BST_COLUMN_INT, "", "degrees of freedom of that; NULL: none"},
    {"true_object", BST_COLUMN_INT, "", "object that the track belongs to; NULL: none"},
    {"wrong", BST_COLUMN_INT, "", "1: the candidate has tracks of different objects, or of none"},
};

bst_status bst_run_candidates_create(bst_ctx *ctx, const bst_world *world, bst_run *store,
                                     bst_run_candidates **out) {
    bst_run_candidates *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for candidate objects");
    }
    bst_status status = bst_sky_clock_create(ctx, bst_world_earth_orientation(world), &c->clock);
    if (status == BST_OK && store) {
        status = bst_io_table_create(
            ctx, store, "custody_candidates",
            "Tracks that no object of the catalogue explains, and the orbits made of them.",
            columns, sizeof columns / sizeof *columns, &c->table);
    }
    if (status != BST_OK) {
        bst_run_candidates_free(c);
        return status;
    }
    c->sgp4.clock = c->clock;
    c->motion = (bst_od_motion){.sgp4 = &c->sgp4, .epoch = bst_world_time(world, 0.0)};
    *out = c;
    return BST_OK;
}

void bst_run_candidates_free(bst_run_candidates *c) {
    if (c) {
        bst_sky_clock_free(c->clock);
        free(c);
    }
}

/* Rotates a state and its covariance from GCRF to TEME. TEME turns by 8e-12 rad/s: 28 m a day at a
 * geostationary distance. */
static bst_status turn_to_teme(bst_ctx *ctx, bst_run_candidates *c, const bst_od_solution *s,
                               bst_custody_fix *out) {
    const double step_s = 1800.0;
    bst_sky_rotation now, sides[2];
    const bst_time t = bst_time_add(c->motion.epoch, s->state.time_s);
    BST_TRY(bst_sky_clock_at(ctx, c->clock, t, &now));
    BST_TRY(bst_sky_clock_at(ctx, c->clock, bst_time_add(t, step_s), &sides[0]));
    BST_TRY(bst_sky_clock_at(ctx, c->clock, bst_time_add(t, -step_s), &sides[1]));
    const bst_mat3 *turn = &now.frames.gcrf_from_teme;
    out->time_s = s->state.time_s;
    bst_time_utc(t, &out->epoch_utc_jd[0], &out->epoch_utc_jd[1]);
    out->position_m = bst_mat3_transpose_mul_vec(turn, s->state.position_m);
    const bst_vec3 moved = bst_vec3_scale(
        bst_vec3_sub(bst_mat3_mul_vec(&sides[0].frames.gcrf_from_teme, out->position_m),
                     bst_mat3_mul_vec(&sides[1].frames.gcrf_from_teme, out->position_m)),
        0.5 / step_s);
    out->velocity_mps =
        bst_mat3_transpose_mul_vec(turn, bst_vec3_sub(s->state.velocity_mps, moved));
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < 6; k++) {
            out->covariance[i][k] = 0.0;
            for (int m = 0; m < 9; m++) {
                out->covariance[i][k] += turn->m[m / 3][i % 3] *
                                         s->covariance[m / 3 + i / 3 * 3][m % 3 + k / 3 * 3] *
                                         turn->m[m % 3][k % 3];
            }
        }
    }
    return BST_OK;
}

/* Makes a new object of a candidate whose tracks determine an orbit, and removes the candidate. */
static bst_status confirm(bst_ctx *ctx, bst_run_candidates *c, int at, double last_s,
                          bst_run_new_object *made) {
    const bst_od_linked *item = &c->linker.items[at];
    const bst_od_options options = {.motion = c->motion, .scale_variance = true};
    bst_od_solution found;
    bst_ctx quiet = {0}; /* the candidate waits for another track */
    if (item->arcs < CONFIRMED ||
        bst_od_fit(&quiet, item->directions, item->count, &options, &item->state, NULL, &found) !=
            BST_OK ||
        !(found.bend < 1.0)) {
        return BST_OK;
    }
    bst_custody_fix fix;
    BST_TRY(turn_to_teme(ctx, c, &found, &fix));
    if (!bst_custody_start(&fix, UNKNOWN_PHOTOCENTRE_M, &made->orbit, &made->filter)) {
        return BST_OK;
    }
    made->score.updates = item->arcs;
    made->score.last_s = last_s;
    made->true_object = c->mixed[at] ? -1 : c->object[at];
    const int last = c->linker.count - 1;
    bst_od_linker_drop(&c->linker, at);
    c->object[at] = c->object[last];
    c->mixed[at] = c->mixed[last];
    return BST_OK;
}

bst_status bst_run_candidates_take(bst_ctx *ctx, bst_run_candidates *c, int sensor,
                                   const bst_run_arc *arc, int true_object,
                                   bst_run_new_object *made) {
    memset(made, 0, sizeof *made); /* all bytes are in a saved state */
    if (arc->count < BST_OD_LEAST) {
        return BST_OK;
    }
    const int at =
        bst_od_link_arc(&c->linker, &c->motion, sensor, arc->directions, arc->count, WITHIN_S);
    const bst_od_linked *item = &c->linker.items[at];
    const bool first = item->arcs == 1, was_wrong = !first && c->mixed[at];
    if (first) {
        c->object[at] = true_object;
        c->mixed[at] = false;
    } else {
        c->mixed[at] = was_wrong || true_object < 0 || true_object != c->object[at];
    }
    c->figures.candidates += item->arcs == 2;
    c->figures.confirmed += item->arcs == CONFIRMED;
    c->figures.wrong += c->mixed[at] && !was_wrong;
    if (c->table) {
        const bst_io_value row[] = {bst_io_int_value(sensor),
                                    bst_io_int_value(arc->id),
                                    bst_io_real_value(arc->state.observer.time_s),
                                    bst_io_int_value(item->id),
                                    bst_io_int_value(item->arcs),
                                    bst_io_real_value(first ? NAN : item->chi2),
                                    bst_io_known_int_value(2 * item->count - 6, !first),
                                    bst_io_known_int_value(true_object, true_object >= 0),
                                    bst_io_int_value(c->mixed[at])};
        BST_TRY(bst_io_table_append(ctx, c->table, row));
    }
    return confirm(ctx, c, at, arc->state.observer.time_s, made);
}

bst_candidate_figures bst_run_candidates_figures(const bst_run_candidates *c) {
    return c->figures;
}

bst_status bst_run_candidates_archive(bst_run_candidates *c, int world_objects,
                                      bst_archive *archive) {
    BST_TRY(bst_od_linker_archive(&c->linker, archive));
    for (int i = 0; i < c->linker.count; i++) {
        c->object[i] = (int32_t)bst_archive_integer(archive, c->object[i], -1, world_objects - 1);
        bst_archive_bool(archive, &c->mixed[i]);
    }
    BST_ARCHIVE(archive, c->figures);
    return BST_OK;
}
