#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/tasking/tasking_internal.h"

/* Largest urgency: time since the last observation over the wanted revisit time, or standard
 * deviation over the wanted one. */
#define URGENCY_MOST 4.0
/* Most visibility computations per plan; remaining objects are left to the next plan. */
enum { TRIES = 200 };
/* Retry time of an object that is hidden, too fast or out of reach. */
#define HIDDEN_RETRY_S 120.0

static double seconds_of(const bst_tasking *t, int64_t tick) {
    return (double)tick / t->tick_rate_hz;
}

/* Target-list line of an object. */
static const bst_tasking_line *line_of(const bst_tasking *t, int object) {
    return (const bst_tasking_line *)t->config.targets.items + t->line[object];
}

/* True if an object's apsides are within a line's bounds. */
static bool fits(const bst_tasking_line *line, double perigee_km, double apogee_km) {
    return !*line->object && perigee_km >= line->perigee_km[0] &&
           perigee_km <= line->perigee_km[1] && apogee_km >= line->apogee_km[0] &&
           apogee_km <= line->apogee_km[1];
}

static bst_status list_targets(bst_ctx *ctx, bst_tasking *t) {
    const bst_tasking_line *lines = t->config.targets.items;
    bst_knowledge_view *view = t->sensors[0].view;
    for (int i = 0; i < t->object_count; i++) {
        double perigee_m, apogee_m;
        t->line[i] = -1;
        bool known = bst_knowledge_apsides(view, i, &perigee_m, &apogee_m);
        double low = 1e-3 * (perigee_m - BST_EARTH_RADIUS_M),
               high = 1e-3 * (apogee_m - BST_EARTH_RADIUS_M);
        for (int k = 0; known && t->line[i] < 0 && k < t->config.targets.count; k++) {
            t->line[i] = (int16_t)(fits(&lines[k], low, high) ? k : -1);
        }
    }
    /* a line for a named object takes precedence over later lines by orbit */
    for (int k = t->config.targets.count - 1; k >= 0; k--) {
        if (!*lines[k].object) {
            continue;
        }
        int object = bst_knowledge_find_object(t->sensors[0].knowledge, lines[k].object);
        if (object < 0) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "targets/%d/object: there is no object \"%s\" in the world", k,
                            lines[k].object);
        }
        if (t->line[object] < 0 || t->line[object] > k) {
            t->line[object] = (int16_t)k;
        }
    }
    for (int i = 0; i < t->object_count; i++) {
        if (t->line[i] >= 0 && !(line_of(t, i)->priority > 0.0)) {
            t->line[i] = -1;
        }
    }
    return BST_OK;
}

static bst_status take_members(bst_ctx *ctx, bst_tasking *t, const bst_fleet_member *members) {
    for (int s = 0; s < t->sensor_count; s++) {
        bst_tasking_sensor *sensor = &t->sensors[s];
        *sensor = (bst_tasking_sensor){.knowledge = members[s].knowledge,
                                       .exposure_s = members[s].frame_exposure_s,
                                       .period_s = members[s].frame_period_s,
                                       .task = {.object = -1}};
        bst_tasking_noise(sensor);
        BST_TRY(bst_knowledge_view_create(ctx, sensor->knowledge, &sensor->view));
    }
    return BST_OK;
}

/* Returns the number of elements per object array. */
static size_t lay_out(bst_tasking *t) {
    size_t n = (size_t)t->object_count + 1, sensors = (size_t)t->sensor_count;
    BST_ARENA_TAKE(&t->arena, t->sensors, sensors);
    BST_ARENA_TAKE(&t->arena, t->line, n);
    BST_ARENA_TAKE(&t->arena, t->along, n);
    BST_ARENA_TAKE(&t->arena, t->seen_s, n);
    BST_ARENA_TAKE(&t->arena, t->holder, n);
    BST_ARENA_TAKE(&t->arena, t->not_before, n * sensors);
    BST_ARENA_TAKE(&t->arena, t->place_m[0], 3 * n);
    return n;
}

