#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/analysis/loop/loop_model.h"
#include "sim/core/json_member.h"
#include "sim/core/text.h"
#include "sim/report/report.h"
#include "sim/run/run_losses.h"

/* ------------------------------------------------------------------ how it ended */

/* Adds warnings about a run that did not complete, its error and its logged warnings. */
static void add_end(const bst_run_reader *run, bst_report_warnings *w) {
    const cJSON *manifest = bst_run_reader_manifest(run),
                *error = bst_json_member(manifest, "error");
    static const char *const words[] = {
        [BST_RUN_INTERRUPTED] =
            "The run was interrupted: it was closed properly before its end. "
            "All figures are those of the part that was simulated.",
        [BST_RUN_RUNNING] = "The run is still going on: this report is of what it had stored.",
        [BST_RUN_KILLED] =
            "The run was killed: it did not close its folder and has no summary. All "
            "figures are those of what it had stored.",
    };
    if (bst_run_reader_state(run) != BST_RUN_COMPLETE) {
        bst_report_warnings_add(w, BST_SEVERITY_PROBLEM, "%s", words[bst_run_reader_state(run)]);
    }
    if (cJSON_IsString(error)) {
        bst_report_warnings_add(w, BST_SEVERITY_PROBLEM, "The run failed: %s", error->valuestring);
    }
    double logged = bst_json_member_number(manifest, "warnings");
    if (logged > 0.0) {
        char text[64];
        bst_report_warnings_add(
            w, BST_SEVERITY_WARNING, "%s on its standard error while it ran.",
            bst_text_of_count(text, (int64_t)fmin(logged, 1e15), "warning", "warnings"));
    }
}

/* ------------------------------------------------------------------ counters */

typedef struct sensor_warnings {
    const char *name; /* NULL: not of a sensor */
    bst_report_warnings *warnings;
} sensor_warnings;

/* Adds a warning about lost data, prefixed with the sensor's name. */
static void add_loss(void *user, bst_run_severity severity, const char *text) {
    const sensor_warnings *s = user;
    bst_report_warnings_add(s->warnings, severity, "%s%s%s.", s->name ? s->name : "",
                            s->name ? ": " : "", text);
}

/* Adds warnings about data losses of each sensor and of the run's counters. */
static void add_losses(const bst_run_reader *run, const bst_report_sensor *sensors, int count,
                       bst_report_warnings *w) {
    for (int i = 0; i < count; i++) {
        sensor_warnings s = {sensors[i].name, w};
        bst_run_losses losses;
        bst_run_losses_read(run, sensors[i].name, sensors[i].sensor.index, &losses);
        bst_run_losses_report(&losses, add_loss, &s);
    }
    const cJSON *counters = bst_json_member(bst_run_reader_manifest(run), "counters"), *item;
    cJSON_ArrayForEach(item, counters) {
        if (cJSON_IsNumber(item) && fabs(item->valuedouble) < 1e15 && item->string) {
            bst_run_losses_report_counter(item->string, (int64_t)item->valuedouble, add_loss,
                                          &(sensor_warnings){NULL, w});
        }
    }
}

/* ------------------------------------------------------------------ summaries */

/* Adds warnings about acquisition, settling, custody and mode of a sensor's tracking loop. */
static void judge_sensor(const bst_report_sensor *s, bool complete, bst_report_warnings *w) {
    const bst_loop_figures *f = &s->loop;
    bool acquired = isfinite(f->time_to_acquire_s);
    if (!acquired) {
        bst_report_warnings_add(
            w, BST_SEVERITY_PROBLEM,
            "%s: the target was never acquired: no track of interest was the target's.", s->name);
    } else if (!isfinite(f->time_to_settle_s)) {
        bst_report_warnings_add(
            w, BST_SEVERITY_PROBLEM,
            "%s: the loop never settled on the target: there are no pointing figures.", s->name);
    }
    if (acquired && f->track_fraction < 0.95) {
        bst_report_warnings_add(
            w, f->track_fraction < 0.5 ? BST_SEVERITY_PROBLEM : BST_SEVERITY_WARNING,
            "%s: the target was in track in only %.1f %% of the frames in which it was "
            "visible from the acquisition on.",
            s->name, 100.0 * f->track_fraction);
    }
    if (f->wrong_target_frames > 0) {
        bst_report_warnings_add(
            w, BST_SEVERITY_WARNING,
            "%s: in %" PRId64 " frame%s the track of interest was not the target's.", s->name,
            f->wrong_target_frames, f->wrong_target_frames == 1 ? "" : "s");
    }
    if (s->bad_pixels > 0) {
        bst_report_warnings_add(w, BST_SEVERITY_NOTE,
                                "%s: image processing learned that %" PRId64
                                " pixel%s bad, and left %s out.",
                                s->name, s->bad_pixels, s->bad_pixels == 1 ? " is" : "s are",
                                s->bad_pixels == 1 ? "it" : "them");
    }
    /* with tasks there is always a next target */
    if (complete && s->task_count < 2 && acquired && f->final_mode >= 0 &&
        f->final_mode != BST_MODE_TRACK) {
        bst_report_warnings_add(w, BST_SEVERITY_WARNING,
                                "%s: at the end the mode was %s, not track.", s->name,
                                bst_mode_name(f->final_mode));
    }
}

