#include "sim/run/run_sightings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"

struct bst_run_sightings {
    const bst_world *world;
    bst_sightings *sightings;
    bst_io_table *passes, *sums;
};

#define INT(name, unit, doc) \
    { name, BST_COLUMN_INT, unit, doc }
#define REAL(name, unit, doc) \
    { name, BST_COLUMN_REAL, unit, doc }
#define OBJECT                                               \
    INT("object", "", "index in the scenario: id in truth"), \
        {"name", BST_COLUMN_TEXT, "", "name of the object"}, \
        INT("norad", "", "catalogue number, 0: none")
#define ERRORS                                                                               \
    REAL("place_rms_arcsec", "arcsec", "detections by the attitude from stars, from truth"), \
        REAL("place_most_arcsec", "arcsec", "the greatest"),                                 \
        REAL("track_rms_arcsec", "arcsec", "confirmed tracks, from truth"),                  \
        REAL("track_most_arcsec", "arcsec", "the greatest")

static const bst_io_column pass_columns[] = {
    INT("sensor", "", "row of the table sensors"),
    OBJECT,
    REAL("start_s", "s", "middle of the first frame with the object, since the epoch"),
    REAL("end_s", "s", "the same of the last frame"),
    INT("frames", "", "frames with the object in the field, not behind the Earth"),
    INT("lit", "", "frames with light from the object"),
    INT("detected", "", "frames in which it was detected"),
    INT("tracked", "", "frames with a confirmed track of the object"),
    INT("target", "", "of these, with the track of interest"),
    REAL("first_s", "s", "first detection; NULL: none"),
    REAL("last_s", "s", "last detection"),
    REAL("snr", "", "greatest true signal to noise of a frame"),
    REAL("v_mag", "mag", "brightness in that frame"),
    REAL("range_m", "m", "shortest range"),
    ERRORS,
};

static const bst_io_column sum_columns[] = {
    INT("sensor", "", "row of the table sensors; NULL: all of them together"),
    OBJECT,
    INT("passes", "", "passes through the field, separated by 60 s or more outside"),
    INT("passes_seen", "", "passes with a detection"),
    INT("frames", "", "frames with the object in the field"),
    INT("lit", "", "frames with light from the object"),
    INT("detected", "", "frames in which it was detected"),
    INT("tracked", "", "frames with a confirmed track of the object"),
    REAL("first_s", "s", "first detection; NULL: none"),
    REAL("last_s", "s", "last detection"),
    INT("revisits", "", "detections after a gap of more than 60 s"),
    REAL("revisit_mean_s", "s", "mean duration of these gaps"),
    REAL("revisit_most_s", "s", "longest of these gaps"),
    REAL("longest_gap_s", "s",
         "longest time without a detection, including start and end of the run"),
    REAL("custody_s", "s",
         "object custody: time within record/custody_timeout_s after a detection"),
    REAL("custody_fraction", "", "the same over the run's length"),
    REAL("snr", "", "greatest true signal to noise of a frame"),
    ERRORS,
};

enum { ROW = 24 };
typedef struct row {
    bst_io_value values[ROW];
    int count;
} row;

static void put_int(row *r, int64_t value) {
    r->values[r->count++] = (bst_io_value){.type = BST_COLUMN_INT, .as.integer = value};
}
static void put_real(row *r, double value) {
    r->values[r->count++] =
        (bst_io_value){.type = BST_COLUMN_REAL, .is_null = !isfinite(value), .as.real = value};
}

/* Adds index, name and catalogue number of an object to the table row. */
static void put_object(row *r, const bst_world *world, int object) {
    const bst_world_object_info *info = bst_world_object(world, object);
    put_int(r, object);
    r->values[r->count++] = (bst_io_value){.type = BST_COLUMN_TEXT, .as.text = info->name};
    put_int(r, info->norad);
}

/* Adds RMS and maximum of the position and track errors to the table row. */
static void put_errors(row *r, const bst_sighting_error *place, const bst_sighting_error *track) {
    put_real(r, bst_sighting_rms(place));
    put_real(r, place->count > 0 ? place->greatest : NAN);
    put_real(r, bst_sighting_rms(track));
    put_real(r, track->count > 0 ? track->greatest : NAN);
}

