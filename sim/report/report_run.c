#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/core/json_member.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/report/report.h"

enum { MOST_EVENTS = 400 };

typedef struct page {
    FILE *out;
    bst_run_reader *run;
    bst_run_scene scene;
    bool has_scene;
    bst_run_sensor list[BST_EXPORT_SENSORS];
    bst_report_sensor sensors[BST_EXPORT_SENSORS];
    int count;
    double span_s; /* simulated duration so far */
    bst_report_warnings warnings;
} page;

/* Summary of a sensor in the manifest; NULL: none. */
static const cJSON *summary_of(const page *p, int i) {
    const cJSON *manifest = bst_run_reader_manifest(p->run);
    const cJSON *own = bst_json_member(bst_json_member(manifest, "sensors"), p->sensors[i].name);
    return own ? own : i == 0 ? bst_json_member(manifest, "summary") : NULL;
}

/* ------------------------------------------------------------------ reading */

/* Simulated duration of the run in s; of a run that ended early, up to its last tick. */
static double span_of(const bst_run_reader *run) {
    const cJSON *manifest = bst_run_reader_manifest(run), *scenario = bst_run_reader_scenario(run);
    double rate = bst_json_member_number(scenario, "tick_rate_hz"),
           whole = bst_json_member_number(scenario, "duration_s");
    if (bst_run_reader_state(run) == BST_RUN_COMPLETE) {
        return whole;
    }
    double last = bst_json_member_number(manifest, "last_tick");
    if (isnan(last)) {
        static const char *const sources[] = {"SELECT max(end_tick) FROM frames",
                                              "SELECT max(end_tick) FROM exposures",
                                              "SELECT max(tick) FROM control"};
        for (int k = 0; k < 3; k++) {
            last = fmax(last, (double)bst_run_reader_int(run, sources[k], 0, -1));
        }
    }
    return rate > 0.0 ? (last + 1.0) / rate : whole;
}

