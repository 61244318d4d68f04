/* Exports orbits of a run as OEM or CZML, recomputed from its scenario.json: true orbits, and
 * observers' orbits by onboard navigation. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cjson/cJSON.h>

#include "sim/cli/progress.h"
#include "sim/core/compare.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/export/orbit_selection.h"
#include "sim/io/czml_writer.h"
#include "sim/io/draft_file.h"
#include "sim/io/oem_writer.h"
#include "sim/run/run_observations.h"
#include "sim/world/world.h"

/* Simulated seconds in the run. */
static double recorded_s(const bst_run_reader *run, const bst_scenario *scenario) {
    if (bst_run_reader_state(run) == BST_RUN_COMPLETE) {
        return scenario->duration_s;
    }
    int64_t tick = bst_run_reader_int(run, "SELECT max(end_tick) FROM frames", 0, 0);
    int64_t control = bst_run_reader_int(run, "SELECT max(tick) FROM control", 0, 0);
    return (double)(control > tick ? control : tick) / (double)scenario->tick_rate_hz;
}

/* ------------------------------------------------------------------ orbits */

enum { MOST_BREAKS = 4096, MOST_KEPT_ROWS = 65536 };
/* Least number of rows of a piece: those that interpolation of an OEM takes. */
enum { LEAST_ROWS = 10 };
/* Least time between an end of a piece and a time of the grid, in steps of the grid. */
static const double LEAST_INTERVAL = 0.1;

/* An orbit between two burns, sampled at a grid of times. */
typedef struct track {
    bst_world_view *view;
    const bst_world *world;
    int observer, object; /* the other one is -1 */
    int sensor;           /* sensor whose onboard navigation is exported; -1: the truth */
    double step_s, span_s;
    double breaks[MOST_BREAKS + 2]; /* 0, starts and ends of burns, end of the run */
    int break_count;
    double from_s, to_s;     /* of the piece */
    double origin_s, grid_s; /* of the grid; grid_s: step_s, or less in a short piece */
    int64_t rows;            /* of the piece */
    int64_t inner;           /* number of the grid's step at the second row */
    int64_t first;           /* first row of a series within the piece */
    bst_world_state *kept;   /* cached first rows of the piece, up to MOST_KEPT_ROWS; NULL: none */
} track;

static bst_status state_of(const track *t, bst_ctx *ctx, double seconds, bst_world_state *out) {
    bst_bodies bodies;
    if (t->sensor >= 0) {
        return bst_world_view_nav(ctx, t->view, t->observer, t->sensor, seconds, out, &bodies);
    }
    return t->observer >= 0 ? bst_world_view_observer_state(ctx, t->view, t->observer, seconds, out)
                            : bst_world_view_object_state(ctx, t->view, t->object, seconds, out);
}

/* Begins a piece and returns its number of rows: its ends, and times of the grid between them,
 * which are multiples of the step, or equal parts of a short piece. None is next to an end: what 1
 * ns and 1 um round would grow with the ratio of the intervals. */
static int64_t begin_piece(track *t, double from_s, double to_s) {
    const double part_s = (to_s - from_s) / (LEAST_ROWS - 1);
    t->from_s = from_s;
    t->to_s = to_s;
    t->grid_s = fmin(t->step_s, part_s);
    t->origin_s = t->step_s > part_s ? from_s : 0.0;
    t->inner = (int64_t)ceil((from_s - t->origin_s) / t->grid_s + LEAST_INTERVAL);
    int64_t last = (int64_t)floor((to_s - t->origin_s) / t->grid_s - LEAST_INTERVAL);
    t->rows = 2 + (last >= t->inner ? last - t->inner + 1 : 0);
    return t->rows;
}

static double seconds_of(const track *t, int64_t row) {
    return row == 0             ? t->from_s
           : row == t->rows - 1 ? t->to_s
                                : t->origin_s + (double)(t->inner + row - 1) * t->grid_s;
}

/* State of a row; at the end of a piece, the state before a burn. */
static bst_status row_state(const track *t, bst_ctx *ctx, double seconds, bst_world_state *out) {
    if (seconds < t->to_s || t->to_s >= t->span_s) {
        return state_of(t, ctx, seconds, out);
    }
    const double before_s = 1e-6;
    BST_TRY(state_of(t, ctx, seconds - before_s, out));
    out->position_m = bst_vec3_axpy(out->position_m, before_s, out->velocity_mps);
    return BST_OK;
}