/* Adds the tracking-loop warnings of each sensor that has a target and tracks. */
static void add_summaries(const bst_run_reader *run, const bst_report_sensor *sensors, int count,
                          bst_report_warnings *w) {
    bool complete = bst_run_reader_state(run) == BST_RUN_COMPLETE;
    for (int i = 0; i < count; i++) {
        if (sensors[i].sensor.target[0] && sensors[i].has_tracks) {
            judge_sensor(&sensors[i], complete, w);
        }
    }
}

/* ------------------------------------------------------------------ tables */

/* Adds one warning if a query counts rows on some sensors: "text: a/b 3, a/c 4". */
static void count_rows(const bst_run_reader *run, const bst_report_sensor *sensors, int count,
                       const char *sql, bst_run_severity severity, const char *text,
                       bst_report_warnings *w) {
    char list[300] = "";
    size_t n = 0;
    for (int i = 0; i < count && n < sizeof list; i++) {
        int64_t rows = bst_run_reader_int(run, sql, sensors[i].sensor.index, 0);
        if (rows > 0) {
            n += (size_t)snprintf(list + n, sizeof list - n, "%s%s %" PRId64, n ? ", " : "",
                                  sensors[i].name, rows);
        }
    }
    if (n > 0) {
        bst_report_warnings_add(w, severity, "%s: %s%s", text, list,
                                n < sizeof list ? "." : " ...");
    }
}

/* Adds warnings from telemetry and exposures: stuck axes, limits, radiation hits. */
static void add_tables(const bst_run_reader *run, const bst_report_sensor *sensors, int count,
                       bst_report_warnings *w) {
    static const struct {
        const char *sql;
        bst_run_severity severity;
        const char *text;
    } checks[] = {
        {"SELECT count(*) FROM mount WHERE sensor = ?1 AND"
         " ((axis0_flags | axis1_flags | axis2_flags) & 1) = 1",
         BST_SEVERITY_PROBLEM, "Rows of telemetry with a stuck axis"},
        {"SELECT count(*) FROM exposures WHERE sensor = ?1 AND error_sigma > 0.3",
         BST_SEVERITY_WARNING,
         "Frames rendered with an expected error above 0.3 of a pixel's noise"},
        {"SELECT count(*) FROM pointing WHERE sensor = ?1 AND limited = 1", BST_SEVERITY_WARNING,
         "Rows of telemetry with an axis at a limit"},
        {"SELECT count(*) FROM mount WHERE sensor = ?1 AND wheels_saturated = 1",
         BST_SEVERITY_WARNING, "Rows of telemetry with saturated reaction wheels"},
        {"SELECT count(*) FROM exposures WHERE sensor = ?1 AND hits > 0", BST_SEVERITY_NOTE,
         "Frames with radiation hits"},
    };
    for (size_t k = 0; k < sizeof checks / sizeof *checks; k++) {
        count_rows(run, sensors, count, checks[k].sql, checks[k].severity, checks[k].text, w);
    }
    for (int i = 0; i < count; i++) {
        if (sensors[i].every > 1) {
            bst_report_warnings_add(w, BST_SEVERITY_NOTE,
                                    "%s: of %" PRId64 " exposures one in %" PRId64 " is drawn.",
                                    sensors[i].name, sensors[i].exposures, sensors[i].every);
        }
    }
}

/* ------------------------------------------------------------------ events */

