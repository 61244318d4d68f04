#include "sim/run/run_custody.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/eval/consistency.h"
#include "sim/run/run_arcs.h"
#include "sim/run/run_candidates.h"
#include "sim/run/run_custody_reach.h"
#include "sim/run/run_custody_tables.h"
#include "sim/run/run_new_objects.h"
#include "tracker/orbit/custody.h"
#include "tracker/orbit/orbit_photocentre.h"

/* directions that an update needs: with fewer the tracker's state is better */
enum { LEAST_DIRECTIONS = 3 };
/* numbers that tell an element set from another */
enum { IDENTITY = 10 };
/* chi-square of an innovation, 4 degrees of freedom: beyond it are 2e-5 of the true ones */
#define GATE 27.0
/* A second object in the gate makes a track ambiguous unless it is e^7 times less likely. */
#define LIKELIHOOD_MARGIN 14.0
/* time for which the bounds of bst_run_reach_of hold, s */
#define REACH_FOR_S 3600.0
/* The light of an object may be in an image within one FWHM and so many standard deviations of its
 * predicted direction, but two FWHM at most: farther apart two images are resolved. */
#define BLEND_SIGMAS 2.0
/* a track belongs to the object within this distance of it, as in sightings.c */
#define TRACK_PX 5.0
/* an object nearer than this is the observer's spacecraft itself, m */
#define ITSELF_M 10.0

struct bst_run_custody {
    const bst_world *world;
    bst_world_view *view;
    bst_custody_config config;
    double within_m;
    int object_count, sensor_count;
    double *pixel_rad;         /* [sensor] */
    double *fwhm_rad;          /* [sensor] of the PSF */
    bst_custody_orbit *orbits; /* [object]; a_m 0: none */
    bst_custody_filter *filters;
    bst_custody_score *scores;
    double *place_m[3]; /* [object] */
    /* [object] bound of the distance from a line of sight, m, from an hour before until
     * reach_until_s: few filters are looked at */
    double *reach_m, reach_until_s;
    bst_run_arcs *arcs;
    bst_run_candidates *candidates;
    bst_run_new_objects new_objects;
    bst_io_table *tracks, *objects;
    bst_custody_figures figures;
};

/* ---- making it ---- */

static bst_status allocate(bst_ctx *ctx, bst_run_custody *c) {
    size_t n = (size_t)c->object_count + 1, sensors = (size_t)c->sensor_count + 1;
    c->pixel_rad = calloc(2 * sensors, sizeof *c->pixel_rad);
    c->orbits = calloc(n, sizeof *c->orbits);
    c->filters = calloc(n, sizeof *c->filters);
    c->scores = calloc(n, sizeof *c->scores);
    c->place_m[0] = calloc(4 * n, sizeof *c->place_m[0]);
    if (!c->pixel_rad || !c->orbits || !c->filters || !c->scores || !c->place_m[0]) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the custody of %d objects",
                        c->object_count);
    }
    c->fwhm_rad = c->pixel_rad + sensors;
    c->place_m[1] = c->place_m[0] + n;
    c->place_m[2] = c->place_m[1] + n;
    c->reach_m = c->place_m[2] + n;
    c->reach_until_s = -INFINITY;
    return BST_OK;
}

/* number of the draw that decides whether an object is unknown; the first ones are its errors */
enum { UNKNOWN_DRAW = 1000 };

/* Starts the filter of each object on an element set, with an error drawn from its covariance: by
 * catalogue number, or by name where that is 0, so that other objects do not change it. */
