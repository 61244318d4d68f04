#include "sim/run/run_arcs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/sky_clock.h"
#include "sim/onboard/knowledge.h"
#include "sim/run/run_directions.h"
#include "sim/run/run_used_tracks.h"
#include "sim/world/world_config.h"
#include "tracker/orbit/orbit_photocentre.h"

/* tracks of a sensor at one time; more are left out */
enum { SLOTS = 64 };
/* detections of an arc: with fewer its rate is that of the initiation */
enum { LEAST_HITS = 5 };
/* The first directions of a long arc are left out: the first frames of a track often end a slew,
 * and of one in twelve of these the attitude is wrong by more than 4 sigma. */
enum { FIRST_OUT = 2, LONG_ARC = 8 };
/* Share of the attitude's variance that successive frames have in common at least: the camera's own
 * motion displaces their stars alike. Measured on a day of day_constellation: 3.7 % of frames 2 s
 * apart, 2.4 % of 10 s, 1.2 % of 16 s. */
static const double LEAST_SHARED = 0.03;
/* directions beside one that show how its path bends are within this time, s */
#define MOST_APART_S 120.0
/* directions of a track: more than any run has, and no overflow */
static const int64_t MOST_SEEN = INT64_C(1) << 53;

/* A track that has not ended. */
typedef struct slot {
    bst_run_arc arc; /* id 0: free; hits 0: not confirmed yet */
    int64_t tick;    /* of the newest state with a detection */
    int64_t seen;    /* directions that were measured */
    int64_t every;   /* one in so many of them is kept */
    double shared;   /* fraction of the attitude's variance that successive frames share */
    bst_quat attitude[BST_CUSTODY_DIRECTIONS];
    double exposure_s[BST_CUSTODY_DIRECTIONS];
} slot;

typedef struct sensor {
    int observer;
    bst_knowledge *knowledge;
    bst_run_centroids recent;
    bst_run_used_tracks used;
    slot slots[SLOTS];
} sensor;

struct bst_run_arcs {
    const bst_world *world;
    bst_world_view *view;
    bst_sky_clock *clock;
    double tick_rate_hz;
    int count;
    sensor *sensors;
};

static bst_status create_sensors(bst_ctx *ctx, bst_run_arcs *a) {
    const int observers = bst_world_observer_count(a->world);
    for (int i = 0; i < observers; i++) {
        a->count += bst_world_sensor_count(a->world, i);
    }
    a->sensors = calloc((size_t)a->count + 1, sizeof *a->sensors);
    if (!a->sensors) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the arcs of %d sensors", a->count);
    }
    for (int i = 0, k = 0; i < observers; i++) {
        for (int s = 0; s < bst_world_sensor_count(a->world, i); s++, k++) {
            a->sensors[k].observer = i;
            BST_TRY(bst_knowledge_create(ctx, a->world, i, s, &a->sensors[k].knowledge));
        }
    }
    return BST_OK;
}

bst_status bst_run_arcs_create(bst_ctx *ctx, const bst_world *world, double tick_rate_hz,
                               bst_run_arcs **out) {
    *out = NULL;
    bst_run_arcs *a = calloc(1, sizeof *a);
    if (!a) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for arcs of tracks");
    }
    a->world = world;
    a->tick_rate_hz = tick_rate_hz;
    bst_status status = create_sensors(ctx, a);
    status = status == BST_OK ? bst_world_view_create(ctx, world, &a->view) : status;
    status = status == BST_OK
                 ? bst_sky_clock_create(ctx, bst_world_earth_orientation(world), &a->clock)
                 : status;
    if (status != BST_OK) {
        bst_run_arcs_free(a);
        return status;
    }
    *out = a;
    return BST_OK;
}

void bst_run_arcs_free(bst_run_arcs *a) {
    if (a) {
        for (int i = 0; a->sensors && i < a->count; i++) {
            bst_knowledge_free(a->sensors[i].knowledge);
            bst_run_centroids_clear(&a->sensors[i].recent);
            bst_run_used_tracks_clear(&a->sensors[i].used);
        }
        free(a->sensors);
        bst_world_view_free(a->view);
        bst_sky_clock_free(a->clock);
        free(a);
    }
}