/* Writes a pass of an object through a field of view to the table passes. */
static bst_status take_pass(void *user, bst_ctx *ctx, const bst_eval_pass *p) {
    bst_run_sightings *s = user;
    row r = {.count = 0};
    if (!s->passes) {
        return BST_OK;
    }
    put_int(&r, p->sensor);
    put_object(&r, s->world, p->object);
    put_real(&r, p->start_s);
    put_real(&r, p->end_s);
    put_int(&r, p->frames);
    put_int(&r, p->lit);
    put_int(&r, p->detected);
    put_int(&r, p->tracked);
    put_int(&r, p->target);
    put_real(&r, p->first_s);
    put_real(&r, p->last_s);
    put_real(&r, p->snr);
    put_real(&r, p->v_mag);
    put_real(&r, p->range_m);
    put_errors(&r, &p->place, &p->track);
    return bst_io_table_append(ctx, s->passes, r.values);
}

typedef struct summing {
    bst_run_sightings *sightings;
    double end_s;
} summing;

/* Writes the sums of an object and sensor to the table sightings. */
static bst_status take_sum(void *user, bst_ctx *ctx, const bst_sighting *sum) {
    const summing *u = user;
    row r = {.count = 0};
    put_int(&r, sum->sensor);
    r.values[0].is_null = sum->sensor < 0;
    put_object(&r, u->sightings->world, sum->object);
    put_int(&r, sum->passes);
    put_int(&r, sum->passes_seen);
    put_int(&r, sum->frames);
    put_int(&r, sum->lit);
    put_int(&r, sum->detected);
    put_int(&r, sum->tracked);
    put_real(&r, sum->first_s);
    put_real(&r, sum->last_s);
    put_int(&r, sum->revisits);
    put_real(&r, sum->revisits > 0 ? sum->revisit_sum_s / (double)sum->revisits : NAN);
    put_real(&r, sum->revisits > 0 ? sum->revisit_most_s : NAN);
    put_real(&r, sum->longest_gap_s);
    put_real(&r, sum->custody_s);
    put_real(&r, sum->custody_s / u->end_s);
    put_real(&r, sum->snr);
    put_errors(&r, &sum->place, &sum->track);
    return bst_io_table_append(ctx, u->sightings->sums, r.values);
}

bst_status bst_run_sightings_create(bst_ctx *ctx, const bst_world *world,
                                    const bst_recorder_config *record, int64_t tick_rate_hz,
                                    bst_run *store, bst_run_sightings **out) {
    *out = NULL;
    if (!record->sightings || bst_world_object_count(world) == 0) {
        return BST_OK;
    }
    bst_run_sightings *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for who sees what");
    }
    s->world = world;
    bst_status status = bst_sightings_create(ctx, world, tick_rate_hz, record->custody_timeout_s,
                                             take_pass, s, &s->sightings);
    if (status == BST_OK && store) {
        status = bst_io_table_create(ctx, store, "passes", "Objects in the field of a sensor.",
                                     pass_columns, sizeof pass_columns / sizeof *pass_columns,
                                     &s->passes);
    }
    if (status == BST_OK && store) {
        status = bst_io_table_create(
            ctx, store, "sightings",
            "Sums over the passes of each object, per sensor and for all sensors.", sum_columns,
            sizeof sum_columns / sizeof *sum_columns, &s->sums);
    }
    if (status != BST_OK) {
        bst_run_sightings_free(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_run_sightings_free(bst_run_sightings *s) {
    if (s) {
        bst_sightings_free(s->sightings);
        free(s);
    }
}

bst_status bst_run_sightings_archive(bst_run_sightings *s, bst_archive *archive) {
    return s ? bst_sightings_archive(s->sightings, archive) : BST_OK;
}

bst_status bst_run_sightings_message(bst_ctx *ctx, bst_run_sightings *s, int sensor,
                                     const char *channel, const void *payload) {
    if (!s) {
        return BST_OK;
    }
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        return bst_sightings_truth(ctx, s->sightings, sensor, payload);
    }
    if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        bst_sightings_detections(s->sightings, sensor, payload);
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        bst_sightings_tracks(s->sightings, sensor, payload);
    } else if (strcmp(channel, BST_CHANNEL_TASK) == 0) {
        bst_sightings_task(s->sightings, payload);
    }
    return BST_OK;
}

