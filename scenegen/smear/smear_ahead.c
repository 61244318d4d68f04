/* Nodes of a frame computed ahead of their use, on several threads: what a GPU's host is busy with,
 * while the processor's other cores are idle. The results are those computed when they are used. */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "scenegen/smear/smear_internal.h"

struct bst_smear_ahead_path {
    const bst_scene_source *source;
    bst_smear_place place;
    bst_smear own; /* work space and last_... values of this source; the rest is the frame's */
    bst_smear_ahead_level table;
    double aim;
};

/* Most moving sources computed ahead: a path's work space takes up to a megabyte. */
enum { MOST_PATHS = 64 };

/* Frees the work space of a path. */
static void free_path(bst_smear_ahead_path *a) {
    free(a->own.nodes.items);
    free(a->own.points.items);
    free(a->own.own_path);
    free(a->table.table);
}

/* Copies the frame into a path's own smear, whose work space stays. */
static void lend_frame(const bst_smear *s, bst_smear *own) {
    bst_smear copy = *s;
    copy.nodes = own->nodes;
    copy.points = own->points;
    copy.own_path = own->own_path;
    copy.own_capacity = own->own_capacity;
    copy.last_peak_e = copy.last_read_e = copy.chord_error = copy.body_sigma = 0.0;
    *own = copy;
}

/* Finds the frame's moving sources. Too little memory: fewer of them. */
static void find_paths(bst_smear *s, const bst_smear_frame *frame) {
    bst_ctx none = {0};
    s->ahead_count = 0;
    for (int i = 0; i < frame->sources && s->ahead_count < MOST_PATHS; i++) {
        const bst_scene_source *source = &frame->list[i];
        bst_smear_place place;
        /* bodies keep images, which one thread makes */
        if (!(source->path || source->rate || source->shape || source->ghost) || source->body ||
            !bst_smear_place_source(s, source, &place)) {
            continue;
        }
        if (s->ahead_count == s->ahead_capacity) {
            int before = s->ahead_capacity;
            if (bst_smear_reserve(&none, (void **)&s->ahead_paths, &s->ahead_capacity, before + 1,
                                  sizeof *s->ahead_paths) != BST_OK) {
                return;
            }
            for (int k = before; k < s->ahead_capacity; k++) {
                s->ahead_paths[k] = (bst_smear_ahead_path){.source = NULL};
            }
        }
        bst_smear_ahead_path *a = &s->ahead_paths[s->ahead_count++];
        a->source = source;
        a->place = place;
        a->aim = s->aim;
        a->table.ready = false;
        lend_frame(s, &a->own);
        a->own.disc_px = place.disc_px;
    }
}

/* What threads compute: moving sources, then levels, the finest first. */
typedef struct things_to_make {
    bst_smear *s;
    int levels[BST_SMEAR_LEVELS];
} things_to_make;

/* Computes some of them (callback). Those that fail are computed again when they are used, and fail
 * there. */
static void make_some(void *user, int begin, int end) {
    const things_to_make *all = user;
    bst_smear *s = all->s;
    for (int k = begin; k < end; k++) {
        bst_ctx own = {0};
        if (k >= s->ahead_count) {
            int n = all->levels[k - s->ahead_count];
            bst_status status = bst_smear_make_ahead(&own, s, n, &s->ahead[n]);
            s->ahead[n].ready = status == BST_OK;
            continue;
        }
        bst_smear_ahead_path *a = &s->ahead_paths[k];
        bst_status status = bst_smear_moving_nodes(&own, &a->own, a->source, a->place.electrons,
                                                   a->place.x, a->place.y);
        if (status == BST_OK && a->own.nodes.count > 0) {
            status = bst_smear_describe_ahead(&own, &a->own, true, &a->table);
            a->table.ready = status == BST_OK;
        }
    }
}

/* Stars of a frame that threads place; a bit for each level with which one begins. */
typedef struct stars_to_place {
    bst_smear *s;
    const bst_scene_source *list;
    atomic_uint levels;
} stars_to_place;

/* Places some stars (callback). */
static void place_some(void *user, int begin, int end) {
    const stars_to_place *all = user;
    for (int i = begin; i < end; i++) {
        bst_smear_place place;
        bool lit = bst_smear_place_source(all->s, &all->list[i], &place) && !place.moving;
        all->s->ahead_xy[2 * i] = lit ? place.x : NAN;
        all->s->ahead_xy[2 * i + 1] = lit ? place.y : NAN;
    }
}

/* Finds the levels with which some of the stars begin (callback). */
static void find_levels(void *user, int begin, int end) {
    stars_to_place *all = user;
    bst_smear own = *all->s; /* for last_read_e */
    unsigned levels = 0U;
    for (int i = begin; i < end; i++) {
        double x = own.ahead_xy[2 * i], y = own.ahead_xy[2 * i + 1];
        if (isnan(x)) {
            continue;
        }
        const bst_smear_star_motion_cell *cell =
            own.single ? NULL : bst_motion_map_at(own.map, x, y);
        own.last_read_e = all->list[i].electrons_per_s * own.duration_s *
                          (cell ? cell->read_share : own.read_share);
        levels |= 1U << bst_smear_choose_level(&own, cell ? cell->scale : 1.0);
    }
    atomic_fetch_or(&all->levels, levels);
}

