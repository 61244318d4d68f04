#include "sim/run/run_candidates.h"

#include <math.h>
#include <stdlib.h>

#include "sim/astro/sky_clock.h"
#include "sim/world/world_config.h"
#include "tracker/orbit/orbit_link.h"

/* Tracks are linked within a day. */
static const double WITHIN_S = 86400.0;

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

bst_status bst_run_candidates_take(bst_ctx *ctx, bst_run_candidates *c, int sensor,
                                   const bst_run_arc *arc, int true_object) {
    if (arc->count < BST_OD_LEAST) {
        return BST_OK;
    }
    const int at = bst_od_link_arc(&c->linker, &c->motion, arc->directions, arc->count, WITHIN_S);
    const bst_od_linked *item = &c->linker.items[at];
    const bool first = item->arcs == 1, was_wrong = !first && c->mixed[at];
    if (first) {
        c->object[at] = true_object;
        c->mixed[at] = false;
    } else {
        c->mixed[at] = was_wrong || true_object < 0 || true_object != c->object[at];
    }
    c->figures.candidates += item->arcs == 2;
    c->figures.confirmed += item->arcs == 3;
    c->figures.wrong += c->mixed[at] && !was_wrong;
    if (!c->table) {
        return BST_OK;
    }
#define INT(v, known) \
    { .type = BST_COLUMN_INT, .is_null = !(known), .as.integer = (v) }
#define REAL(v, known) \
    { .type = BST_COLUMN_REAL, .is_null = !(known), .as.real = (v) }
    const bst_io_value row[] = {INT(sensor, true),
                                INT(arc->id, true),
                                REAL(arc->state.observer.time_s, true),
                                INT(item->id, true),
                                INT(item->arcs, true),
                                REAL(item->chi2, !first),
                                INT(2 * item->count - 6, !first),
                                INT(true_object, true_object >= 0),
                                INT(c->mixed[at], true)};
    return bst_io_table_append(ctx, c->table, row);
}

bst_candidate_figures bst_run_candidates_figures(const bst_run_candidates *c) {
    return c->figures;
}

bst_status bst_run_candidates_archive(bst_run_candidates *c, bst_archive *archive) {
    BST_TRY(bst_od_linker_archive(&c->linker, archive));
    BST_ARCHIVE(archive, c->object);
    for (int i = 0; i < BST_OD_LINK_ORBITS; i++) {
        bst_archive_bool(archive, &c->mixed[i]);
    }
    BST_ARCHIVE(archive, c->figures);
    return BST_OK;
}