static bst_status start_filters(bst_ctx *ctx, bst_run_custody *c, const bst_scenario *scenario) {
    const uint64_t seed = scenario->seed, run = (uint64_t)scenario->run;
    const bst_rng_key by_number = bst_rng_make_key(seed, run, "custody", "catalogue");
    for (int i = 0; i < c->object_count; i++) {
        double offset_s, normals[BST_CUSTODY_STATE];
        const bst_elements *elements = bst_world_elements(c->world, i, &offset_s);
        c->scores[i].last_s = NAN;
        if (!elements) {
            continue;
        }
        const bst_world_object_info *info = bst_world_object(c->world, i);
        const bst_rng_key key =
            info->norad > 0 ? by_number : bst_rng_make_key(seed, run, "custody", info->name);
        if (bst_rng_uniform(key, (uint64_t)info->norad, UNKNOWN_DRAW) <
            scenario->record.custody_unknown_share) {
            c->figures.unknown++;
            continue;
        }
        double photocentre_m = bst_od_photocentre_of_area(info->area_m2);
        bst_status status =
            bst_custody_orbit_init(ctx, elements, offset_s, photocentre_m, &c->orbits[i]);
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "/record/custody");
        }
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            normals[k] = bst_rng_normal(key, (uint64_t)info->norad, (uint64_t)k);
        }
        bst_custody_filter_init(&c->config, &c->orbits[i], normals, &c->filters[i]);
        c->figures.objects++;
    }
    return c->figures.objects > 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_CONFIG,
                          "/record/custody: no object of the world moves on an element set without "
                          "burns; list some in /world/objects or /world/catalogues, or set it to "
                          "false");
}

bst_status bst_run_custody_create(bst_ctx *ctx, const bst_world *world,
                                  const bst_scenario *scenario, bst_run *store,
                                  bst_run_custody **out) {
    const bst_recorder_config *record = &scenario->record;
    *out = NULL;
    if (!record->custody) {
        return BST_OK;
    }
    bst_run_custody *c = calloc(1, sizeof *c);
    if (!c) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the custody of the catalogue");
    }
    c->world = world;
    c->within_m = record->custody_within_m;
    c->config = (bst_custody_config){record->custody_sigma_m, record->custody_drift_m_per_day,
                                     record->custody_noise_m_per_day};
    c->object_count = bst_world_object_count(world);
    for (int i = 0; i < bst_world_observer_count(world); i++) {
        c->sensor_count += bst_world_sensor_count(world, i);
    }
    bst_status status = allocate(ctx, c);
    for (int i = 0, k = 0; status == BST_OK && i < bst_world_observer_count(world); i++) {
        for (int s = 0; s < bst_world_sensor_count(world, i); s++, k++) {
            const bst_camera *camera = bst_world_camera(world, i, s);
            c->pixel_rad[k] = bst_camera_scale_rad(camera);
            c->fwhm_rad[k] = BST_FWHM_PER_SIGMA * bst_camera_psf_sigma_px(camera) * c->pixel_rad[k];
        }
    }
    status = status == BST_OK ? start_filters(ctx, c, scenario) : status;
    status = status == BST_OK ? bst_world_view_create(ctx, world, &c->view) : status;
    status = status == BST_OK
                 ? bst_run_arcs_create(ctx, world, (double)scenario->tick_rate_hz, &c->arcs)
                 : status;
    status =
        status == BST_OK ? bst_run_candidates_create(ctx, world, store, &c->candidates) : status;
    status = status == BST_OK && store
                 ? bst_run_custody_tables_create(ctx, store, &c->tracks, &c->objects)
                 : status;
    if (status != BST_OK) {
        bst_run_custody_free(c);
        return status;
    }
    *out = c;
    return BST_OK;
}

void bst_run_custody_free(bst_run_custody *c) {
    if (c) {
        bst_world_view_free(c->view);
        bst_run_arcs_free(c->arcs);
        bst_run_candidates_free(c->candidates);
        bst_run_new_objects_clear(&c->new_objects);
        free(c->pixel_rad);
        free(c->orbits);
        free(c->filters);
        free(c->scores);
        free(c->place_m[0]);
        free(c);
    }
}

