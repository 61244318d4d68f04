#include "sim/world/scene/star_occultation.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/satellite/shape_silhouette.h"

enum { TIMES = BST_STAR_OCCULTATION_TIMES };

/* Accuracy of a contact, as a fraction of the exposure. */
#define CONTACT 1e-6

_Static_assert(2 * (int)TIMES + 2 <= (int)BST_RATE_KNOTS,
               "each pair of neighbouring times may have a contact of two knots");

void bst_star_occultation_free(bst_star_occultation *w) {
    for (int i = 0; i < w->rate_capacity; i++) {
        free(w->rates[i]);
    }
    free(w->rates);
    free(w->stars);
    free(w->hidden);
    bst_satellite_pose_free(w->pose);
    *w = (bst_star_occultation){0};
}

/* Angular radius of the sphere about a body, rad; pi from inside. */
static double radius_of(const bst_scene_source *body, double range_m) {
    double radius_m = body->body->satellite->radius_m;
    return radius_m < range_m ? asin(radius_m / range_m) : BST_PI;
}

/* Number of times at which a body is compared with the stars: some 32 while it moves by its radius
 * or turns by a radian. */
static int times_of(const bst_scene_source *source) {
    const bst_scene_source_body *b = source->body;
    bst_vec3 ends[2] = {bst_scene_source_direction(source, 0.0),
                        bst_scene_source_direction(source, 1.0)};
    double moved = bst_vec3_angle(ends[0], ends[1]) / radius_of(source, source->range_m);
    for (int k = 1; k < b->times; k++) {
        bst_quat turn =
            bst_quat_mul(b->q_body_from_gcrf[k], bst_quat_conj(b->q_body_from_gcrf[k - 1]));
        moved += bst_vec3_norm(bst_quat_to_rotvec(turn));
    }
    return (int)fmin(17.0 + 32.0 * moved, TIMES);
}

/* A body at one time. */
typedef struct placed_body {
    bst_satellite_pose *pose;
    bst_quat q_body_from_gcrf;
    bst_vec3 apparent; /* unit */
    bst_vec3 eye_m;    /* observer, body frame */
    double cosine;     /* of the angular radius */
} placed_body;

static bst_status place(bst_ctx *ctx, bst_star_occultation *w, const bst_scene_source *source,
                        double u, placed_body *out) {
    const bst_satellite *satellite = source->body->satellite;
    bst_source_body_state state;
    if (!w->pose || w->pose->satellite != satellite) {
        bst_satellite_pose_free(w->pose);
        w->pose = NULL;
        BST_TRY(bst_satellite_pose_create(ctx, satellite, &w->pose));
    }
    bst_source_body_at(source, u, &state, NULL);
    bst_source_body_set_pose(source, &state, w->pose);
    *out = (placed_body){.pose = w->pose,
                         .q_body_from_gcrf = state.q_body_from_gcrf,
                         .apparent = state.apparent,
                         .eye_m = bst_quat_rotate(state.q_body_from_gcrf,
                                                  bst_vec3_scale(state.apparent, -state.range_m)),
                         .cosine = cos(radius_of(source, state.range_m))};
    return BST_OK;
}

static bool hides(const placed_body *b, const bst_scene_source *star) {
    bst_vec3 direction = star->apparent_mid;
    return bst_vec3_dot(b->apparent, direction) >= b->cosine &&
           bst_shape_silhouette_meets(b->pose, b->eye_m,
                                      bst_quat_rotate(b->q_body_from_gcrf, direction));
}

/* True if a body may hide a star at some time. */
static bool may_hide(const bst_scene_source *body, const bst_scene_source *star) {
    enum { PIECES = 8 };
    bst_vec3 before = bst_scene_source_direction(body, 0.0);
    for (int k = 1; k <= PIECES; k++) {
        double u = (double)k / PIECES;
        bst_vec3 at = bst_scene_source_direction(body, u);
        double range_m =
            body->path ? fmin(bst_vec3_norm(bst_scene_source_place(body->path, u)), body->range_m)
                       : body->range_m;
        /* the path between bends by less than its length */
        double reach = radius_of(body, range_m) + 1.25 * bst_vec3_angle(before, at);
        if (bst_vec3_angle(at, star->apparent_mid) <= 1.1 * reach) {
            return true;
        }
        before = at;
    }
    return false;
}

static bst_status hidden_at(bst_ctx *ctx, bst_star_occultation *w, const bst_scene_source *sources,
                            int count, const bst_scene_source *star, double u, bool *hidden) {
    *hidden = false;
    for (int i = 0; i < count && !*hidden; i++) {
        placed_body b;
        if (sources[i].body && may_hide(&sources[i], star)) {
            BST_TRY(place(ctx, w, &sources[i], u, &b));
            *hidden = hides(&b, star);
        }
    }
    return BST_OK;
}

/* Finds the time between two at which a star appears or vanishes. */
static bst_status find_contact(bst_ctx *ctx, bst_star_occultation *w,
                               const bst_scene_source *sources, int count,
                               const bst_scene_source *star, double from, double to, bool before,
                               double *contact) {
    while (to - from > CONTACT) {
        bool hidden;
        double middle = 0.5 * (from + to);
        BST_TRY(hidden_at(ctx, w, sources, count, star, middle, &hidden));
        *(hidden == before ? &from : &to) = middle;
    }
    *contact = 0.5 * (from + to);
    return BST_OK;
}