bst_status bst_tasking_init(bst_ctx *ctx, bst_tasking *t, const bst_tasking_config *config,
                            const bst_fleet_member *members, int member_count,
                            double tick_rate_hz) {
    assert(t && config && members && member_count > 0 && tick_rate_hz > 0.0);
    *t = (bst_tasking){.config = *config,
                       .tick_rate_hz = tick_rate_hz,
                       .sensor_count = member_count,
                       .object_count = bst_knowledge_object_count(members[0].knowledge),
                       .places_s = NAN};
    (void)lay_out(t);
    char what[64];
    snprintf(what, sizeof what, "the tasks of %d objects", t->object_count);
    BST_TRY(bst_arena_alloc(ctx, &t->arena, what));
    size_t n = lay_out(t);
    t->place_m[1] = t->place_m[0] + n;
    t->place_m[2] = t->place_m[1] + n;
    for (int i = 0; i < t->object_count; i++) {
        t->seen_s[i] = -1.0;
        t->holder[i] = -1;
    }
    BST_TRY(take_members(ctx, t, members));
    bst_tasking_uncertainty_init(t);
    return list_targets(ctx, t);
}

void bst_tasking_free(bst_tasking *t) {
    for (int s = 0; t->sensors && s < t->sensor_count; s++) {
        bst_knowledge_view_free(t->sensors[s].view);
    }
    bst_arena_free(&t->arena);
    *t = (bst_tasking){.sensor_count = 0};
}

/* Saves or restores the task of a sensor, and its newest navigation and mount. */
static bst_status archive_sensor(bst_tasking *t, int sensor, bst_archive *archive) {
    bst_tasking_sensor *s = &t->sensors[sensor];
    bst_knowledge_view_archive(s->view, archive);
    bst_archive_bool(archive, &s->nav_known);
    bst_archive_bool(archive, &s->mount_known);
    BST_ARCHIVE(archive, s->nav);
    BST_ARCHIVE(archive, s->mount);
    BST_ARCHIVE(archive, s->task);
    bst_archive_bool(archive, &s->pointed);
    BST_ARCHIVE(archive, s->direction);
    BST_ARCHIVE(archive, s->given_s);
    BST_ARCHIVE(archive, s->arrival_s);
    BST_ARCHIVE(archive, s->frames);
    BST_ARCHIVE(archive, s->frames_wanted);
    BST_ARCHIVE(archive, s->last_seen_s);
    BST_ARCHIVE(archive, s->seen_direction);
    BST_ARCHIVE(archive, s->seen_covariance);
    BST_ARCHIVE(archive, s->next_plan_s);
    BST_ARCHIVE(archive, s->quiet_until);
    if (bst_archive_is_restoring(archive) && s->nav_known) {
        const bst_nav_telemetry nav = s->nav;
        bst_tasking_telemetry(t, sensor, &nav, NULL); /* the keep-out zones */
    }
    if (s->task.object < -1 || s->task.object >= t->object_count || s->mount.axes < 0 ||
        s->mount.axes > BST_MOUNT_AXES) {
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved task of sensor %d is damaged, or that of another scenario: "
                        "object %d of %d, a mount with %d axes",
                        sensor, (int)s->task.object, t->object_count, (int)s->mount.axes);
    }
    return BST_OK;
}

/* `place_m` is the work space of a plan; `line` follows from the list. */
bst_status bst_tasking_archive(bst_tasking *t, bst_archive *archive) {
    size_t objects = (size_t)t->object_count;
    bst_archive_bytes(archive, t->along, objects * sizeof *t->along);
    bst_archive_bytes(archive, t->seen_s, objects * sizeof *t->seen_s);
    bst_archive_bytes(archive, t->holder, objects * sizeof *t->holder);
    bst_archive_bytes(archive, t->not_before,
                      objects * (size_t)t->sensor_count * sizeof *t->not_before);
    BST_ARCHIVE(archive, t->next_report_s);
    for (int i = 0; i < t->sensor_count; i++) {
        BST_TRY(archive_sensor(t, i, archive));
    }
    return BST_OK;
}