/* Numbers of an object's element set; 0: it has no filter. */
static void identity_of(const bst_custody_orbit *o, double out[IDENTITY]) {
    const bst_elements *e = &o->elements;
    const double numbers[IDENTITY] = {e->norad,
                                      e->epoch_utc_jd1,
                                      e->epoch_utc_jd2,
                                      e->bstar,
                                      e->inclination_rad,
                                      e->raan_rad,
                                      e->eccentricity,
                                      e->arg_perigee_rad,
                                      e->mean_anomaly_rad,
                                      e->mean_motion_radpmin};
    memcpy(out, numbers, sizeof numbers);
}

/* Archives an object. One that moves on another element set than in the saved state, or that had
 * none there, keeps the filter that it starts with. */
static void archive_object(bst_run_custody *c, int object, bst_archive *archive) {
    double own[IDENTITY], saved[IDENTITY];
    const bst_custody_filter start = c->filters[object];
    identity_of(&c->orbits[object], own);
    memcpy(saved, own, sizeof saved);
    BST_ARCHIVE(archive, saved);
    BST_ARCHIVE(archive, c->filters[object]);
    BST_ARCHIVE(archive, c->scores[object]);
    if (memcmp(saved, own, sizeof own) != 0) {
        c->filters[object] = start;
        c->scores[object] = (bst_custody_score){.last_s = NAN};
    }
}

bst_status bst_run_custody_archive(bst_run_custody *c, bst_archive *archive) {
    if (!c) {
        return BST_OK;
    }
    for (int i = 0; i < c->object_count; i++) {
        archive_object(c, i, archive);
    }
    c->reach_until_s = -INFINITY;
    BST_TRY(bst_run_arcs_archive(c->arcs, archive));
    BST_TRY(bst_run_candidates_archive(c->candidates, c->object_count, archive));
    BST_TRY(bst_run_new_objects_archive(&c->new_objects, c->object_count, archive));
    BST_ARCHIVE(archive, c->figures);
    return BST_OK;
}

/* ---- correlation ---- */

/* Sets the bound of an object, which is largest at an end of the time for which it holds, with the
 * process noise until then. */
static void bound_reach(bst_run_custody *c, int i) {
    bst_custody_filter last = c->filters[i];
    bst_custody_add_process_noise(&c->config, c->reach_until_s, &last);
    c->reach_m[i] =
        fmax(bst_run_reach_of(&c->orbits[i], &last, c->reach_until_s - 2.0 * REACH_FOR_S),
             bst_run_reach_of(&c->orbits[i], &last, c->reach_until_s));
}

static void bound_reaches(bst_run_custody *c, double time_s) {
    if (!(time_s <= c->reach_until_s && time_s >= c->reach_until_s - 2.0 * REACH_FOR_S)) {
        c->reach_until_s = time_s + REACH_FOR_S;
        for (int i = 0; i < c->object_count; i++) {
            bound_reach(c, i);
        }
    }
}

/* Objects in the gate of an observation. Indices from object_count on are those of new objects. */
typedef struct match {
    int count;                  /* in the gate */
    int close;                  /* whose light may be in the image, the best one left out */
    int best, true_object;      /* -1: none */
    bool best_is_close;         /* it is one of the close ones */
    double chi2, merit, second; /* of the best; merit: chi-square + log determinant */
} match;

/* Compares an observation with what an object's filter predicts. */
static void compare_object(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                           int index, double fwhm, const bst_custody_observation *z, match *out) {
    bst_custody_prediction p;
    if (!bst_custody_predict(orbit, filter, z, &p)) {
        return;
    }
    const double sigma = sqrt(p.covariance[0][0] + p.covariance[1][1]);
    const bool close =
        hypot(p.innovation[0], p.innovation[1]) < fwhm + fmin(BLEND_SIGMAS * sigma, fwhm);
    out->close += close;
    if (!(p.chi2 < GATE)) {
        return;
    }
    double merit = p.chi2 + p.log_determinant;
    out->count++;
    if (merit < out->merit) {
        out->second = out->merit;
        out->merit = merit;
        out->chi2 = p.chi2;
        out->best = index;
        out->best_is_close = close;
    } else {
        out->second = fmin(out->second, merit);
    }
}

