#include "scenegen/ramp_intervals.h"

#include <assert.h>
#include <stdlib.h>

#include "scenegen/render_request.h"
#include "sim/world/scene/los_track.h"
#include "sim/world/scene/row_exposure.h"
#include "sim/world/scene/skylight.h"

struct bst_ramp_intervals {
    bst_los_track_store store;
    bst_los_track track;
    bst_scene_source *sources;
    bst_scene_source_part *parts; /* of the sources that move or change their brightness */
    int source_capacity, part_capacity;
    bst_skylight_map map;
    float *background; /* electrons of the map */
    size_t nodes;
};

bst_status bst_ramp_intervals_create(bst_ctx *ctx, bst_ramp_intervals **out) {
    assert(out);
    *out = calloc(1, sizeof **out);
    return *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the reads of a ramp");
}

void bst_ramp_intervals_free(bst_ramp_intervals *s) {
    if (s) {
        bst_los_track_store_free(&s->store);
        free(s->sources);
        free(s->parts);
        free(s->background);
        free(s);
    }
}

static bst_status reserve(bst_ctx *ctx, bst_ramp_intervals *s, int sources, int parts,
                          size_t nodes) {
    bool enough = true;
    if (sources > s->source_capacity) {
        free(s->sources);
        s->sources = malloc((size_t)sources * sizeof *s->sources);
        s->source_capacity = s->sources ? sources : 0;
        enough = s->sources != NULL;
    }
    if (parts > s->part_capacity) {
        free(s->parts);
        s->parts = malloc((size_t)parts * sizeof *s->parts);
        s->part_capacity = s->parts ? parts : 0;
        enough = enough && s->parts;
    }
    if (nodes > s->nodes) {
        free(s->background);
        s->background = malloc(nodes * sizeof *s->background);
        s->nodes = s->background ? nodes : 0;
        enough = enough && s->background;
    }
    return enough
               ? BST_OK
               : bst_fail(ctx, BST_ERR_MEMORY, "no memory for the %d sources of a ramp", sources);
}

bst_status bst_ramp_interval(bst_ctx *ctx, bst_ramp_intervals *s, const bst_render_request *q,
                             int interval, int count, bst_render_request *part) {
    assert(s && q && part && interval >= 0 && interval < count);
    const bst_skylight_map *map = q->background;
    size_t nodes = map ? (size_t)map->columns * (size_t)map->rows : 0;
    int changing = 0;
    for (int i = 0; i < q->count; i++) {
        changing += q->sources[i].path || q->sources[i].rate;
    }
    BST_TRY(reserve(ctx, s, q->count, changing, nodes));
    double exposure_s = bst_render_exposure_s(q);
    double u0 = (double)interval / count, u1 = (interval + 1.0) / count;
    BST_TRY(
        bst_los_track_part(ctx, &s->store, q->track, u0 * exposure_s, u1 * exposure_s, &s->track));
    for (int i = 0, used = 0; i < q->count; i++) {
        const bst_scene_source *from = &q->sources[i];
        if (from->path || from->rate) {
            bst_scene_source_during(from, u0, u1, &s->parts[used++], &s->sources[i]);
        } else {
            s->sources[i] = *from;
        }
    }
    *part = *q;
    part->track = &s->track;
    part->sources = s->sources;
    part->background_e = q->background_e / count;
    part->dark_e = q->dark_e / count;
    part->start_s = q->start_s + u0 * exposure_s;
    if (map) {
        s->map = *map;
        for (size_t i = 0; i < nodes; i++) {
            s->background[i] = map->e[i] / (float)count;
        }
        s->map.e = s->background;
        s->map.least_e = map->least_e / count;
        part->background = &s->map;
    }
    return BST_OK;
}