bool bst_smear_has_threads(const bst_smear *s) {
    return s->options.pool && bst_parallel_threads(s->options.pool) > 1;
}

void bst_smear_clear_ahead(bst_smear *s) {
    s->ahead_count = 0;
    s->ahead_cells = false;
    for (int n = 0; n < BST_SMEAR_LEVELS; n++) {
        s->ahead[n].ready = false;
    }
}

void bst_smear_begin_ahead(bst_smear *s, const bst_smear_frame *frame) {
    enum { AT_ONCE = 1024 }; /* some 50 us: waking a thread takes about as long */
    bst_ctx none = {0};
    if (!bst_smear_has_threads(s) || !frame->list ||
        bst_smear_reserve(&none, (void **)&s->ahead_xy, &s->ahead_xy_capacity, frame->sources,
                          2 * sizeof *s->ahead_xy) != BST_OK) {
        return;
    }
    stars_to_place stars = {s, frame->list, 0U};
    bst_parallel_for(s->options.pool, frame->sources, AT_ONCE, place_some, &stars);
    s->ahead_cells =
        s->single || bst_motion_map_fill(s->map, s->options.pool, s->ahead_xy, frame->sources);
    if (s->ahead_cells) {
        bst_parallel_for(s->options.pool, frame->sources, AT_ONCE, find_levels, &stars);
    }
    find_paths(s, frame);
    things_to_make things = {.s = s};
    int levels = 0;
    for (int n = BST_SMEAR_LEVELS - 1; n > 0; n--) {
        if (atomic_load(&stars.levels) >> n & 1U) {
            things.levels[levels++] = n;
        }
    }
    bst_parallel_for(s->options.pool, s->ahead_count + levels, 1, make_some, &things);
}

bst_status bst_smear_take_ahead(bst_ctx *ctx, bst_smear *s, const bst_scene_source *source,
                                bst_smear_level *out, bool *taken) {
    *taken = false;
    for (int k = 0; k < s->ahead_count && !*taken; k++) {
        bst_smear_ahead_path *a = &s->ahead_paths[k];
        if (a->source != source || !a->table.ready || a->aim != s->aim) {
            continue;
        }
        bst_smear_node_list nodes = s->nodes;
        s->nodes = a->own.nodes;
        a->own.nodes = nodes;
        a->table.ready = false;
        s->last_peak_e = a->own.last_peak_e;
        s->last_read_e = a->own.last_read_e;
        s->chord_error = a->own.chord_error;
        BST_TRY(bst_smear_append_ahead(ctx, s, &a->table, out));
        *taken = true;
    }
    return BST_OK;
}

/* Sources that threads compute. */
typedef struct sources_to_plan {
    const bst_smear *s;
    const bst_scene_source *list;
    bst_smear_result *out;
} sources_to_plan;

/* Computes some of them (callback). */
static void plan_some(void *user, int begin, int end) {
    const sources_to_plan *all = user;
    bst_smear own = *all->s;
    own.fixed = true;
    for (int i = begin; i < end; i++) {
        bst_ctx none = {0};
        bst_smear_result *r = &all->out[i];
        r->known = bst_smear_source(&none, &own, &all->list[i], &r->record, &r->visible) == BST_OK;
        r->leaves = own.last_leaves;
        r->peak_e = own.last_peak_e;
        r->read_e = own.last_read_e;
        r->presence = own.last_presence;
        r->gap_px = own.last_gap_px;
        r->widening_px2 = own.last_widening_px2;
        r->error = own.last_error;
    }
}

bst_status bst_smear_sources(bst_ctx *ctx, bst_smear *s, const bst_scene_source *list, int count,
                             bst_smear_result *out) {
    enum { AT_ONCE = 256 };
    if (!s->ahead_cells) {
        for (int i = 0; i < count; i++) {
            out[i].known = false;
        }
        return BST_OK;
    }
    for (int n = 1; n < BST_SMEAR_LEVELS; n++) {
        if (s->ahead[n].ready) {
            BST_TRY(bst_smear_make_level(ctx, s, n));
        }
    }
    sources_to_plan all = {s, list, out};
    bst_parallel_for(s->options.pool, count, AT_ONCE, plan_some, &all);
    return BST_OK;
}

void bst_smear_recall(bst_smear *s, const bst_smear_result *result, bst_kernel_source_record *out,
                      bool *visible) {
    s->last_leaves = result->leaves;
    s->last_peak_e = result->peak_e;
    s->last_read_e = result->read_e;
    s->last_presence = result->presence;
    s->last_gap_px = result->gap_px;
    s->last_widening_px2 = result->widening_px2;
    s->last_error = result->error;
    *visible = result->visible;
    if (result->visible) {
        *out = result->record;
    }
}

void bst_smear_free_ahead(bst_smear *s) {
    for (int n = 0; n < BST_SMEAR_LEVELS; n++) {
        free(s->ahead[n].nodes.items);
        free(s->ahead[n].table);
    }
    for (int k = 0; k < s->ahead_capacity; k++) {
        free_path(&s->ahead_paths[k]);
    }
    free(s->ahead_paths);
    free(s->ahead_xy);
}