/* Compares an observation with the new objects. */
static void find_new_object(bst_run_custody *c, int sensor, const bst_custody_observation *z,
                            match *out) {
    for (int i = 0; i < c->new_objects.count; i++) {
        bst_run_new_object *o = &c->new_objects.items[i];
        bst_vec3 place, unused;
        bst_run_new_object_advance(o, z->observer.time_s);
        if (!bst_custody_state(&o->orbit, o->filter.x, z->observer.time_s, &place, &unused)) {
            continue;
        }
        place = bst_mat3_mul_vec(&z->gcrf_from_teme, place);
        if (bst_run_reach_holds(bst_run_reach_of(&o->orbit, &o->filter, z->observer.time_s), place,
                                z)) {
            compare_object(&o->orbit, &o->filter, c->object_count + i, c->fwhm_rad[sensor], z, out);
        }
    }
}

/* Compares an observation with an object of the catalogue, and its line with the true one. */
static void compare_catalogued(bst_run_custody *c, int i, int sensor,
                               const bst_custody_observation *z, double *nearest, match *out) {
    const double time_s = z->observer.time_s;
    const bst_world_state eye = {z->observer.position_m, z->observer.velocity_mps};
    const bst_vec3 place = {c->place_m[0][i], c->place_m[1][i], c->place_m[2][i]};
    bst_world_sight sight;
    bst_ctx quiet = {0}; /* an orbit that has ended is no error here */
    if (!bst_run_reach_holds(bst_run_reach_of(&c->orbits[i], &c->filters[i], time_s), place, z) ||
        bst_world_view_sight_from(&quiet, c->view, &eye, i, time_s, &sight) != BST_OK ||
        sight.range_m < ITSELF_M) {
        return;
    }
    double away = bst_vec3_angle(sight.geometric, z->direction);
    if (away < *nearest) {
        *nearest = away;
        out->true_object = i;
    }
    if (c->orbits[i].a_m > 0.0) {
        bst_custody_add_process_noise(&c->config, time_s, &c->filters[i]);
        bound_reach(c, i);
        compare_object(&c->orbits[i], &c->filters[i], i, c->fwhm_rad[sensor], z, out);
    }
}

/* Finds the object that an observation belongs to by the filters, and by the truth. */
static void find_object(bst_run_custody *c, int sensor, const bst_custody_observation *z,
                        match *out) {
    *out =
        (match){.best = -1, .true_object = -1, .chi2 = NAN, .merit = INFINITY, .second = INFINITY};
    double nearest = TRACK_PX * c->pixel_rad[sensor];
    bound_reaches(c, z->observer.time_s);
    (void)bst_world_places(c->world, z->observer.time_s, c->place_m[0], c->place_m[1],
                           c->place_m[2]);
    for (int begin = 0; begin < c->object_count; begin += BST_RUN_REACH_BLOCK) {
        const int n = c->object_count - begin < BST_RUN_REACH_BLOCK ? c->object_count - begin
                                                                    : BST_RUN_REACH_BLOCK;
        int candidate[BST_RUN_REACH_BLOCK];
        const bool any = bst_run_reach_any(c->place_m, c->reach_m, begin, n, z, candidate);
        for (int i = 0; any && i < n; i++) {
            if (candidate[i]) {
                compare_catalogued(c, begin + i, sensor, z, &nearest, out);
            }
        }
    }
    find_new_object(c, sensor, z, out);
    out->close -= out->best_is_close;
}

/* Variance of a rate that is left open, (rad/s)^2: no track moves by a radian a second. */
#define OPEN_RATE 1.0

/* What an arc measured in its middle. The orientation of TEME is that of its begin: in two hours
 * it turns by 6e-8 rad. */