static bst_status row_of(void *user, bst_ctx *ctx, int64_t row, bst_time *time,
                         bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    const track *t = user;
    bst_world_state state;
    row += t->first;
    double seconds = seconds_of(t, row);
    if (t->kept && row < MOST_KEPT_ROWS) {
        state = t->kept[row];
    } else {
        BST_TRY(row_state(t, ctx, seconds, &state));
    }
    *time = bst_world_time(t->world, seconds);
    *position_m = state.position_m;
    *velocity_mps = state.velocity_mps;
    return BST_OK;
}

static void add_break(track *t, double seconds) {
    if (seconds > 0.0 && seconds < t->span_s && t->break_count < MOST_BREAKS) {
        t->breaks[t->break_count++] = seconds;
    }
}

/* Finds an object of the scenario by name; NULL: none. */
static const bst_object_config *find_object(const bst_scenario *scenario, const char *name) {
    const bst_object_config *objects = scenario->world.objects.items;
    for (int i = 0; i < scenario->world.objects.count; i++) {
        if (strcmp(objects[i].name, name) == 0) {
            return &objects[i];
        }
    }
    return NULL;
}

/* Collects the times at which an orbit is not smooth: its own burns and those of its reference
 * orbits. */
static void find_breaks(const bst_scenario *scenario, bool czml, track *t) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_object_config *object =
        t->object >= 0 ? find_object(scenario, bst_world_object(t->world, t->object)->name) : NULL;
    const bst_orbit_config *orbit = t->observer >= 0 ? &observers[t->observer].orbit
                                    : object         ? &object->orbit
                                                     : NULL;
    const bst_config_list *burns = t->observer >= 0 ? &observers[t->observer].burns
                                   : object         ? &object->burns
                                                    : NULL;
    t->break_count = 0;
    t->breaks[t->break_count++] = 0.0;
    /* CZML has only positions, which are continuous at a burn */
    for (int depth = 0; orbit && !czml && depth <= scenario->world.objects.count; depth++) {
        const bst_burn_config *list = burns->items;
        for (int k = 0; k < burns->count; k++) {
            add_break(t, list[k].time_s);
            add_break(t, list[k].time_s + list[k].duration_s);
        }
        object =
            orbit->source == BST_ORBIT_RELATIVE ? find_object(scenario, orbit->reference) : NULL;
        orbit = object ? &object->orbit : NULL;
        burns = object ? &object->burns : NULL;
    }
    qsort(t->breaks, (size_t)t->break_count, sizeof *t->breaks, bst_compare_doubles);
    t->breaks[t->break_count++] = t->span_s;
}

/* Writes `rows` rows from t->first on: the `piece`th interval in which the orbit exists. */
static bst_status write_piece(bst_ctx *ctx, const bst_export *e, FILE *stream, track *t,
                              int64_t rows, int piece) {
    const bst_world_object_info *info =
        t->object >= 0 ? bst_world_object(t->world, t->object) : NULL;
    const char *name = info ? info->name : bst_world_observer_name(t->world, t->observer);
    char id[96], number[24] = "";
    bst_state_series series = {.rows = rows, .state = row_of, .user = t};
    if (e->czml) {
        if (piece > 1) {
            snprintf(number, sizeof number, "/%d", piece);
        }
        snprintf(id, sizeof id, "%s/%s%s", info ? "object" : "observer", name, number);
        bst_czml_object object = {.id = id,
                                  .name = name,
                                  .label = true,
                                  .path_s = INFINITY,
                                  .rgba = {255, info ? 214 : 120, info ? 79 : 255, 255},
                                  .series = series};
        return bst_czml_write_object(ctx, stream, &object);
    }
    if (info && info->norad > 0) {
        snprintf(id, sizeof id, "NORAD-%d", info->norad);
    } else {
        snprintf(id, sizeof id, "%s", name);
    }
    bst_oem_segment segment = {.object_name = name,
                               .object_id = id,
                               .ref_frame = "GCRF",
                               .comment = info ? "true orbit of an object"
                                          : t->sensor >= 0
                                              ? "orbit of an observer, as it is known on board"
                                              : "true orbit of an observer",
                               .series = series};
    return bst_oem_write_segment(ctx, stream, &segment);
}

/* First row from `row` on without a state; those before it are kept. */
static int64_t rows_end(track *t, bst_ctx *ctx, int64_t row, int64_t rows) {
    bst_world_state state;
    while (row < rows && row_state(t, ctx, seconds_of(t, row), &state) == BST_OK) {
        if (t->kept && row < MOST_KEPT_ROWS) {
            t->kept[row] = state;
        }
        row++;
    }
    return row;
}

