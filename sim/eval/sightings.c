#include "sim/eval/sightings.h"

#include <stdlib.h>
#include <string.h>

#include "sim/eval/target_match.h"

/* frames per sensor that may wait for detections and tracks; objects per frame */
enum { WAITING = 16, IN_FRAME = 256 };
/* a track within this distance of an object belongs to it, as in loop_summary.c */
#define TRACK_PX 5.0

double bst_sighting_rms(const bst_sighting_error *e) {
    return e->count > 0 ? sqrt(e->sum2 / (double)e->count) : NAN;
}

/* Adds an angular error to the sums of a sighting. */
static void add_error(bst_sighting_error *e, double arcsec) {
    e->count++;
    e->sum2 += arcsec * arcsec;
    e->greatest = fmax(e->greatest, arcsec);
}

/* Adds the error sums of a pass to those of an object. */
static void add_errors(bst_sighting_error *to, const bst_sighting_error *from) {
    to->count += from->count;
    to->sum2 += from->sum2;
    to->greatest = fmax(to->greatest, from->greatest);
}

/* An object in the field of a frame. */
typedef struct seen_object {
    int record;         /* index of the record of its sensor and object */
    bst_vec3 direction; /* true, geometric, mid-exposure */
    double x_px, y_px;  /* position of its detection, if any */
    bool detected;
} seen_object;

typedef struct frame {
    bool valid;
    int64_t exposure_id;
    double mid_s;
    bst_light light;
    int count;
    seen_object objects[IN_FRAME];
    bst_eval_match_target targets[IN_FRAME];
} frame;

/* Record of an object for one sensor, with the current pass, or for all sensors. */
typedef struct record {
    bst_sighting sum;
    bst_eval_pass pass; /* frames 0: no current pass */
    int next;           /* record of the same object for the next sensor; -1: none */
} record;

typedef struct sensor {
    const bst_camera *camera;
    double reach_px;
    int *record; /* [objects] -1: never in the field */
    frame frames[WAITING];
    int next;
    int *open; /* indices of records with a current pass */
    int open_count, open_room;
} sensor;

struct bst_sightings {
    const bst_world *world;
    double tick_rate_hz, custody_s, end_s;
    bst_eval_pass_fn fn;
    void *user;
    int sensor_count, object_count;
    sensor *sensors;
    int *whole; /* [objects] record for all sensors; -1: never in a field */
    record *records;
    int record_count, record_room;
    int of_target[IN_FRAME], *of_detection;
    int detection_room;
    bst_sightings_figures tasks;
};

bst_status bst_sightings_create(bst_ctx *ctx, const bst_world *world, int64_t tick_rate_hz,
                                double custody_s, bst_eval_pass_fn pass, void *user,
                                bst_sightings **out) {
    *out = NULL;
    bst_sightings *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for who sees what");
    }
    s->world = world;
    s->tick_rate_hz = (double)tick_rate_hz;
    s->custody_s = custody_s;
    s->fn = pass;
    s->user = user;
    s->object_count = bst_world_object_count(world);
    for (int i = 0; i < bst_world_observer_count(world); i++) {
        s->sensor_count += bst_world_sensor_count(world, i);
    }
    size_t n = (size_t)s->object_count + 1;
    s->sensors = calloc((size_t)s->sensor_count + 1, sizeof *s->sensors);
    s->whole = malloc(n * sizeof *s->whole);
    bool enough = s->sensors && s->whole;
    for (int i = 0, k = 0; enough && i < bst_world_observer_count(world); i++) {
        for (int c = 0; enough && c < bst_world_sensor_count(world, i); c++, k++) {
            sensor *e = &s->sensors[k];
            e->camera = bst_world_camera(world, i, c);
            e->reach_px = fmax(e->camera->psf_fwhm_px, 1.0);
            e->record = malloc(n * sizeof *e->record);
            enough = e->record != NULL;
            for (int o = 0; enough && o < s->object_count; o++) {
                e->record[o] = -1;
            }
        }
    }
    for (int o = 0; enough && o < s->object_count; o++) {
        s->whole[o] = -1;
    }
    if (!enough) {
        bst_sightings_free(s);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for who sees what");
    }
    *out = s;
    return BST_OK;
}

void bst_sightings_free(bst_sightings *s) {
    if (s) {
        for (int i = 0; s->sensors && i < s->sensor_count; i++) {
            free(s->sensors[i].record);
            free(s->sensors[i].open);
        }
        free(s->sensors);
        free(s->whole);
        free(s->records);
        free(s->of_detection);
        free(s);
    }
}