static bst_custody_observation middle_of(const bst_run_arc *arc) {
    const bst_od_observation *d = &arc->directions[arc->count / 2];
    return (bst_custody_observation){.observer = d->observer,
                                     .gcrf_from_teme = arc->gcrf_from_teme[0],
                                     .direction = d->direction,
                                     .covariance = {{d->cov_11, d->cov_12},
                                                    {d->cov_12, d->cov_22},
                                                    {[2] = OPEN_RATE},
                                                    {[3] = OPEN_RATE}},
                                     .photocentre_factor = d->photocentre_factor};
}

/* Finds the object of an arc by its last state. If that is in no one's gate, or is another's in
 * truth, by a direction in its middle: the last state is wrong where the last attitudes are, as of
 * frames before a slew. All directions decide in the update. */
static void find_object_of_arc(bst_run_custody *c, int sensor, const bst_run_arc *arc, match *out) {
    find_object(c, sensor, &arc->state, out);
    const bool sure = out->best >= 0 && out->best == out->true_object;
    if (!sure && arc->count >= LEAST_DIRECTIONS) {
        const bst_custody_observation z = middle_of(arc);
        match by_middle;
        find_object(c, sensor, &z, &by_middle);
        *out = out->best < 0 && by_middle.best >= 0 ? by_middle : *out;
        out->true_object = by_middle.true_object;
    }
}

/* Updates an object with the directions that were measured, which do not have the process noise of
 * the tracker; with its last state where there are too few. */
static bool update(const bst_custody_orbit *orbit, const bst_run_arc *arc,
                   bst_custody_filter *filter) {
    return arc->count < LEAST_DIRECTIONS
               ? bst_custody_update(orbit, &arc->state, filter)
               : bst_custody_update_directions(orbit, arc->gcrf_from_teme, arc->directions,
                                               arc->count, filter);
}

/* Whether a catalogued object's orbit is that of a new one. */
static bool is_object(bst_run_custody *c, int object, const bst_run_new_object *o, double time_s) {
    if (!(c->orbits[object].a_m > 0.0)) {
        return false;
    }
    bst_custody_add_process_noise(&c->config, time_s, &c->filters[object]);
    return bst_run_new_object_is(&c->orbits[object], &c->filters[object], &o->orbit, &o->filter,
                                 time_s);
}

/* Adds a new object. If its orbit is that of one object that is known, it is not added: a
 * catalogued one starts anew on it, an earlier new one keeps its own. Nor is it if it is that of
 * several: which one it is stays open, but it is no further one. */
static bst_status add_new_object(bst_ctx *ctx, bst_run_custody *c, const bst_run_new_object *o) {
    const double time_s = -o->orbit.epoch_offset_s;
    int found = 0, which = -1;
    c->reach_until_s = -INFINITY; /* filters change */
    for (int i = 0; i < c->object_count; i++) {
        bool same = is_object(c, i, o, time_s);
        found += same;
        which = same ? i : which;
    }
    for (int i = 0; i < c->new_objects.count; i++) {
        bst_run_new_object *own = &c->new_objects.items[i];
        bst_run_new_object_advance(own, time_s);
        bool same = bst_run_new_object_is(&own->orbit, &own->filter, &o->orbit, &o->filter, time_s);
        found += same;
        which = same ? c->object_count + i : which;
    }
    if (found == 0) {
        return bst_run_new_objects_add(ctx, &c->new_objects, o);
    }
    bst_custody_filter anew;
    if (found == 1 && which >= c->object_count) {
        c->figures.new_matched++;
    } else if (found == 1 &&
               bst_run_new_object_carry(&o->orbit, &o->filter, &c->orbits[which], time_s, &anew)) {
        bst_custody_score *s = &c->scores[which];
        c->figures.new_matched++;
        c->filters[which] = anew;
        s->updates += o->score.updates;
        s->cross_tags += o->true_object == which ? 0 : o->score.updates;
        s->last_s = fmax(s->last_s, o->score.last_s); /* fmax ignores NAN */
    }
    return BST_OK;
}