/* Reads the sensors of the run with the data of their report. */
static bst_status read_sensors(bst_ctx *ctx, page *p) {
    int count = 0;
    bst_ctx unheard = {0};
    if (!bst_run_reader_has_tables(p->run) ||
        bst_run_sensors(&unheard, p->run, NULL, p->list, &count) != BST_OK) {
        count = 0;
    }
    for (int i = 0; i < count; i++) {
        bst_report_sensor *s = &p->sensors[i];
        /* the key in the summary is the sensor's name */
        snprintf(s->name, sizeof s->name, "%s/%s", p->list[i].observer, p->list[i].name);
        BST_TRY(bst_report_read(ctx, p->run, p->has_scene ? &p->scene : NULL, &p->list[i],
                                summary_of(p, i), s));
        p->count = i + 1;
        if (s->damaged) {
            bst_run_reader_note_problem(p->run, "run.sqlite is damaged: of %s not all can be shown",
                                        s->name);
        }
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ the head */

/* Writes the run's state, folder and description. */
static void put_head(const page *p) {
    static const char *const classes[] = {[BST_RUN_COMPLETE] = "good",
                                          [BST_RUN_INTERRUPTED] = "bad",
                                          [BST_RUN_RUNNING] = "fair",
                                          [BST_RUN_KILLED] = "bad"};
    const cJSON *scenario = bst_run_reader_scenario(p->run);
    char name[256];
    bst_run_state state = bst_run_reader_state(p->run);
    fprintf(p->out, "<p class=\"sub\"><span class=\"badge %s\">%s</span> Folder ", classes[state],
            bst_run_state_name(state));
    bst_html_text(p->out, bst_report_folder(p->run, name));
    fputs("</p>\n", p->out);
    const char *description = bst_json_member_text(scenario, "description", "");
    if (description[0]) {
        fputs("<p>", p->out);
        bst_html_text(p->out, description);
        fputs("</p>\n", p->out);
    }
}

/* Writes rows with the UTC of start and end and the duration of the run. */
static void put_times(const page *p) {
    const cJSON *scenario = bst_run_reader_scenario(p->run);
    bst_time epoch;
    char from[40] = "-", to[40] = "-";
    if (bst_run_reader_epoch(p->run, &epoch)) {
        bst_time_to_utc(epoch, 3, from, sizeof from);
        if (isfinite(p->span_s)) {
            bst_time_to_utc(bst_time_add(epoch, p->span_s), 3, to, sizeof to);
        }
    }
    bst_report_page_row(p->out, "from (UTC)", "%s", from);
    bst_report_page_row(p->out, "to (UTC)", "%s", to);
    double whole = bst_json_member_number(scenario, "duration_s");
    if (bst_run_reader_state(p->run) == BST_RUN_COMPLETE) {
        bst_report_page_row(p->out, "duration", "%.9g s", p->span_s);
    } else {
        bst_report_page_row(p->out, "duration", "%.9g s of %.9g s", p->span_s, whole);
    }
}

/* Writes rows with the scenario's objects and catalogues. */
static void put_objects(const page *p) {
    const cJSON *world = bst_json_member(bst_run_reader_scenario(p->run), "world"),
                *objects = bst_json_member(world, "objects"), *object;
    int count = cJSON_GetArraySize(objects), shown = 0;
    char names[600] = "";
    cJSON_ArrayForEach(object, objects) {
        size_t n = strlen(names);
        if (shown++ < 8) {
            snprintf(names + n, sizeof names - n, "%s%.60s", n ? ", " : "",
                     bst_json_member_text(object, "name", "?"));
        }
    }
    const cJSON *catalogues = bst_json_member(world, "catalogues"), *catalogue;
    if (count > 0 || cJSON_GetArraySize(catalogues) == 0) {
        bst_report_page_row(p->out, "objects", "%d%s%s%s", count, count ? ": " : "", names,
                            count > 8 ? " ..." : "");
    }
    cJSON_ArrayForEach(catalogue, catalogues) {
        const char *file = bst_json_member_text(catalogue, "elements_file", "?"),
                   *slash = strrchr(file, '/');
        bst_report_page_row(p->out, count > 0 ? "and all of" : "objects: all of", "%s",
                            slash ? slash + 1 : file);
    }
}

static void put_identity(const page *p) {
    const cJSON *manifest = bst_run_reader_manifest(p->run),
                *scenario = bst_run_reader_scenario(p->run);
    bst_report_page_section(p->out, 2, "What was run");
    fputs("<div class=\"scroll\" tabindex=\"0\"><table class=\"two\">\n", p->out);
    bst_report_page_row(
        p->out, "scenario", "%s",
        bst_json_member_text(scenario, "name", bst_json_member_text(manifest, "scenario", "-")));
    bst_report_page_row(p->out, "scenario file", "%s",
                        bst_json_member_text(manifest, "scenario_file", "-"));
    put_times(p);
    bst_report_page_row(p->out, "program", "Boresight %s",
                        bst_json_member_text(manifest, "version", "(version unknown)"));
    bst_report_page_row(p->out, "git revision", "%s",
                        bst_json_member_text(manifest, "git_revision", "-"));
    const cJSON *identity = manifest ? manifest : scenario;
    bst_report_page_row(p->out, "seed", "%s, run %.0f", bst_json_member_text(identity, "seed", "-"),
                        isfinite(bst_json_member_number(identity, "run"))
                            ? bst_json_member_number(identity, "run")
                            : 0.0);
    const char *device = bst_json_member_text(manifest, "device", "");
    bst_report_page_row(p->out, "device", "%s",
                        device[0] || !manifest ? device : "none: no images");
    if (isfinite(bst_json_member_number(manifest, "stars"))) {
        bst_report_page_row(p->out, "star catalogue", "%s, %.0f stars",
                            bst_json_member_text(manifest, "star_catalogue", ""),
                            bst_json_member_number(manifest, "stars"));
    }
    put_objects(p);
    for (int i = 0; i < p->count; i++) {
        const bst_report_sensor *s = &p->sensors[i];
        bst_report_page_row(p->out, i == 0 ? "sensors" : "",
                            "%s: %" PRId64 " × %" PRId64 " px of %.4g arcsec%s%s", s->name,
                            s->width_px, s->height_px, s->pixel_scale_arcsec,
                            s->sensor.target[0] ? ", target " : "", s->sensor.target);
    }
    if (isfinite(bst_json_member_number(manifest, "wall_time_s"))) {
        bst_report_page_row(p->out, "wall time", "%.3g s",
                            bst_json_member_number(manifest, "wall_time_s"));
    }
    fputs("</table></div>\n", p->out);
    bst_report_page_section_end(p->out);
}

/* ------------------------------------------------------------------ headline figures */

static int64_t count_of(const page *p, const char *sql, int sensor) {
    return bst_run_reader_int(p->run, sql, p->sensors[sensor].sensor.index, 0);
}

/* Writes the scores of all tracks against all objects in the field. */
static void put_scores(FILE *out, const bst_report_sensor *s) {
    char text[32], note[200], word[32], switches[64], ghosts[64];
    if (s->scored_frames == 0 || !isfinite(s->gospa_px)) {
        return;
    }
    snprintf(note, sizeof note, "all tracks against all objects; OSPA(2) %s px",
             bst_report_page_number(word, s->ospa2_px, 3));
    bst_report_page_card(out, bst_report_page_number(text, s->gospa_px, 3), "px", "GOSPA", note);
    if (isfinite(s->track_purity)) {
        snprintf(note, sizeof note, "%s, %s",
                 bst_text_of_count(switches, s->id_switches, "change of identity",
                                   "changes of identity"),
                 bst_text_of_count(ghosts, s->ghosts, "ghost", "ghosts"));
        bst_report_page_card(out, bst_report_page_number(text, 100.0 * s->track_purity, 4), "%",
                             "track purity", note);
    }
}

/* Writes the key figures of a sensor: custody, acquisition, pointing, detections, speed. */
static void put_cards(const page *p, int i) {
    const bst_report_sensor *s = &p->sensors[i];
    const bst_loop_figures *f = &s->loop;
    char text[32], note[160], words[2][32];
    fputs("<div class=\"cards\">\n", p->out);
    if (s->sensor.target[0] && s->has_tracks) {
        snprintf(note, sizeof note, "of the visible frames in track; %s %% from acquisition on",
                 bst_report_page_number(words[0], 100.0 * f->track_fraction, 4));
        bst_report_page_card(p->out, bst_report_page_number(text, 100.0 * f->custody, 4), "%",
                             "custody", note);
        snprintf(note, sizeof note, "confirmed after %s s, settled after %s s",
                 bst_report_page_number(words[0], f->time_to_confirm_s, 4),
                 bst_report_page_number(words[1], f->time_to_settle_s, 4));
        bst_report_page_card(p->out, bst_report_page_number(text, f->time_to_acquire_s, 4), "s",
                             "time to acquire", note);
        snprintf(note, sizeof note, "99 %% below %s px, bias %s px",
                 bst_report_page_number(words[0], f->pointing_p99_px, 3),
                 bst_report_page_number(words[1], f->pointing_bias_px, 2));
        bst_report_page_card(p->out, bst_report_page_number(text, f->pointing_rms_px, 3), "px",
                             "pointing RMS", note);
        bst_report_page_card(p->out, f->final_mode >= 0 ? bst_mode_name(f->final_mode) : "-", "",
                             "mode at the end", "");
    }
    put_scores(p->out, s);
    snprintf(text, sizeof text, "%" PRId64, f->frames);
    bst_report_page_card(p->out, text, "", "exposures", "");
    int64_t frames = count_of(p, "SELECT count(*) FROM detection_frames WHERE sensor = ?1", i);
    if (frames > 0) {
        int64_t all =
            count_of(p, "SELECT sum(detections) FROM detection_frames WHERE sensor = ?1", i);
        snprintf(text, sizeof text, "%" PRId64, all);
        snprintf(note, sizeof note, "%s a frame",
                 bst_report_page_number(words[0], (double)all / (double)frames, 3));
        bst_report_page_card(p->out, text, "", "detections", note);
    }
    if (isfinite(s->real_time_factor)) {
        bst_report_page_card(p->out, bst_report_page_number(text, s->real_time_factor, 3), "×",
                             "speed", "simulated time over wall time");
    }
    fputs("</div>\n", p->out);
}

/* ------------------------------------------------------------------ events */

static void put_event(FILE *out, const bst_io_rows *rows) {
    fprintf(out, "<tr><td class=\"n\">%.3f</td><td>", bst_io_rows_real(rows, 0));
    for (int k = 1; k < 5; k++) {
        char utc[32];
        snprintf(utc, sizeof utc, "%.19s", bst_io_rows_text(rows, 1));
        bst_html_text(out, k == 1 ? utc : bst_io_rows_text(rows, k));
        fputs(k < 4 ? "</td><td>" : "</td></tr>\n", out);
    }
}

static bst_status put_events(bst_ctx *ctx, const page *p) {
    bst_ctx unheard = {0};
    bst_io_rows *rows;
    bool more;
    int64_t total = bst_run_reader_int(p->run, "SELECT count(*) FROM events", 0, 0), shown = 0;
    bst_report_page_section(p->out, 2, "Events");
    if (total == 0 || bst_io_rows_open(&unheard, p->run,
                                       "SELECT time_s, utc(time_s), source, kind, text FROM events"
                                       " ORDER BY tick, rowid",
                                       0, 0, &rows) != BST_OK) {
        fputs("<p class=\"note\">No events are recorded.</p>\n", p->out);
        bst_report_page_section_end(p->out);
        return BST_OK;
    }
    fprintf(p->out, "<details%s><summary>%s</summary>\n", total <= 40 ? " open=\"open\"" : "",
            bst_text_of_count((char[BST_COUNT_TEXT]){0}, total, "event", "events"));
    fputs(
        "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr><th "
        "class=\"n\">s</th><th>UTC</th>"
        "<th>from</th><th>kind</th><th>what</th></tr></thead>\n<tbody>\n",
        p->out);
    bst_status status;
    while ((status = bst_io_rows_next(&unheard, rows, &more)) == BST_OK && more) {
        /* of very many events, show the first and last ones */
        bool middle =
            total > MOST_EVENTS && shown >= MOST_EVENTS / 2 && shown < total - MOST_EVENTS / 2;
        if (!middle) {
            put_event(p->out, rows);
        } else if (shown == MOST_EVENTS / 2) {
            fprintf(p->out, "<tr><td colspan=\"5\">%" PRId64 " events more</td></tr>\n",
                    total - MOST_EVENTS);
        }
        shown++;
    }
    bst_io_rows_close(rows);
    fputs("</tbody></table></div>\n</details>\n", p->out);
    if (status == BST_ERR_FORMAT) {
        fputs("<p class=\"bad\">The table is damaged beyond here.</p>\n", p->out);
        bst_run_reader_note_problem(p->run, "%s", unheard.message);
        status = BST_OK;
    }
    bst_report_page_section_end(p->out);
    return status == BST_OK ? BST_OK : bst_fail(ctx, status, "%s", unheard.message);
}

/* ------------------------------------------------------------------ all of it */

static bst_status put_sensor(bst_ctx *ctx, const page *p, int i) {
    const bst_report_sensor *s = &p->sensors[i];
    char heading[200];
    snprintf(heading, sizeof heading, "Sensor %s", s->name);
    bst_report_page_section(p->out, 2, heading);
    put_cards(p, i);
    BST_TRY(bst_report_plots(ctx, p->out, s, p->span_s));
    BST_TRY(bst_report_wheels(ctx, p->out, p->run, s->sensor.index, p->span_s));
    bst_report_page_section(p->out, 3, "Frames");
    BST_TRY(bst_report_frames(ctx, p->out, p->run, s));
    bst_report_page_section_end(p->out);
    bst_report_page_section_end(p->out);
    return BST_OK;
}

/* Writes the summary of a run without tables. */
static void put_summary(const page *p) {
    const cJSON *summary = bst_json_member(bst_run_reader_manifest(p->run), "summary"), *item;
    bst_report_page_section(p->out, 2, "Summary");
    fputs("<table class=\"two\">\n", p->out);
    cJSON_ArrayForEach(item, summary) {
        char text[32];
        bst_report_page_row(
            p->out, item->string, "%s",
            cJSON_IsString(item)
                ? item->valuestring
                : bst_report_page_number(text, cJSON_IsNumber(item) ? item->valuedouble : NAN, 6));
    }
    fputs("</table>\n", p->out);
    bst_report_page_section_end(p->out);
}

static bst_status put_page(bst_ctx *ctx, page *p) {
    char title[200], nonce[BST_SHA256_TEXT];
    const cJSON *scenario = bst_run_reader_scenario(p->run),
                *manifest = bst_run_reader_manifest(p->run);
    snprintf(
        title, sizeof title, "Run of %.150s",
        bst_json_member_text(scenario, "name",
                             bst_json_member_text(manifest, "scenario", "an unknown scenario")));
    BST_TRY(bst_report_page_nonce(ctx, manifest, title, nonce));
    bst_report_page_begin(p->out, title, nonce);
    put_head(p);
    bst_report_warnings_write(p->out, &p->warnings);
    put_identity(p);
    bst_status status = bst_report_sightings(ctx, p->out, p->run, p->span_s);
    status = status == BST_OK ? bst_report_custody(ctx, p->out, p->run, p->span_s) : status;
    if (status != BST_OK && status != BST_ERR_FORMAT) {
        return status;
    }
    if (status == BST_ERR_FORMAT) {
        bst_run_reader_note_problem(p->run, "%s", ctx->message);
    }
    for (int i = 0; i < p->count; i++) {
        BST_TRY(bst_export_check(ctx));
        BST_TRY(put_sensor(ctx, p, i));
    }
    if (p->count == 0) {
        put_summary(p);
    }
    BST_TRY(put_events(ctx, p));
    fprintf(p->out,
            "<p class=\"note\">Made by Boresight %s. boresight info lists the folder's tables and "
            "files, boresight export takes them out.</p>\n",
            bst_version());
    return bst_report_page_end(ctx, p->out, nonce);
}

bst_status bst_report_run(bst_ctx *ctx, bst_run_reader *run, FILE *out) {
    page *p = calloc(1, sizeof *p);
    if (!p) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the report");
    }
    p->out = out;
    p->run = run;
    p->span_s = span_of(run);
    bst_ctx unheard = {0};
    p->has_scene =
        bst_run_reader_scenario(run) && bst_run_scene_open(&unheard, run, &p->scene) == BST_OK;
    if (!p->has_scene) {
        bst_report_warnings_add(
            &p->warnings, BST_SEVERITY_NOTE,
            "The run's world cannot be made again (%s): what lies outside the field is "
            "not shown.",
            bst_run_reader_scenario(run) ? bst_report_local(run, unheard.message)
                                         : "no scenario.json");
    }
    bst_status status = read_sensors(ctx, p);
    if (status == BST_OK) {
        bst_report_run_warnings(run, p->sensors, p->count, p->has_scene ? &p->scene.scenario : NULL,
                                &p->warnings);
        status = put_page(ctx, p);
    }
    for (int i = 0; i < p->count; i++) {
        bst_report_sensor_free(&p->sensors[i]);
    }
    bst_run_scene_close(&p->scene);
    free(p);
    return status;
}