/* ---- records ---- */

static bst_status new_record(bst_ctx *ctx, bst_sightings *s, int sensor_index, int object,
                             int *out) {
    if (s->record_count == s->record_room) {
        int room = s->record_room ? 2 * s->record_room : 256;
        record *more = realloc(s->records, (size_t)room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sightings", room);
        }
        s->records = more;
        s->record_room = room;
    }
    *out = s->record_count++;
    s->records[*out] =
        (record){.sum = {.sensor = sensor_index, .object = object, .first_s = NAN, .last_s = NAN},
                 .next = -1};
    return BST_OK;
}

/* Finds or adds the record of an object and a sensor. */
static bst_status record_of(bst_ctx *ctx, bst_sightings *s, int sensor_index, int object,
                            int *out) {
    int *own = &s->sensors[sensor_index].record[object];
    if (s->whole[object] < 0) {
        BST_TRY(new_record(ctx, s, -1, object, &s->whole[object]));
    }
    if (*own < 0) {
        BST_TRY(new_record(ctx, s, sensor_index, object, own));
        int last = s->whole[object];
        while (s->records[last].next >= 0) {
            last = s->records[last].next;
        }
        s->records[last].next = *own;
    }
    *out = *own;
    return BST_OK;
}

/* Updates gaps and custody of an object with a detection, in order of time. */
static void note_detection(const bst_sightings *s, bst_sighting *sum, double seconds) {
    double since = isnan(sum->first_s) ? seconds : seconds - sum->last_s;
    if (!(since >= 0.0)) {
        return; /* of a frame that arrives after a later frame of another sensor */
    }
    sum->longest_gap_s = fmax(sum->longest_gap_s, since);
    if (isnan(sum->first_s)) {
        sum->first_s = seconds;
    } else {
        sum->custody_s += fmin(since, s->custody_s);
        if (since > BST_PASS_BREAK_S) {
            sum->revisits++;
            sum->revisit_sum_s += since;
            sum->revisit_most_s = fmax(sum->revisit_most_s, since);
        }
    }
    sum->last_s = seconds;
}

/* Adds a pass to the sums of its object and sensor. */
static void add_pass(bst_sighting *sum, const bst_eval_pass *pass) {
    sum->passes++;
    sum->passes_seen += pass->detected > 0;
    sum->frames += pass->frames;
    sum->lit += pass->lit;
    sum->detected += pass->detected;
    sum->tracked += pass->tracked;
    sum->snr = fmax(sum->snr, pass->snr);
    add_errors(&sum->place, &pass->place);
    add_errors(&sum->track, &pass->track);
}

/* Ends a pass and reports it. */
static bst_status end_pass(bst_ctx *ctx, bst_sightings *s, record *r) {
    add_pass(&r->sum, &r->pass);
    add_pass(&s->records[s->whole[r->sum.object]].sum, &r->pass);
    bst_status status = s->fn ? s->fn(s->user, ctx, &r->pass) : BST_OK;
    r->pass.frames = 0;
    return status;
}

/* Ends the passes of a sensor that have had no frame since `before_s`. */
static bst_status end_passes(bst_ctx *ctx, bst_sightings *s, sensor *e, double before_s) {
    int kept = 0;
    for (int i = 0; i < e->open_count; i++) {
        record *r = &s->records[e->open[i]];
        if (r->pass.end_s < before_s) {
            BST_TRY(end_pass(ctx, s, r));
        } else {
            e->open[kept++] = e->open[i];
        }
    }
    e->open_count = kept;
    return BST_OK;
}

/* Begins a pass of an object through a sensor's field of view. */
static bst_status begin_pass(bst_ctx *ctx, bst_sightings *s, int sensor_index, int index,
                             double seconds) {
    sensor *e = &s->sensors[sensor_index];
    if (e->open_count == e->open_room) {
        int room = e->open_room ? 2 * e->open_room : 64;
        int *more = realloc(e->open, (size_t)room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d passes", room);
        }
        e->open = more;
        e->open_room = room;
    }
    e->open[e->open_count++] = index;
    record *r = &s->records[index];
    r->pass = (bst_eval_pass){.sensor = sensor_index,
                              .object = r->sum.object,
                              .start_s = seconds,
                              .first_s = NAN,
                              .last_s = NAN,
                              .v_mag = INFINITY,
                              .range_m = INFINITY};
    return BST_OK;
}

/* ---- saved states ---- */