/* Notes the update of an object in its score. Returns its NEES; NAN: it is a new one. */
static double note_update(bst_run_custody *c, const match *m, double time_s) {
    const bool is_new = m->best >= c->object_count;
    bst_run_new_object *o = is_new ? &c->new_objects.items[m->best - c->object_count] : NULL;
    const int64_t own = is_new ? o->true_object : m->best;
    const bool crossed = own < 0 || own != m->true_object;
    c->figures.new_tracks += is_new;
    c->figures.cross_tags += crossed;
    if (!is_new) {
        bound_reach(c, m->best);
    }
    bst_custody_score_add(is_new ? &o->score : &c->scores[m->best], crossed, m->chi2, time_s);
    return is_new ? NAN : bst_custody_nees(&c->filters[m->best]);
}

/* Correlates a track that has ended, and updates its object. */
static bst_status take_arc(void *user, bst_ctx *ctx, int sensor, const bst_run_arc *arc) {
    bst_run_custody *c = user;
    const bst_custody_observation *z = &arc->state;
    match m;
    find_object_of_arc(c, sensor, arc, &m);
    bst_custody_figures *f = &c->figures;
    const int new_one = m.best - c->object_count; /* index of it; below 0: catalogued */
    /* an image of two objects is that of neither, and may be in no one's gate */
    bool clear = m.best >= 0 && m.second > m.merit + LIKELIHOOD_MARGIN && m.close == 0;
    const bool blended = m.best < 0 && m.close > 0;
    /* One object beside an arc may be in its image, or may be elsewhere than a filter that is too
     * sure says: only tracks that make a new orbit tell. */
    const bool unknown = m.best < 0 && m.close < 2;
    bool updated = clear && (new_one < 0 ? update(&c->orbits[m.best], arc, &c->filters[m.best])
                                         : update(&c->new_objects.items[new_one].orbit, arc,
                                                  &c->new_objects.items[new_one].filter));
    f->tracks++;
    f->correlated += updated;
    f->ambiguous += (m.best >= 0 && !clear) || blended;
    f->uncorrelated += (m.best < 0 && !blended) || (clear && !updated);
    const double nees = updated ? note_update(c, &m, z->observer.time_s) : NAN;
    if (unknown) {
        bst_run_new_object made;
        BST_TRY(bst_run_candidates_take(ctx, c->candidates, sensor, arc, m.true_object, &made));
        if (made.score.updates > 0) {
            BST_TRY(add_new_object(ctx, c, &made));
        }
    }
    if (!c->tracks) {
        return BST_OK;
    }
    const bst_io_value row[] = {bst_io_int_value(sensor),
                                bst_io_int_value(arc->id),
                                bst_io_real_value(z->observer.time_s),
                                bst_io_int_value(arc->hits),
                                bst_io_int_value(m.count),
                                bst_io_known_int_value(m.best, updated && new_one < 0),
                                bst_io_known_int_value(new_one + 1, updated && new_one >= 0),
                                bst_io_known_int_value(m.true_object, m.true_object >= 0),
                                bst_io_real_value(m.chi2),
                                bst_io_real_value(nees)};
    return bst_io_table_append(ctx, c->tracks, row);
}

bst_status bst_run_custody_detections(bst_ctx *ctx, bst_run_custody *c, int sensor,
                                      const bst_detections *detections) {
    return c ? bst_run_arcs_detections(ctx, c->arcs, sensor, detections) : BST_OK;
}

bst_status bst_run_custody_tracks(bst_ctx *ctx, bst_run_custody *c, int sensor,
                                  const bst_tracks *tracks) {
    return c ? bst_run_arcs_tracks(ctx, c->arcs, sensor, tracks, take_arc, c) : BST_OK;
}

/* ---- end ---- */