/* Writes an orbit between break k and the next, in pieces where it does not exist (decay, end of a
 * file). A piece of few rows is written on a finer grid. why: the first reason for which there is
 * no state, "": none. */
static bst_status write_between(bst_ctx *ctx, const bst_export *e, FILE *stream, track *t, int k,
                                int *pieces, char *why) {
    const double from_s = t->breaks[k], to_s = t->breaks[k + 1];
    int64_t rows = begin_piece(t, from_s, to_s);
    for (int64_t row = 0; row < rows;) {
        int64_t end = rows_end(t, ctx, row, rows), count = end - row;
        if (end < rows && !*why) {
            snprintf(why, sizeof ctx->message, "%s", ctx->message);
        }
        t->first = row;
        if (count > 1 && count < LEAST_ROWS && count < rows) {
            t->first = 0;
            count = begin_piece(t, seconds_of(t, row), seconds_of(t, end - 1));
            count = rows_end(t, ctx, 0, count);
        }
        if (count > 0) {
            BST_TRY(write_piece(ctx, e, stream, t, count, ++*pieces));
        }
        rows = begin_piece(t, from_s, to_s);
        row = end > row ? end : row + 1;
    }
    return BST_OK;
}

/* Writes one orbit in pieces: at burns, and where it does not exist. */
static bst_status write_one(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            FILE *stream, track *t, int *written) {
    int pieces = 0;
    char why[sizeof ctx->message] = "";
    find_breaks(scenario, e->czml, t);
    for (int k = 0; k + 1 < t->break_count; k++) {
        if (t->breaks[k + 1] > t->breaks[k]) { /* not two burns at the same time */
            BST_TRY(write_between(ctx, e, stream, t, k, &pieces, why));
        }
    }
    if (*why) {
        const char *name = t->object >= 0 ? bst_world_object(t->world, t->object)->name
                                          : bst_world_observer_name(t->world, t->observer);
        bst_log(ctx, BST_LOG_WARNING, "%s is left out%s: %s", name,
                pieces > 0 ? " where it has no orbit" : "", why);
    }
    *written += pieces > 0;
    return BST_OK;
}

/* Writes all observers and the selected objects. */
static bst_status write_tracks(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                               FILE *stream, track *t, const bst_orbit_selection *s, int *written) {
    int observers = bst_world_observer_count(t->world), objects = bst_world_object_count(t->world);
    int64_t done = 0;
    bst_progress progress;
    bst_progress_start(&progress, e->czml ? "orbits.czml" : "orbits.oem", "orbits",
                       observers + s->count);
    bst_status status = BST_OK;
    for (int i = 0; i < observers + objects && status == BST_OK; i++) {
        t->observer = i < observers ? i : -1;
        t->object = i < observers ? -1 : i - observers;
        if (t->object >= 0 && !s->chosen[t->object]) {
            continue;
        }
        status = bst_export_check(ctx);
        status = status == BST_OK ? write_one(ctx, e, scenario, stream, t, written) : status;
        bst_progress_update(&progress, ++done);
    }
    bst_progress_end(&progress);
    return status;
}

/* Objects and observers whose orbits are written. */
typedef struct scene {
    const bst_scenario *scenario;
    const bst_world *world;
    bst_world_view *view;
    const bst_orbit_selection *selection; /* of objects */
} scene;

/* Time between states, s: by default a twentieth of the run, at most a minute. */
static double step_of(const bst_export *e, double span_s) {
    return e->step_s > 0.0 ? e->step_s : fmin(60.0, span_s / 20.0);
}

static bst_status write_orbits(bst_ctx *ctx, const bst_export *e, const scene *in, FILE *stream,
                               int *written) {
    const bst_scenario *scenario = in->scenario;
    track t = {
        .view = in->view, .world = in->world, .sensor = -1, .span_s = recorded_s(e->run, scenario)};
    t.step_s = step_of(e, t.span_s);
    if (!(t.span_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: holds no time span to write orbits for",
                        bst_run_reader_folder(e->run));
    }
    if (e->czml) {
        BST_TRY(bst_czml_write_head(ctx, stream, scenario->name, bst_world_time(in->world, 0.0),
                                    bst_world_time(in->world, t.span_s), 1.0));
    } else {
        char created[32];
        bst_run_creation_date(created);
        BST_TRY(bst_oem_write_head(ctx, stream, created, "BORESIGHT",
                                   "true states of a simulated run"));
    }
    t.kept = malloc(MOST_KEPT_ROWS * sizeof *t.kept); /* without memory states are computed twice */
    bst_status status = write_tracks(ctx, e, scenario, stream, &t, in->selection, written);
    free(t.kept);
    if (status == BST_OK && e->czml) {
        status = bst_export_views(ctx, e, scenario, in->world, in->view, stream);
    }
    if (status == BST_OK && e->czml) {
        status = bst_czml_write_tail(ctx, stream);
    }
    return status;
}