/* Enlarges an array of records or of indices; false: there is no memory. */
static bool make_room(void **items, int *room, int needed, size_t item_bytes) {
    if (needed <= *room) {
        return true;
    }
    void *more = realloc(*items, (size_t)needed * item_bytes);
    if (!more) {
        return false;
    }
    *items = more;
    *room = needed;
    return true;
}

/* Enters the restored records in the tables that find them. */
static void index_records(bst_sightings *s) {
    for (int o = 0; o < s->object_count; o++) {
        s->whole[o] = -1;
        for (int i = 0; i < s->sensor_count; i++) {
            s->sensors[i].record[o] = -1;
        }
    }
    for (int i = 0; i < s->record_count; i++) {
        const bst_sighting *sum = &s->records[i].sum;
        *(sum->sensor < 0 ? &s->whole[sum->object] : &s->sensors[sum->sensor].record[sum->object]) =
            i;
    }
}

static void archive_record(const bst_sightings *s, record *r, bst_archive *archive) {
    BST_ARCHIVE(archive, r->sum);
    BST_ARCHIVE(archive, r->pass);
    r->sum.sensor = (int)bst_archive_integer(archive, r->sum.sensor, -1, s->sensor_count - 1);
    r->sum.object = (int)bst_archive_integer(archive, r->sum.object, 0, s->object_count - 1);
    r->next = (int)bst_archive_integer(archive, r->next, -1, s->record_count - 1);
}

/* Saves or restores a frame that waits for its detections and tracks. */
static void archive_frame(const bst_sightings *s, frame *f, bst_archive *archive) {
    bst_archive_bool(archive, &f->valid);
    BST_ARCHIVE(archive, f->exposure_id);
    BST_ARCHIVE(archive, f->mid_s);
    BST_ARCHIVE(archive, f->light);
    f->count = bst_archive_count(archive, f->count, IN_FRAME);
    for (int i = 0; i < f->count; i++) {
        seen_object *o = &f->objects[i];
        o->record = (int)bst_archive_integer(archive, o->record, 0,
                                             s->record_count > 0 ? s->record_count - 1 : 0);
        BST_ARCHIVE(archive, o->direction);
        BST_ARCHIVE(archive, o->x_px);
        BST_ARCHIVE(archive, o->y_px);
        bst_archive_bool(archive, &o->detected);
        BST_ARCHIVE(archive, f->targets[i]);
    }
}

/* Saves or restores the frames and current passes of a sensor; false: there is no memory. */
static bool archive_sensor(const bst_sightings *s, sensor *e, bst_archive *archive) {
    e->next = (int)bst_archive_integer(archive, e->next, 0, INT32_MAX);
    for (int i = 0; i < WAITING; i++) {
        archive_frame(s, &e->frames[i], archive);
    }
    e->open_count = bst_archive_count(archive, e->open_count, s->record_count);
    if (!make_room((void **)&e->open, &e->open_room, e->open_count, sizeof *e->open)) {
        e->open_count = 0;
        return false;
    }
    for (int i = 0; i < e->open_count; i++) {
        e->open[i] = (int)bst_archive_integer(archive, e->open[i], 0, s->record_count - 1);
    }
    return true;
}

bst_status bst_sightings_archive(bst_sightings *s, bst_archive *archive) {
    s->record_count = bst_archive_count(archive, s->record_count, INT32_MAX / 2);
    bool enough =
        make_room((void **)&s->records, &s->record_room, s->record_count, sizeof *s->records);
    for (int i = 0; enough && i < s->record_count; i++) {
        archive_record(s, &s->records[i], archive);
    }
    if (enough && bst_archive_is_restoring(archive)) {
        index_records(s);
    }
    for (int i = 0; enough && i < s->sensor_count; i++) {
        enough = archive_sensor(s, &s->sensors[i], archive);
    }
    BST_ARCHIVE(archive, s->tasks);
    return enough ? BST_OK
                  : bst_fail(bst_archive_ctx(archive), BST_ERR_MEMORY,
                             "out of memory for %d sightings", s->record_count);
}

/* ---- messages ---- */