/* Writes the row of an object and adds it to the figures. */
static bst_status end_object(bst_ctx *ctx, bst_run_custody *c, int object, double end_s,
                             double *sigma_m, double *nees) {
    const bst_world_object_info *info = bst_world_object(c->world, object);
    bst_custody_filter *f = &c->filters[object];
    bst_vec3 place, truth;
    double error_m = NAN;
    bst_custody_add_process_noise(&c->config, end_s, f);
    *nees = bst_custody_nees(f);
    if (!bst_custody_predict_position(&c->orbits[object], f, end_s, &place, sigma_m)) {
        *sigma_m = NAN;
    } else if (bst_custody_catalogued_position(&c->orbits[object], end_s, &truth)) {
        error_m = bst_vec3_norm(bst_vec3_sub(place, truth));
    }
    if (!c->objects) {
        return BST_OK;
    }
    const bst_custody_row row = {object, object, info->name, info->norad, *sigma_m, error_m, *nees};
    return bst_run_custody_add_object(ctx, c->objects, &row, &c->scores[object], end_s);
}

bst_status bst_run_custody_finish(bst_ctx *ctx, bst_run_custody *c, double end_s) {
    if (!c || !(end_s > 0.0)) {
        return BST_OK;
    }
    BST_TRY(bst_run_arcs_finish(ctx, c->arcs, take_arc, c));
    double *sigmas = c->place_m[0], *updated = c->place_m[1]; /* no longer needed */
    int count = 0, updated_count = 0, nees_count = 0;
    double age_sum = 0.0, nees_sum = 0.0;
    bst_custody_figures *f = &c->figures;
    const bst_candidate_figures made = bst_run_candidates_figures(c->candidates);
    f->candidates = made.candidates;
    f->candidates_confirmed = made.confirmed;
    f->candidates_wrong = made.wrong;
    f->in_custody = f->updated = 0;
    for (int i = 0; i < c->object_count; i++) {
        double sigma, nees;
        if (!(c->orbits[i].a_m > 0.0)) {
            continue;
        }
        BST_TRY(end_object(ctx, c, i, end_s, &sigma, &nees));
        f->updated += c->scores[i].updates > 0;
        if (isnan(sigma)) {
            continue;
        }
        f->in_custody += sigma <= c->within_m;
        sigmas[count++] = sigma;
        if (c->scores[i].updates > 0) {
            updated[updated_count++] = sigma;
            age_sum += end_s - c->scores[i].last_s;
            nees_sum += isnan(nees) ? 0.0 : nees;
            nees_count += !isnan(nees);
        }
    }
    bst_run_new_figures new_ones;
    BST_TRY(bst_run_new_objects_finish(ctx, &c->new_objects, c->world, c->orbits, c->objects, end_s,
                                       &new_ones));
    f->new_objects = c->new_objects.count;
    f->new_wrong = new_ones.wrong;
    f->new_sigma_median_m = new_ones.sigma_median_m;
    f->new_nees_mean = new_ones.nees_mean;
    f->objects = count;
    f->age_mean_s = updated_count > 0 ? age_sum / updated_count : NAN;
    f->sigma_median_m = bst_custody_quantile(sigmas, count, 0.5);
    f->sigma_p90_m = bst_custody_quantile(sigmas, count, 0.9);
    f->sigma_updated_median_m = bst_custody_quantile(updated, updated_count, 0.5);
    f->nees_mean = nees_count > 0 ? nees_sum / nees_count : NAN;
    double dof = (double)BST_CUSTODY_STATE * nees_count;
    f->nees_low = nees_count > 0 ? bst_eval_chi2_quantile(0.025, dof) / nees_count : NAN;
    f->nees_high = nees_count > 0 ? bst_eval_chi2_quantile(0.975, dof) / nees_count : NAN;
    return BST_OK;
}

bool bst_run_custody_figures(const bst_run_custody *c, bst_custody_figures *out) {
    *out = c ? c->figures : (bst_custody_figures){0};
    return c != NULL;
}