void bst_tasking_tracks(bst_tasking *t, int sensor, const bst_tracks *tracks) {
    assert(t && tracks && sensor >= 0 && sensor < t->sensor_count);
    bst_tasking_sensor *s = &t->sensors[sensor];
    if (s->task.object < 0 || tracks->tick <= s->task.tick) {
        return;
    }
    for (int i = 0; i < tracks->count; i++) {
        const bst_track *track = &tracks->items[i];
        if (track->target_of_interest && track->status == BST_TRACK_CONFIRMED &&
            track->misses_in_row == 0) {
            s->frames++;
            s->last_seen_s = seconds_of(t, tracks->tick);
            t->seen_s[s->task.object] = s->last_seen_s;
            s->seen_direction = track->direction_gcrf;
            for (int k = 0; k < 4; k++) {
                s->seen_covariance[k / 2][k % 2] = track->covariance[k / 2][k % 2];
            }
        }
    }
}

static float *not_before(bst_tasking *t, int sensor, int object) {
    return &t->not_before[(size_t)sensor * (size_t)t->object_count + (size_t)object];
}

/* End reason of the sensor's task, BST_TASK_NONE: it continues. */
static bst_task_end ending(const bst_tasking *t, const bst_tasking_sensor *s, double now_s) {
    if (s->frames >= s->frames_wanted) {
        return BST_TASK_DONE;
    }
    if (s->frames > 0) {
        return now_s > s->last_seen_s + t->config.find_timeout_s ? BST_TASK_LOST : BST_TASK_NONE;
    }
    return now_s > s->arrival_s + t->config.find_timeout_s ? BST_TASK_NOT_FOUND : BST_TASK_NONE;
}

/* Urgency of a target: below 1 it is not due. */
static double urgency_of(const bst_tasking *t, int object, double now_s) {
    const bst_tasking_line *line = line_of(t, object);
    /* a target never observed is due from the start, with growing urgency */
    double since = t->seen_s[object] < 0.0 ? now_s + line->revisit_s : now_s - t->seen_s[object];
    return line->sigma_m > 0.0 && since >= line->revisit_s
               ? bst_tasking_sigma_m(t, object, now_s) / line->sigma_m
               : since / line->revisit_s;
}

/* Value of a target after a slew. */
static double value_of(const bst_tasking *t, int sensor, int object, double urgency,
                       double slew_s) {
    const bst_tasking_line *line = line_of(t, object);
    double work_s =
        slew_s + t->config.settle_s + (double)line->frames * t->sensors[sensor].period_s;
    return line->priority * fmin(urgency, URGENCY_MOST) / work_s;
}

/* Reads the table of positions, if that of this time is not the one in `place_m`. */
static void read_places(bst_tasking *t, const bst_knowledge *knowledge, double now_s) {
    if (bst_knowledge_places_time(now_s) != t->places_s) {
        t->places_s =
            bst_knowledge_places(knowledge, now_s, t->place_m[0], t->place_m[1], t->place_m[2]);
    }
}

/* Sets the slew to a target and its value with it. False: by the table of positions it is in a
 * keep-out zone, in the shadow, or without an orbit. */
static bool place_choice(const bst_tasking *t, int sensor, double urgency,
                         bst_tasking_choice *choice) {
    const bst_tasking_sensor *s = &t->sensors[sensor];
    const int i = choice->object;
    bst_vec3 place = {t->place_m[0][i], t->place_m[1][i], t->place_m[2][i]};
    bst_vec3 direction = s->direction;
    if (!isnan(place.x) &&
        (bst_vec3_norm(place) == 0.0 || bst_tasking_glance(s, place, &direction) != BST_WHY_NOT)) {
        return false;
    }
    double turn = s->pointed ? bst_vec3_angle(s->direction, direction) : 0.0;
    choice->slew_s = turn / (t->config.slew_rate_deg_per_s * BST_DEG_RAD);
    choice->value = value_of(t, sensor, i, urgency, choice->slew_s);
    return true;
}

/* True if a choice comes before another: the larger value, then catalogue order. */
static bool comes_before(const bst_tasking_choice *a, const bst_tasking_choice *b) {
    return a->value != b->value ? a->value > b->value : a->object < b->object;
}