bst_status bst_run_sightings_finish(bst_ctx *ctx, bst_run_sightings *s, double end_s) {
    if (!s || !(end_s > 0.0)) {
        return BST_OK;
    }
    summing u = {s, end_s};
    BST_TRY(bst_sightings_finish(ctx, s->sightings, end_s));
    return s->sums ? bst_sightings_each(ctx, s->sightings, take_sum, &u) : BST_OK;
}

bool bst_run_sightings_figures(const bst_run_sightings *s, bst_sightings_figures *out) {
    *out = (bst_sightings_figures){0};
    if (s) {
        bst_sightings_summary(s->sightings, out);
    }
    return s != NULL;
}

void bst_run_sightings_add(const bst_run_sightings *s, cJSON *manifest) {
    if (!s) {
        return;
    }
    bst_sightings_figures f;
    bst_sightings_summary(s->sightings, &f);
    cJSON *node = cJSON_AddObjectToObject(manifest, "sightings");
    cJSON_AddNumberToObject(node, "objects", (double)f.objects);
    cJSON_AddNumberToObject(node, "objects_in_field", (double)f.in_field);
    cJSON_AddNumberToObject(node, "objects_seen", (double)f.seen);
    cJSON_AddNumberToObject(node, "passes", (double)f.passes);
    cJSON_AddNumberToObject(node, "passes_seen", (double)f.passes_seen);
    cJSON_AddNumberToObject(node, "detections", (double)f.detections);
    cJSON_AddNumberToObject(node, "revisits", (double)f.revisits);
    bst_json_add_number(node, "revisit_mean_s", f.revisit_mean_s);
    bst_json_add_number(node, "revisit_most_s", f.revisit_most_s);
    bst_json_add_number(node, "longest_gap_mean_s", f.gap_mean_s);
    bst_json_add_number(node, "custody_fraction_seen", f.custody_fraction);
    bst_json_add_number(node, "custody_fraction_all", f.custody_fraction_all);
    bst_json_add_number(node, "place_rms_arcsec", f.place_rms_arcsec);
    bst_json_add_number(node, "track_rms_arcsec", f.track_rms_arcsec);
    cJSON_AddNumberToObject(node, "tasks", (double)f.tasks);
    cJSON_AddNumberToObject(node, "tasks_done", (double)f.tasks_done);
    cJSON_AddNumberToObject(node, "tasks_not_found", (double)f.tasks_not_found);
    cJSON_AddNumberToObject(node, "tasks_lost", (double)f.tasks_lost);
}

/* Prints a figure of the sightings with its unit. */
static void print(const char *name, double value, const char *unit) {
    char text[48] = "-";
    if (isfinite(value)) {
        snprintf(text, sizeof text, floor(value) == value ? "%.0f" : "%.3f", value);
    }
    printf("  %-28s %12s %s\n", name, text, unit);
}

void bst_run_sightings_print(const bst_run_sightings *s) {
    bst_sightings_figures f;
    (void)bst_run_sightings_figures(s, &f);
    if (f.objects < 2) {
        return; /* for one object the rows of the sensors suffice */
    }
    printf("objects\n");
    print("in the scenario", (double)f.objects, "");
    print("in a field", (double)f.in_field, "");
    print("seen", (double)f.seen, "");
    print("passes seen", (double)f.passes_seen, "");
    print("mean time between passes", f.revisit_mean_s, "s");
    print("object custody", 100.0 * f.custody_fraction_all, "% of the time, mean of all");
    print("detections against truth", f.place_rms_arcsec, "arcsec RMS");
    print("tracks against truth", f.track_rms_arcsec, "arcsec RMS");
    if (f.tasks > 0) {
        print("tasks", (double)f.tasks, "");
        print("tasks done", (double)f.tasks_done, "");
        print("targets not found", (double)f.tasks_not_found, "");
        print("targets lost", (double)f.tasks_lost, "");
    }
}