bst_status bst_sightings_truth(bst_ctx *ctx, bst_sightings *s, int sensor_index,
                               const bst_truth *truth) {
    sensor *e = &s->sensors[sensor_index];
    double mid_s = 0.5 * (double)(truth->start_tick + truth->end_tick) / s->tick_rate_hz;
    frame *f = &e->frames[e->next++ % WAITING];
    f->valid = true;
    f->exposure_id = truth->exposure_id;
    f->mid_s = mid_s;
    f->light = (bst_light){.sun_m = truth->sun_m, .velocity_mps = truth->velocity_bary_mps};
    f->count = 0;
    BST_TRY(end_passes(ctx, s, e, mid_s - BST_PASS_BREAK_S));
    for (int i = 0; i < truth->count; i++) {
        const bst_truth_item *item = &truth->items[i];
        if (item->kind != BST_SOURCE_OBJECT || !(item->flags & BST_TRUTH_IN_FIELD) ||
            (item->flags & BST_TRUTH_OCCULTED)) {
            continue;
        }
        int index;
        BST_TRY(record_of(ctx, s, sensor_index, (int)item->id, &index));
        if (s->records[index].pass.frames == 0) {
            BST_TRY(begin_pass(ctx, s, sensor_index, index, mid_s));
        }
        bst_eval_pass *pass = &s->records[index].pass;
        pass->end_s = mid_s;
        pass->frames++;
        pass->lit += item->electrons > 0.0;
        pass->range_m = fmin(pass->range_m, item->range_m);
        if (item->snr > pass->snr) {
            pass->snr = item->snr;
            pass->v_mag = item->v_mag;
        }
        if (item->electrons > 0.0 && f->count < IN_FRAME && !truth->dropped) {
            f->targets[f->count] =
                (bst_eval_match_target){.x_px = item->x_centroid_px,
                                        .y_px = item->y_centroid_px,
                                        .dx_px = item->x_end_px - item->x_start_px,
                                        .dy_px = item->y_end_px - item->y_start_px};
            f->objects[f->count++] = (seen_object){
                .record = index, .direction = bst_vec3_from_radec(item->ra_rad, item->dec_rad)};
        }
    }
    return BST_OK;
}

static frame *frame_of(sensor *e, int64_t exposure_id) {
    for (int i = 0; i < WAITING; i++) {
        if (e->frames[i].valid && e->frames[i].exposure_id == exposure_id) {
            return &e->frames[i];
        }
    }
    return NULL;
}

/* Checks whether the onboard side classifies a detection as a star or an artefact: then it is no
 * sighting. */
static bool is_taken_for_else(const bst_detection *d) {
    return (d->label == BST_LABEL_STAR && d->star_id != 0) || d->label == BST_LABEL_HIT ||
           d->label == BST_LABEL_HOT_PIXEL;
}

void bst_sightings_detections(bst_sightings *s, int sensor_index, const bst_detections *d) {
    sensor *e = &s->sensors[sensor_index];
    frame *f = frame_of(e, d->exposure_id);
    if (!f || f->count == 0) {
        return;
    }
    if (d->count > s->detection_room) {
        int *more = realloc(s->of_detection, (size_t)d->count * sizeof *more);
        if (!more) {
            return;
        }
        s->of_detection = more;
        s->detection_room = d->count;
    }
    (void)bst_eval_match_targets(f->targets, f->count, e->reach_px, d, s->of_target,
                                 s->of_detection);
    for (int i = 0; i < f->count; i++) {
        const bst_detection *match = s->of_target[i] >= 0 ? &d->items[s->of_target[i]] : NULL;
        if (!match || is_taken_for_else(match)) {
            continue;
        }
        seen_object *o = &f->objects[i];
        o->detected = true;
        o->x_px = match->x_px;
        o->y_px = match->y_px;
        record *r = &s->records[o->record];
        r->pass.detected++;
        r->pass.first_s = isnan(r->pass.first_s) ? f->mid_s : r->pass.first_s;
        r->pass.last_s = f->mid_s;
        note_detection(s, &r->sum, f->mid_s);
        note_detection(s, &s->records[s->whole[r->sum.object]].sum, f->mid_s);
    }
}

/* True if no object of the frame is nearer to a direction than object `own`. */
static bool is_nearest_object(const frame *f, int own, bst_vec3 direction) {
    double off = bst_vec3_angle(f->objects[own].direction, direction);
    for (int i = 0; i < f->count; i++) {
        if (i != own && bst_vec3_angle(f->objects[i].direction, direction) < off) {
            return false;
        }
    }
    return true;
}

/* The nearest confirmed track of an object that was measured in this frame; NULL: none. A track
 * belongs to one object, the nearest. */
static const bst_track *track_of(const bst_tracks *tracks, const frame *f, int object,
                                 double reach_rad) {
    const bst_track *nearest = NULL;
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *t = &tracks->items[i];
        double off = bst_vec3_angle(t->direction_gcrf, f->objects[object].direction);
        if (t->status == BST_TRACK_CONFIRMED && t->misses_in_row == 0 && off <= reach_rad &&
            is_nearest_object(f, object, t->direction_gcrf)) {
            nearest = t;
            reach_rad = off;
        }
    }
    return nearest;
}