/* Writes the observers' orbits by onboard navigation, of the first selected sensor. */
static bst_status write_believed(bst_ctx *ctx, const bst_export *e, const scene *in, FILE *stream,
                                 int *written) {
    const bst_scenario *scenario = in->scenario;
    track t = {
        .view = in->view, .world = in->world, .object = -1, .span_s = recorded_s(e->run, scenario)};
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    char created[32];
    int count;
    t.step_s = step_of(e, t.span_s);
    if (!(t.span_s > 0.0)) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: holds no time span to write orbits for",
                        bst_run_reader_folder(e->run));
    }
    BST_TRY(bst_run_sensors(ctx, e->run, e->sensor, sensors, &count));
    bst_run_creation_date(created);
    BST_TRY(bst_oem_write_head(ctx, stream, created, "BORESIGHT",
                               "states of a simulated run's observers as they are known on board"));
    const bst_run_scene run_scene = {.run = e->run, .scenario = *scenario};
    for (int i = 0; i < count; i++) {
        bool before = false;
        for (int k = 0; k < i; k++) {
            before = before || strcmp(sensors[k].observer, sensors[i].observer) == 0;
        }
        if (!before) {
            BST_TRY(bst_export_check(ctx));
            BST_TRY(bst_run_scene_find(ctx, &run_scene, &sensors[i], &t.observer, &t.sensor));
            BST_TRY(write_one(ctx, e, scenario, stream, &t, written));
        }
    }
    return BST_OK;
}

static bst_status orbits_of(bst_ctx *ctx, const bst_export *e, const bst_scenario *scenario,
                            bool believed) {
    char path[4096];
    bst_draft draft;
    bst_world *world = NULL;
    bst_world_view *view = NULL;
    bst_orbit_selection selection = {0};
    int written = 0;
    /* orbits do not need stars */
    bst_world_config config = scenario->world;
    config.faint_stars = BST_FAINT_NONE;
    snprintf(config.star_catalogue, sizeof config.star_catalogue, "embedded");
    int n = snprintf(path, sizeof path, "%s/%s.%s", e->out, believed ? "observers" : "orbits",
                     e->czml ? "czml" : "oem");
    if (n < 0 || (size_t)n >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", e->out);
    }
    BST_TRY(bst_world_create(ctx, scenario->file, &config, &scenario->observers, scenario->base_dir,
                             scenario->epoch, &world));
    bst_status status = bst_world_view_create(ctx, world, &view);
    if (status == BST_OK && !believed) {
        status = bst_orbit_selection_make(ctx, e->run, world, e->objects, &selection);
    }
    if (status == BST_OK) {
        status = bst_draft_open(ctx, path, &draft);
    }
    if (status == BST_OK) {
        const scene in = {scenario, world, view, &selection};
        status = (believed ? write_believed : write_orbits)(ctx, e, &in, draft.stream, &written);
        status = bst_draft_close(ctx, &draft, status);
    }
    if (status == BST_OK) {
        printf("%s: %s", path,
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, written, "orbit", "orbits"));
        if (selection.left_out > 0) {
            printf("; %s that came into no field %s left out (--objects all)",
                   bst_text_of_count((char[BST_COUNT_TEXT]){0}, selection.left_out, "object",
                                     "objects"),
                   selection.left_out == 1 ? "is" : "are");
        }
        printf("\n");
    }
    bst_orbit_selection_free(&selection);
    bst_world_view_free(view);
    bst_world_free(world);
    return status;
}

static bst_status export_orbits(bst_ctx *ctx, const bst_export *e, bool believed) {
    bst_json *json;
    bst_scenario scenario;
    bst_status status = bst_run_recorded_scenario(ctx, e->run, &json, &scenario);
    if (status == BST_OK) {
        status = orbits_of(ctx, e, &scenario, believed);
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}

bst_status bst_export_orbits(bst_ctx *ctx, const bst_export *e) {
    return export_orbits(ctx, e, false);
}

bst_status bst_export_observers(bst_ctx *ctx, const bst_export *e) {
    bst_export oem = *e;
    oem.czml = false;
    return export_orbits(ctx, &oem, true);
}