/* Adds one warning per kind of event of the run. */
static void add_events(const bst_run_reader *run, bst_report_warnings *w) {
    static const struct {
        const char *kind;
        int severity; /* bst_run_severity, or -1: no warning */
        const char *text;
    } known[] = {
        {"mode", -1, ""}, /* the charts show it */
        {"target_selected", -1, ""},
        {"track_confirmed", -1, ""},
        {"track_resumed", -1, ""},
        {"target_lost", BST_SEVERITY_WARNING, "the track of the target was given up"},
        {"target_ambiguous", BST_SEVERITY_WARNING, "several tracks may have been the cue's object"},
        {"target_resolved", BST_SEVERITY_NOTE, "the identity of the target became certain"},
        {"track_lost", BST_SEVERITY_NOTE, "a track was given up"},
        {"attitude_lost", BST_SEVERITY_WARNING, "stars no longer gave an attitude"},
        {"attitude_unknown", BST_SEVERITY_WARNING, "the attitude was unknown"},
        {"attitude_found", BST_SEVERITY_NOTE, "the stars gave an unknown attitude"},
        {"guidance", BST_SEVERITY_NOTE, "guidance announced what is out of reach"},
        {"wheels", BST_SEVERITY_WARNING, "reaction wheels came to a limit, or left it"},
        {"star_trackers", BST_SEVERITY_WARNING, "star trackers lost the stars, or found them"},
        {"manoeuvre", BST_SEVERITY_NOTE, "the tracker noticed a manoeuvre"},
        {"brightness_change", BST_SEVERITY_NOTE, "the tracker noticed a change of brightness"},
    };
    bst_ctx unheard = {0};
    bst_io_rows *rows;
    bool more;
    if (bst_io_rows_open(&unheard, run,
                         "SELECT kind, min(source), count(DISTINCT source), count(*), min(time_s)"
                         " FROM events GROUP BY kind ORDER BY min(tick), kind",
                         0, 0, &rows) != BST_OK) {
        return;
    }
    while (bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
        const char *kind = bst_io_rows_text(rows, 0), *text = kind;
        int severity = BST_SEVERITY_NOTE;
        for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
            if (strcmp(known[k].kind, kind) == 0) {
                severity = known[k].severity;
                text = known[k].text;
            }
        }
        if (severity < 0) {
            continue;
        }
        char who[120];
        int64_t sources = bst_io_rows_int(rows, 2), times = bst_io_rows_int(rows, 3);
        snprintf(who, sizeof who, "%s", bst_io_rows_text(rows, 1));
        if (sources > 1) {
            snprintf(who, sizeof who, "%" PRId64 " modules", sources);
        }
        bst_report_warnings_add(w, (bst_run_severity)severity,
                                "%s: %s: %" PRId64 " time%s, first at %.6g s.", who, text, times,
                                times == 1 ? "" : "s", bst_io_rows_real(rows, 4));
    }
    bst_io_rows_close(rows);
}

/* ------------------------------------------------------------------ margins */

/* Log callback: adds a message of the design-margin check as a warning. */
static void hear(void *user, bst_log_level level, const char *message) {
    (void)level;
    bst_report_warnings_add(user, BST_SEVERITY_WARNING, "%s.", message);
}

const char *bst_report_folder(const bst_run_reader *run, char text[256]) {
    snprintf(text, 256, "%s", bst_run_reader_folder(run));
    const char *slash =
        strrchr(text, '/'); /* the path of the reader ends with no slash except "/" */
    return slash && slash[1] ? slash + 1 : text;
}

const char *bst_report_local(const bst_run_reader *run, const char *message) {
    const char *folder = bst_run_reader_folder(run);
    size_t n = strlen(folder);
    if (n == 0 || strncmp(message, folder, n) != 0) {
        return message;
    }
    return message + n + strspn(message + n, "/");
}

void bst_report_run_warnings(bst_run_reader *run, const bst_report_sensor *sensors, int count,
                             const bst_scenario *scenario, bst_report_warnings *w) {
    add_end(run, w);
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(run, i)); i++) {
        bst_report_warnings_add(w, BST_SEVERITY_PROBLEM, "%s", bst_report_local(run, problem));
    }
    add_summaries(run, sensors, count, w);
    add_losses(run, sensors, count, w);
    add_tables(run, sensors, count, w);
    const cJSON *misfits = bst_json_member(bst_run_reader_manifest(run), "wcs_misfit_px"), *item;
    cJSON_ArrayForEach(item, misfits) {
        if (cJSON_IsNumber(item) && item->valuedouble > 1e-3) {
            bst_report_warnings_add(
                w, BST_SEVERITY_WARNING,
                "%s: the WCS of its frames misses the distortion by up to %.3g px.", item->string,
                item->valuedouble);
        }
    }
    if (scenario) {
        bst_ctx ctx;
        bst_ctx_init(&ctx, hear, w, BST_LOG_WARNING);
        bst_loop_warn(&ctx, scenario);
    }
    add_events(run, w);
}