void bst_sightings_tracks(bst_sightings *s, int sensor_index, const bst_tracks *tracks) {
    sensor *e = &s->sensors[sensor_index];
    frame *f = frame_of(e, tracks->exposure_id);
    if (!f) {
        return;
    }
    double reach = TRACK_PX * bst_camera_scale_rad(e->camera);
    bst_quat back = bst_quat_conj(tracks->attitude.q_cam_from_gcrf);
    for (int i = 0; i < f->count; i++) {
        const seen_object *o = &f->objects[i];
        bst_eval_pass *pass = &s->records[o->record].pass;
        if (o->detected && tracks->attitude.valid) {
            bst_vec3 v = bst_camera_unproject(e->camera, o->x_px, o->y_px);
            bst_vec3 seen = bst_light_unaberrate(&f->light, bst_quat_rotate(back, v));
            add_error(&pass->place, bst_vec3_angle(seen, o->direction) / BST_ARCSEC_RAD);
        }
        const bst_track *track = track_of(tracks, f, i, reach);
        if (track) {
            pass->tracked++;
            pass->target += track->target_of_interest;
            add_error(&pass->track,
                      bst_vec3_angle(track->direction_gcrf, o->direction) / BST_ARCSEC_RAD);
        }
    }
    f->valid = false;
}

void bst_sightings_task(bst_sightings *s, const bst_task *task) {
    s->tasks.tasks += task->object >= 0;
    s->tasks.tasks_done += task->before == BST_TASK_DONE;
    s->tasks.tasks_not_found += task->before == BST_TASK_NOT_FOUND;
    s->tasks.tasks_lost += task->before == BST_TASK_LOST;
}

/* ---- the end ---- */

bst_status bst_sightings_finish(bst_ctx *ctx, bst_sightings *s, double end_s) {
    s->end_s = end_s;
    for (int i = 0; i < s->sensor_count; i++) {
        BST_TRY(end_passes(ctx, s, &s->sensors[i], INFINITY));
    }
    for (int i = 0; i < s->record_count; i++) {
        bst_sighting *sum = &s->records[i].sum;
        double since = isnan(sum->first_s) ? end_s : fmax(end_s - sum->last_s, 0.0);
        sum->longest_gap_s = fmax(sum->longest_gap_s, since);
        sum->custody_s += isnan(sum->first_s) ? 0.0 : fmin(since, s->custody_s);
    }
    return BST_OK;
}

bst_status bst_sightings_each(bst_ctx *ctx, const bst_sightings *s, bst_sighting_fn fn,
                              void *user) {
    for (int o = 0; o < s->object_count; o++) {
        for (int i = s->whole[o]; i >= 0; i = s->records[i].next) {
            BST_TRY(fn(user, ctx, &s->records[i].sum));
        }
    }
    return BST_OK;
}

void bst_sightings_summary(const bst_sightings *s, bst_sightings_figures *out) {
    *out = s->tasks;
    out->objects = s->object_count;
    double custody = 0.0, gaps = 0.0, revisits = 0.0;
    bst_sighting_error place = {0}, track = {0};
    for (int o = 0; o < s->object_count; o++) {
        const bst_sighting *sum = s->whole[o] >= 0 ? &s->records[s->whole[o]].sum : NULL;
        if (!sum) {
            continue;
        }
        out->in_field++;
        out->passes += sum->passes;
        out->passes_seen += sum->passes_seen;
        out->detections += sum->detected;
        out->revisits += sum->revisits;
        out->revisit_most_s = fmax(out->revisit_most_s, sum->revisit_most_s);
        revisits += sum->revisit_sum_s;
        add_errors(&place, &sum->place);
        add_errors(&track, &sum->track);
        if (sum->detected > 0) {
            out->seen++;
            custody += sum->custody_s / s->end_s;
            gaps += sum->longest_gap_s;
        }
    }
    out->revisit_mean_s = out->revisits > 0 ? revisits / (double)out->revisits : NAN;
    out->revisit_most_s = out->revisits > 0 ? out->revisit_most_s : NAN;
    out->custody_fraction = out->seen > 0 ? custody / (double)out->seen : NAN;
    out->custody_fraction_all = out->objects > 0 ? custody / (double)out->objects : NAN;
    out->gap_mean_s = out->seen > 0 ? gaps / (double)out->seen : NAN;
    out->place_rms_arcsec = bst_sighting_rms(&place);
    out->track_rms_arcsec = bst_sighting_rms(&track);
}