/* Room for another light curve. */
static bst_status next_rate(bst_ctx *ctx, bst_star_occultation *w, bst_scene_source_rate **out) {
    if (w->rate_count == w->rate_capacity) {
        int capacity = 2 * w->rate_capacity + 8;
        bst_scene_source_rate **more = realloc(w->rates, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d occulted stars", capacity);
        }
        memset(more + w->rate_capacity, 0, (size_t)(capacity - w->rate_capacity) * sizeof *more);
        w->rates = more;
        w->rate_capacity = capacity;
    }
    bst_scene_source_rate **slot = &w->rates[w->rate_count];
    if (!*slot && !(*slot = malloc(sizeof **slot))) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an occulted star");
    }
    w->rate_count++;
    *out = *slot;
    return BST_OK;
}

static void add_knot(bst_scene_source_rate *r, double u, double rate) {
    int k = r->count++;
    assert(k < BST_RATE_KNOTS);
    r->u[k] = k > 0 ? fmax(u, r->u[k - 1]) : u;
    r->rate[k] = rate;
    r->light[k] =
        k > 0 ? r->light[k - 1] + 0.5 * (rate + r->rate[k - 1]) * (r->u[k] - r->u[k - 1]) : 0.0;
}

/* Makes the light curve of a star that is hidden at some of the times. */
static bst_status make_rate(bst_ctx *ctx, bst_star_occultation *w, bst_scene_source *sources,
                            int count, bst_scene_source *star, const unsigned char *hidden,
                            int times) {
    bst_scene_source_rate *r = NULL;
    BST_TRY(next_rate(ctx, w, &r));
    r->count = 0;
    r->error = 0.0;
    add_knot(r, 0.0, hidden[0] ? 0.0 : 1.0);
    for (int k = 1; k < times; k++) {
        if (hidden[k] != hidden[k - 1]) {
            double u, step = 1.0 / (times - 1);
            BST_TRY(find_contact(ctx, w, sources, count, star, (k - 1) * step, k * step,
                                 hidden[k - 1], &u));
            add_knot(r, u - 0.5 * CONTACT, hidden[k - 1] ? 0.0 : 1.0);
            add_knot(r, u + 0.5 * CONTACT, hidden[k] ? 0.0 : 1.0);
        }
    }
    add_knot(r, 1.0, hidden[times - 1] ? 0.0 : 1.0);
    double mean = r->light[r->count - 1];
    if (!(mean > CONTACT)) {
        w->rate_count--;
        star->occulted = true;
        star->electrons_per_s = 0.0;
        return BST_OK;
    }
    for (int k = 0; k < r->count; k++) {
        r->rate[k] /= mean;
        r->light[k] /= mean;
    }
    star->rate = r;
    star->electrons_per_s *= mean;
    return BST_OK;
}

static bool is_lit_star(const bst_scene_source *s) {
    return s->kind == BST_SOURCE_STAR && !s->occulted && s->electrons_per_s > 0.0;
}

/* Lists the stars that bodies may hide, with the number of times to compare. */
static bst_status list_candidates(bst_ctx *ctx, bst_star_occultation *w,
                                  const bst_scene_source *sources, int count, int *found,
                                  int *times) {
    *found = *times = 0;
    for (int b = 0; b < count; b++) {
        *times = sources[b].body ? (int)fmax(times_of(&sources[b]), *times) : *times;
    }
    for (int i = 0; i<count && * times> 0; i++) {
        bool near = false;
        for (int b = 0; b < count && is_lit_star(&sources[i]) && !near; b++) {
            near = sources[b].body && may_hide(&sources[b], &sources[i]);
        }
        if (!near) {
            continue;
        }
        if (*found == w->star_capacity) {
            int capacity = 2 * w->star_capacity + 64;
            int *stars = realloc(w->stars, (size_t)capacity * sizeof *stars);
            w->stars = stars ? stars : w->stars;
            unsigned char *hidden = realloc(w->hidden, (size_t)capacity * TIMES);
            w->hidden = hidden ? hidden : w->hidden;
            if (!stars || !hidden) {
                return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d occulted stars", capacity);
            }
            w->star_capacity = capacity;
        }
        w->stars[(*found)++] = i;
    }
    return BST_OK;
}

bst_status bst_star_occultation_apply(bst_ctx *ctx, bst_star_occultation *w,
                                      bst_scene_source *sources, int count) {
    int found, times;
    assert(w && (count == 0 || sources));
    w->rate_count = 0;
    BST_TRY(list_candidates(ctx, w, sources, count, &found, &times));
    if (found == 0) {
        return BST_OK;
    }
    memset(w->hidden, 0, (size_t)found * TIMES);
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < times && sources[i].body; k++) {
            placed_body b;
            BST_TRY(place(ctx, w, &sources[i], (double)k / (times - 1), &b));
            for (int s = 0; s < found; s++) {
                w->hidden[s * TIMES + k] |= hides(&b, &sources[w->stars[s]]);
            }
        }
    }
    for (int s = 0; s < found; s++) {
        const unsigned char *hidden = &w->hidden[s * TIMES];
        if (memchr(hidden, 1, (size_t)times)) {
            BST_TRY(make_rate(ctx, w, sources, count, &sources[w->stars[s]], hidden, times));
        }
    }
    return BST_OK;
}
