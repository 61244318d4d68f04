/* Nodes of a frame computed ahead of their use, on several threads: what a GPU's host is busy with,
 * while the processor's other cores are idle. The results are those computed when they are used. */
#include <math.h>
#include <stdlib.h>

#include "scenegen/reference.h"
#include "scenegen/smear/smear_internal.h"

struct bst_smear_ahead_path {
    const bst_scene_source *source;
    bst_smear_place place;
    bst_smear own; /* work space and last_... values of this source; the rest is the frame's */
    double aim;
    bool ready;
};

/* Most moving sources computed ahead: a path's work space takes up to a megabyte. */
enum { MOST_PATHS = 64 };

/* Brightest pixel of the frame's brightest star by its path's extent: a line of light as long as the
 * box of the path. Twice that, as light is not evenly spread. */
static double brightest_e(const bst_smear *s, double e_per_s) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < s->path_count; k++) {
        for (int i = 0; i < 2; i++) {
            low[i] = fmin(low[i], s->path[k].p[i]);
            high[i] = fmax(high[i], s->path[k].p[i]);
        }
    }
    double length = hypot(high[0] - low[0], high[1] - low[1]);
    double line = bst_reference_pixel_share(0.0, s->share_sigma_px, 0);
    double still = e_per_s * s->duration_s * line * line * s->binning * s->binning;
    /* a Gaussian has the height of a line of sqrt(2 pi) sigma with its light */
    return still * fmin(1.0, 2.0 / (1.0 + length / (2.5066 * s->share_sigma_px)));
}

/* Frees the work space of a path. */
static void free_path(bst_smear_ahead_path *a) {
    free(a->own.nodes.items);
    free(a->own.points.items);
    free(a->own.own_path);
}

/* Copies the frame into a path's own smear, whose work space stays. */
static void lend_frame(const bst_smear *s, bst_smear *own) {
    bst_smear copy = *s;
    copy.nodes = own->nodes;
    copy.points = own->points;
    copy.own_path = own->own_path;
    copy.own_capacity = own->own_capacity;
    copy.last_peak_e = copy.last_read_e = copy.chord_error = 0.0;
    *own = copy;
}

/* Finds the frame's moving sources. Too little memory: fewer of them. */
static void find_paths(bst_smear *s, const bst_smear_frame *frame) {
    bst_ctx none = {0};
    s->ahead_count = 0;
    for (int i = 0; i < frame->sources && s->ahead_count < MOST_PATHS; i++) {
        const bst_scene_source *source = &frame->list[i];
        bst_smear_place place;
        if (!(source->path || source->rate || source->shape) ||
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
        a->ready = false;
        lend_frame(s, &a->own);
        a->own.disc_px = place.disc_px;
    }
}

/* Computes moving sources, then levels (callback). Those that fail are computed again when they are
 * used, and fail there. */
static void make_some(void *user, int begin, int end) {
    bst_smear *s = user;
    for (int k = begin; k < end; k++) {
        bst_ctx own = {0};
        if (k < s->ahead_count) {
            bst_smear_ahead_path *a = &s->ahead_paths[k];
            a->ready = bst_smear_moving_nodes(&own, &a->own, a->source, a->place.electrons,
                                              a->place.x, a->place.y) == BST_OK;
        } else {
            int n = k - s->ahead_count;
            s->ahead[n].ready = bst_smear_make_ahead(&own, s, n, &s->ahead[n]) == BST_OK;
        }
    }
}

void bst_smear_begin_ahead(bst_smear *s, const bst_smear_frame *frame) {
    s->ahead_count = 0;
    for (int n = 0; n < BST_SMEAR_LEVELS; n++) {
        s->ahead[n].ready = false;
    }
    if (!s->options.pool || !frame->list || bst_parallel_threads(s->options.pool) < 2) {
        return;
    }
    find_paths(s, frame);
    s->last_read_e = brightest_e(s, frame->brightest_e_per_s);
    int levels = bst_smear_choose_level(s, 1.0) + 2;
    levels = levels < BST_SMEAR_LEVELS ? levels : BST_SMEAR_LEVELS;
    bst_parallel_for(s->options.pool, s->ahead_count + levels, 1, make_some, s);
}

/* Stars of a frame whose positions threads compute. */
typedef struct stars_to_place {
    bst_smear *s;
    const bst_scene_source *list;
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

void bst_smear_fill_map(bst_smear *s, const bst_smear_frame *frame) {
    enum { AT_ONCE = 1024 };
    bst_ctx none = {0};
    if (!s->options.pool || !frame->list ||
        bst_smear_reserve(&none, (void **)&s->ahead_xy, &s->ahead_xy_capacity, frame->sources,
                          2 * sizeof *s->ahead_xy) != BST_OK) {
        return;
    }
    stars_to_place all = {s, frame->list};
    bst_parallel_for(s->options.pool, frame->sources, AT_ONCE, place_some, &all);
    bst_motion_map_fill(s->map, s->options.pool, s->ahead_xy, frame->sources);
}

bool bst_smear_take_ahead(bst_smear *s, const bst_scene_source *source) {
    for (int k = 0; k < s->ahead_count; k++) {
        bst_smear_ahead_path *a = &s->ahead_paths[k];
        if (a->source == source && a->ready && a->aim == s->aim) {
            bst_smear_node_list nodes = s->nodes;
            s->nodes = a->own.nodes;
            a->own.nodes = nodes;
            a->ready = false;
            s->last_peak_e = a->own.last_peak_e;
            s->last_read_e = a->own.last_read_e;
            s->chord_error = a->own.chord_error;
            return true;
        }
    }
    return false;
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