/* Archives the id of a slot, and the rest unless it is free. */
static bst_status archive_slot(const bst_run_arcs *a, slot *s, bst_archive *archive) {
    BST_ARCHIVE(archive, s->arc.id);
    if (s->arc.id == 0) {
        return BST_OK;
    }
    BST_ARCHIVE(archive, *s);
    s->arc.count = bst_archive_count(archive, s->arc.count, BST_CUSTODY_DIRECTIONS);
    s->seen = bst_archive_integer(archive, s->seen, 0, MOST_SEEN);
    s->every = bst_archive_integer(archive, s->every, 1, MOST_SEEN);
    s->tick =
        bst_archive_integer(archive, s->tick, 0, (int64_t)(BST_OD_LONGEST_S * a->tick_rate_hz));
    for (int i = 0; i < s->arc.count; i++) {
        const double time_s = s->arc.directions[i].observer.time_s;
        if (!(time_s >= 0.0 && time_s <= BST_OD_LONGEST_S)) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state has a direction at %g s (allowed: 0 to %g)", time_s,
                            BST_OD_LONGEST_S);
        }
    }
    return BST_OK;
}

bst_status bst_run_arcs_archive(bst_run_arcs *a, bst_archive *archive) {
    for (int i = 0; i < a->count; i++) {
        for (int k = 0; k < SLOTS; k++) {
            BST_TRY(archive_slot(a, &a->sensors[i].slots[k], archive));
        }
        BST_TRY(bst_run_centroids_archive(&a->sensors[i].recent, archive));
        BST_TRY(bst_run_used_tracks_archive(&a->sensors[i].used, archive));
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ Frames */

/* A spacecraft at a tick, with the orientation of TEME and the light that comes to it. */
typedef struct eye {
    bst_od_observer observer;
    bst_mat3 gcrf_from_teme;
    bst_light light;
    bst_vec3 sun; /* unit, from the Earth: that of an object differs by its parallax */
} eye;

static bst_status eye_at(bst_ctx *ctx, bst_run_arcs *a, const sensor *s, int64_t tick, eye *out) {
    const double time_s = (double)tick / a->tick_rate_hz;
    bst_world_state at;
    bst_sky_rotation sky;
    BST_TRY(bst_world_view_observer_state(ctx, a->view, s->observer, time_s, &at));
    BST_TRY(bst_sky_clock_at(ctx, a->clock, bst_world_time(a->world, time_s), &sky));
    *out = (eye){.observer = {.time_s = time_s,
                              .position_m = at.position_m,
                              .velocity_mps = at.velocity_mps,
                              .earth_bary_mps = sky.bodies.earth_bary_mps},
                 .gcrf_from_teme = sky.frames.gcrf_from_teme,
                 .light = bst_light_at(&sky.bodies, at.position_m, at.velocity_mps),
                 .sun = bst_vec3_unit(sky.bodies.sun_m)};
    return BST_OK;
}

bst_status bst_run_arcs_detections(bst_ctx *ctx, bst_run_arcs *a, int index,
                                   const bst_detections *detections) {
    return bst_run_centroids_add(ctx, &a->sensors[index].recent, detections);
}

/* Adds the direction in which a track was measured in this frame. */
static bst_status add_direction(bst_ctx *ctx, bst_run_arcs *a, const sensor *s,
                                const bst_tracks *from, const bst_track *t, slot *own) {
    bst_run_arc *arc = &own->arc;
    const bst_run_centroid *centroid =
        bst_run_centroids_find(&s->recent, from->exposure_id, t->x_px, t->y_px);
    if (!centroid || own->seen++ % own->every != 0) {
        return BST_OK;
    }
    if (arc->count == BST_CUSTODY_DIRECTIONS) {
        own->every *= 2;
        arc->count /= 2;
        for (int i = 1; i < arc->count; i++) {
            arc->directions[i] = arc->directions[2 * i];
            own->attitude[i] = own->attitude[2 * i];
            own->exposure_s[i] = own->exposure_s[2 * i];
        }
    }
    eye at;
    bst_od_observation *z = &arc->directions[arc->count];
    BST_TRY(eye_at(ctx, a, s, from->tick, &at));
    *z = (bst_od_observation){.observer = at.observer};
    bst_run_measure_direction(bst_knowledge_camera(s->knowledge), t->x_px, t->y_px,
                              centroid->cov_px2, &from->attitude, &at.light, z);
    z->photocentre_factor = bst_od_photocentre_factor_seen(at.sun, z->direction);
    own->exposure_s[arc->count] = centroid->exposure_ticks / a->tick_rate_hz;
    own->attitude[arc->count++] = from->attitude.q_cam_from_gcrf;
    own->shared = from->attitude.shared;
    return BST_OK;
}

/* The slot of a track; a free one; for a confirmed track one that is not confirmed. NULL: none. */
static slot *slot_of(sensor *s, const bst_track *t) {
    slot *out = NULL;
    for (int k = 0; k < SLOTS; k++) {
        slot *own = &s->slots[k];
        if (own->arc.id == t->id) {
            return own;
        }
        bool possible =
            own->arc.id == 0 || (t->status == BST_TRACK_CONFIRMED && own->arc.hits == 0);
        if (possible && (!out || (own->arc.id == 0 && out->arc.id != 0))) {
            out = own;
        }
    }
    return out;
}

/* Takes a track that was detected in this frame. */
static bst_status take_track(bst_ctx *ctx, bst_run_arcs *a, sensor *s, const bst_tracks *from,
                             const bst_track *t) {
    slot *own = bst_run_used_tracks_has(&s->used, t->id) ? NULL : slot_of(s, t);
    if (!own) {
        return BST_OK;
    }
    if (own->arc.id != t->id) {
        *own = (slot){.arc.id = t->id, .every = 1};
    }
    BST_TRY(add_direction(ctx, a, s, from, t, own));
    if (t->status == BST_TRACK_CONFIRMED) {
        own->tick = from->tick;
        own->arc.hits = t->hits;
        own->arc.state.direction = t->direction_gcrf;
        own->arc.state.rate_radps = t->rate_gcrf_radps;
        memcpy(own->arc.state.covariance, t->covariance, sizeof own->arc.state.covariance);
    }
    return BST_OK;
}

static void leave_first_out(slot *own) {
    bst_run_arc *arc = &own->arc;
    if (arc->count >= LONG_ARC) {
        arc->count -= FIRST_OUT;
        memmove(arc->directions, arc->directions + FIRST_OUT,
                (size_t)arc->count * sizeof *arc->directions);
        memmove(own->attitude, own->attitude + FIRST_OUT,
                (size_t)arc->count * sizeof *own->attitude);
        memmove(own->exposure_s, own->exposure_s + FIRST_OUT,
                (size_t)arc->count * sizeof *own->exposure_s);
    }
}

/* Second derivative of an arc's directions at one of them, 1/s^2, by a parabola. 0: too few or too
 * far apart. */
static bst_vec3 acceleration_of(const bst_od_observation *z, int count, int at) {
    if (count < 3) {
        return (bst_vec3){0, 0, 0};
    }
    const int i = at < 1 ? 1 : at > count - 2 ? count - 2 : at;
    const double before = z[i].observer.time_s - z[i - 1].observer.time_s,
                 after = z[i + 1].observer.time_s - z[i].observer.time_s;
    if (!(before > 0.0 && after > 0.0 && before + after < MOST_APART_S)) {
        return (bst_vec3){0, 0, 0};
    }
    const bst_vec3 rise =
        bst_vec3_scale(bst_vec3_sub(z[i + 1].direction, z[i].direction), 1.0 / after);
    const bst_vec3 rose =
        bst_vec3_scale(bst_vec3_sub(z[i].direction, z[i - 1].direction), 1.0 / before);
    return bst_vec3_scale(bst_vec3_sub(rise, rose), 2.0 / (before + after));
}

/* Takes directions from the mean of the exposure to its middle: a near object's path bends by half
 * a metre. */
static void take_to_middle(slot *own) {
    bst_od_observation *z = own->arc.directions;
    bst_vec3 middle[BST_CUSTODY_DIRECTIONS];
    for (int i = 0; i < own->arc.count; i++) {
        const double t = own->exposure_s[i];
        middle[i] = bst_vec3_unit(
            bst_vec3_axpy(z[i].direction, -t * t / 24.0, acceleration_of(z, own->arc.count, i)));
    }
    for (int i = 0; i < own->arc.count; i++) {
        z[i].direction = middle[i];
    }
}

/* Ends a track: gives its arc if it was confirmed, and frees its slot. */
static bst_status end_track(bst_ctx *ctx, bst_run_arcs *a, int index, slot *own,
                            bst_run_arc_fn take, void *user) {
    sensor *s = &a->sensors[index];
    bst_run_arc *arc = &own->arc;
    eye at;
    const int64_t id = arc->id;
    if (arc->hits < LEAST_HITS) {
        arc->id = 0;
        return BST_OK;
    }
    leave_first_out(own);
    take_to_middle(own);
    BST_TRY(eye_at(ctx, a, s, own->tick, &at));
    arc->state.observer = at.observer;
    arc->state.gcrf_from_teme = at.gcrf_from_teme;
    arc->state.photocentre_factor = bst_od_photocentre_factor_seen(at.sun, arc->state.direction);
    for (int i = 0; i < 2 && arc->count > 0; i++) {
        const bst_od_observation *z = &arc->directions[i * (arc->count - 1)];
        bst_sky_rotation sky;
        BST_TRY(
            bst_sky_clock_at(ctx, a->clock, bst_world_time(a->world, z->observer.time_s), &sky));
        arc->gcrf_from_teme[i] = sky.frames.gcrf_from_teme;
    }
    for (int i = 0; i < arc->count; i++) {
        bst_od_observation *z = &arc->directions[i];
        for (int k = 0; k < 4; k++) {
            z->shared_rad[k / 2][k % 2] *= sqrt(fmax(own->shared, LEAST_SHARED));
        }
        if (i > 0) {
            z->shared_change = bst_run_change_of_stars(bst_knowledge_camera(s->knowledge),
                                                       own->attitude[i - 1], own->attitude[i]);
        }
    }
    bst_status status = take(user, ctx, index, arc);
    arc->id = 0;
    return status == BST_OK ? bst_run_used_tracks_add(ctx, &s->used, id) : status;
}

/* Whether the tracker lists a track. */
static bool is_listed(const bst_tracks *tracks, int64_t id) {
    for (int i = 0; i < tracks->count; i++) {
        if (tracks->items[i].id == id) {
            return true;
        }
    }
    return false;
}

bst_status bst_run_arcs_tracks(bst_ctx *ctx, bst_run_arcs *a, int index, const bst_tracks *tracks,
                               bst_run_arc_fn take, void *user) {
    sensor *s = &a->sensors[index];
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        if (tracks->attitude.valid && t->misses_in_row == 0 && t->hidden == BST_HIDDEN_NOT) {
            BST_TRY(take_track(ctx, a, s, tracks, t));
        }
    }
    for (int k = 0; k < SLOTS; k++) {
        if (s->slots[k].arc.id != 0 && !is_listed(tracks, s->slots[k].arc.id)) {
            BST_TRY(end_track(ctx, a, index, &s->slots[k], take, user));
        }
    }
    return BST_OK;
}

bst_status bst_run_arcs_finish(bst_ctx *ctx, bst_run_arcs *a, bst_run_arc_fn take, void *user) {
    for (int i = 0; i < a->count; i++) {
        for (int k = 0; k < SLOTS; k++) {
            if (a->sensors[i].slots[k].arc.id != 0) {
                BST_TRY(end_track(ctx, a, i, &a->sensors[i].slots[k], take, user));
            }
        }
    }
    return BST_OK;
}