/* The first choices of all, in their order. */
enum { MOST_CHOICES = 16 };
typedef struct choice_list {
    int count;
    bst_tasking_choice items[MOST_CHOICES];
} choice_list;

static bool has_room(const choice_list *list, const bst_tasking_choice *choice) {
    return list->count < MOST_CHOICES || comes_before(choice, &list->items[MOST_CHOICES - 1]);
}

static void insert_choice(choice_list *list, const bst_tasking_choice *choice) {
    int at = list->count < MOST_CHOICES ? list->count++ : MOST_CHOICES - 1;
    for (; at > 0 && comes_before(choice, &list->items[at - 1]); at--) {
        list->items[at] = list->items[at - 1];
    }
    list->items[at] = *choice;
}

/* Lists the first targets after `last` (NULL: of all) that are due, unassigned, and visible by a
 * quick check. That is omitted where a target without a slew, the largest value that it can have,
 * would come after the list. */
static void list_choices(const bst_tasking *t, int sensor, double now_s,
                         const bst_tasking_choice *last, choice_list *list) {
    const float *from_s = &t->not_before[(size_t)sensor * (size_t)t->object_count];
    list->count = 0;
    for (int i = 0; i < t->object_count; i++) {
        if (t->line[i] < 0 || t->holder[i] >= 0 || from_s[i] > (float)now_s) {
            continue;
        }
        double urgency = urgency_of(t, i, now_s);
        bst_tasking_choice choice = {.object = i, .value = value_of(t, sensor, i, urgency, 0.0)};
        if (!(urgency < 1.0) && has_room(list, &choice) &&
            place_choice(t, sensor, urgency, &choice) && has_room(list, &choice) &&
            (!last || comes_before(last, &choice))) {
            insert_choice(list, &choice);
        }
    }
}

/* Visibility of an object from arrival to the last wanted frame: geometry at arrival, the smaller
 * SNR. */
static bst_status sees(bst_ctx *ctx, const bst_tasking *t, int sensor,
                       const bst_tasking_choice *choice, double now_s,
                       bst_tasking_visibility *out) {
    const bst_tasking_sensor *s = &t->sensors[sensor];
    double from_s = now_s + choice->slew_s + t->config.settle_s;
    double until_s = from_s + (double)line_of(t, choice->object)->frames * s->period_s;
    BST_TRY(bst_tasking_look(ctx, t, sensor, choice->object, from_s, out));
    if (out->why == BST_WHY_NOT) {
        bst_tasking_visibility last;
        BST_TRY(bst_tasking_look(ctx, t, sensor, choice->object, until_s, &last));
        out->why = last.why;
        out->snr = fmin(out->snr, last.snr);
    }
    return BST_OK;
}

/* Assigns a task to a sensor. */
static void assign_task(bst_tasking *t, int sensor, int64_t tick, bst_task_end before,
                        const bst_tasking_choice *choice, const bst_tasking_visibility *seen) {
    const bst_tasking_config *c = &t->config;
    bst_tasking_sensor *s = &t->sensors[sensor];
    double now_s = seconds_of(t, tick);
    s->task =
        (bst_task){.id = s->task.id + 1, .tick = tick, .object = -1, .before = (int32_t)before};
    s->given_s = s->arrival_s = now_s;
    s->frames = 0;
    if (choice) {
        s->task.object = choice->object;
        s->task.norad = bst_knowledge_object(s->knowledge, choice->object)->norad;
        s->task.sigma_rad = c->sigma_deg * BST_DEG_RAD;
        s->task.rate_sigma_radps = c->rate_sigma_arcsec_per_s * BST_ARCSEC_RAD;
        s->task.v_mag = seen->sight.v_mag;
        s->task.v_mag_sigma = c->v_mag_sigma;
        s->task.snr = seen->snr;
        s->arrival_s = now_s + choice->slew_s + c->settle_s;
        s->frames_wanted = line_of(t, choice->object)->frames;
        s->direction = seen->sight.geometric;
        s->pointed = true;
        t->holder[choice->object] = sensor;
    }
}

/* Time after which a target that cannot be seen is tried again. */
static double retry_after_s(const bst_tasking *t, bst_tasking_why why) {
    return why == BST_WHY_FAINT    ? t->config.retry_s
           : why == BST_WHY_ITSELF ? INFINITY
                                   : HIDDEN_RETRY_S;
}

/* Best target that the sensor can see; object -1: none. */
static bst_status choose_target(bst_ctx *ctx, bst_tasking *t, int sensor, double now_s,
                                bst_tasking_choice *chosen, bst_tasking_visibility *seen) {
    choice_list list;
    bst_tasking_choice last;
    chosen->object = -1;
    read_places(t, t->sensors[sensor].knowledge, now_s);
    list_choices(t, sensor, now_s, NULL, &list);
    for (int tries = 0, k = 0; tries < TRIES && k < list.count; tries++) {
        BST_TRY(sees(ctx, t, sensor, &list.items[k], now_s, seen));
        if (seen->why == BST_WHY_NOT) {
            *chosen = list.items[k];
            return BST_OK;
        }
        last = list.items[k++];
        *not_before(t, sensor, last.object) = (float)(now_s + retry_after_s(t, seen->why));
        if (k == MOST_CHOICES) {
            list_choices(t, sensor, now_s, &last, &list);
            k = 0;
        }
    }
    return BST_OK;
}

/* Time until which the sensor's task certainly continues: its remaining frames take time, a search
 * may last until its timeout. */
static double certain_until_s(const bst_tasking *t, const bst_tasking_sensor *s, double now_s) {
    if (s->task.object < 0) {
        return s->next_plan_s;
    }
    double frames_s = (double)(s->frames_wanted - s->frames - 1) * s->period_s;
    double seen_s = s->frames > 0 ? s->last_seen_s : fmin(s->arrival_s, now_s);
    return fmin(now_s + frames_s, seen_s + t->config.find_timeout_s);
}

int64_t bst_tasking_quiet_until(const bst_tasking *t, int sensor) {
    return t->sensors[sensor].quiet_until;
}

/* Ends a task that is due to end and assigns the next one. */
static bst_status change(bst_ctx *ctx, bst_tasking *t, int sensor, int64_t tick, bool *given) {
    bst_tasking_sensor *s = &t->sensors[sensor];
    double now_s = seconds_of(t, tick);
    bst_task_end before = BST_TASK_NONE;
    bst_tasking_visibility seen;
    bst_tasking_choice chosen;
    if (s->task.object >= 0) {
        before = ending(t, s, now_s);
        if (before == BST_TASK_NONE) {
            return BST_OK;
        }
        t->holder[s->task.object] = -1;
        bst_tasking_take_track(t, sensor);
        if (before != BST_TASK_DONE) {
            *not_before(t, sensor, s->task.object) = (float)(now_s + t->config.retry_s);
        }
    }
    BST_TRY(choose_target(ctx, t, sensor, now_s, &chosen, &seen));
    if (chosen.object >= 0) {
        assign_task(t, sensor, tick, before, &chosen, &seen);
        *given = true;
    } else {
        *given = s->task.object >= 0;
        if (*given) {
            assign_task(t, sensor, tick, before, NULL, NULL);
        }
        s->next_plan_s = now_s + t->config.replan_interval_s;
    }
    return BST_OK;
}

bst_status bst_tasking_plan(bst_ctx *ctx, bst_tasking *t, int sensor, int64_t tick, bool *given) {
    assert(t && given && sensor >= 0 && sensor < t->sensor_count);
    bst_tasking_sensor *s = &t->sensors[sensor];
    double now_s = seconds_of(t, tick);
    *given = false;
    if (!s->nav_known || (s->task.object < 0 && now_s < s->next_plan_s)) {
        return BST_OK;
    }
    if (tick >= s->quiet_until) {
        BST_TRY(change(ctx, t, sensor, tick, given));
    }
    int64_t until = (int64_t)fmin(certain_until_s(t, s, now_s) * t->tick_rate_hz, 9e15);
    s->quiet_until = until > s->quiet_until ? until : s->quiet_until;
    return BST_OK;
}
