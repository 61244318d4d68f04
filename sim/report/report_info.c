#include "sim/report/report_info.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <cjson/cJSON.h>

#include "sim/astro/time.h"
#include "sim/core/json_member.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/io/fits_reader.h"
#include "sim/io/run_reader.h"

/* Copies a JSON member; null if it is missing. */
static void copy(cJSON *to, const char *key, const cJSON *from, const char *from_key) {
    const cJSON *item = bst_json_member(from, from_key);
    cJSON_AddItemToObject(to, key, item ? cJSON_Duplicate(item, true) : cJSON_CreateNull());
}

/* Calls `add` for each row of a query; an error becomes a problem of the run. */
static void each_row(bst_run_reader *run, const char *sql, int64_t parameter,
                     void (*add)(cJSON *to, const bst_io_rows *rows), cJSON *to) {
    bst_ctx ctx = {0};
    bst_io_rows *rows = NULL;
    bool more = false;
    if (!bst_run_reader_has_tables(run)) {
        return;
    }
    bst_status status = bst_io_rows_open(&ctx, run, sql, parameter, 0, &rows);
    while (status == BST_OK && (status = bst_io_rows_next(&ctx, rows, &more)) == BST_OK && more) {
        add(to, rows);
    }
    bst_io_rows_close(rows);
    if (status != BST_OK) {
        bst_run_reader_note_problem(run, "%s", ctx.message);
    }
}

/* ------------------------------------------------------------------ what is gathered */

static void add_span(bst_run_reader *run, cJSON *out) {
    const cJSON *manifest = bst_run_reader_manifest(run), *scenario = bst_run_reader_scenario(run);
    const char *epoch = bst_json_member_text(manifest, "epoch_utc",
                                             bst_json_member_text(scenario, "epoch_utc", ""));
    double rate = bst_json_member_number(scenario, "tick_rate_hz");
    double last = bst_json_member_number(manifest, "last_tick");
    double simulated = bst_json_member_number(scenario, "duration_s");
    if (bst_run_reader_state(run) != BST_RUN_COMPLETE) {
        if (isnan(last)) {
            last = (double)bst_run_reader_int(run, "SELECT max(end_tick) FROM frames", 0, -1);
            last =
                fmax(last, (double)bst_run_reader_int(run, "SELECT max(tick) FROM control", 0, -1));
        }
        simulated = (last + 1.0) / rate;
    }
    bst_time start;
    bst_ctx unheard = {0};
    char text[2][40] = {"", ""};
    if (*epoch && bst_time_from_utc(&unheard, epoch, &start) == BST_OK) {
        bst_time_to_utc(start, 3, text[0], sizeof text[0]);
        if (isfinite(simulated)) {
            bst_time_to_utc(bst_time_add(start, simulated), 3, text[1], sizeof text[1]);
        }
    }
    cJSON_AddStringToObject(out, "start_utc", text[0]);
    cJSON_AddStringToObject(out, "end_utc", text[1]);
    bst_json_add_number(out, "simulated_s", simulated);
}

static void add_identity(bst_run_reader *run, cJSON *out) {
    const cJSON *manifest = bst_run_reader_manifest(run), *scenario = bst_run_reader_scenario(run);
    cJSON_AddStringToObject(out, "folder", bst_run_reader_folder(run));
    static const char *const words[] = {[BST_RUN_COMPLETE] = "complete",
                                        [BST_RUN_INTERRUPTED] = "interrupted",
                                        [BST_RUN_RUNNING] = "running",
                                        [BST_RUN_KILLED] = "killed"};
    cJSON_AddStringToObject(out, "state", words[bst_run_reader_state(run)]);
    copy(out, "scenario", scenario ? scenario : manifest, scenario ? "name" : "scenario");
    copy(out, "scenario_file", manifest, "scenario_file");
    copy(out, "version", manifest, "version");
    copy(out, "git_revision", manifest, "git_revision");
    copy(out, "seed", manifest ? manifest : scenario, "seed");
    copy(out, "run", manifest ? manifest : scenario, "run");
    copy(out, "device", manifest, "device");
    if (bst_json_member(manifest, "plugins")) {
        copy(out, "plugins", manifest, "plugins");
    }
    copy(out, "star_catalogue", manifest, "star_catalogue");
    copy(out, "stars", manifest, "stars");
    copy(out, "wall_time_s", manifest, "wall_time_s");
    copy(out, "warnings", manifest, "warnings");
    add_span(run, out);
}

static void put_program(cJSON *to, const bst_io_rows *rows) {
    /* program and version: "boresight 0.1.0" */
    const char *text = bst_io_rows_text(rows, 0), *space = strchr(text, ' ');
    cJSON_ReplaceItemInObjectCaseSensitive(to, "version",
                                           cJSON_CreateString(space ? space + 1 : text));
}

static void put_sensor(cJSON *to, const bst_io_rows *rows) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddNumberToObject(node, "sensor", (double)bst_io_rows_int(rows, 0));
    cJSON_AddStringToObject(node, "observer", bst_io_rows_text(rows, 1));
    cJSON_AddStringToObject(node, "name", bst_io_rows_text(rows, 2));
    cJSON_AddStringToObject(node, "target", bst_io_rows_text(rows, 3));
    cJSON_AddStringToObject(node, "file", bst_io_rows_text(rows, 4));
    cJSON_AddNumberToObject(node, "width_px", (double)bst_io_rows_int(rows, 5));
    cJSON_AddNumberToObject(node, "height_px", (double)bst_io_rows_int(rows, 6));
    cJSON_AddItemToArray(to, node);
}

/* Adds the content of the sensor's FITS file to the information. */
static void add_file(bst_run_reader *run, cJSON *sensor, int64_t kept) {
    const char *name = bst_json_member_text(sensor, "file", "");
    char path[4096];
    struct stat info;
    bst_ctx ctx = {0};
    bst_fits_reader *fits = NULL;
    bool complete = bst_run_reader_state(run) == BST_RUN_COMPLETE;
    /* a file name from a damaged database must stay inside the folder */
    bool usable = *name && !strchr(name, '/') &&
                  bst_run_reader_file(&ctx, run, name, path, sizeof path) == BST_OK;
    if (!usable || stat(path, &info) != 0) {
        if (usable && kept > 0) {
            bst_run_reader_note_problem(run, "%s is missing", name);
        }
        cJSON_AddNumberToObject(sensor, "frames_in_file", 0);
        return;
    }
    cJSON_AddNumberToObject(sensor, "file_bytes", (double)info.st_size);
    if (bst_fits_reader_open(&ctx, path, &fits) != BST_OK) {
        /* a killed run may leave a file without a complete header */
        if (complete) {
            bst_run_reader_note_problem(run, "%s", ctx.message);
        }
        cJSON_AddNumberToObject(sensor, "frames_in_file", 0);
        cJSON_AddBoolToObject(sensor, "cut_off", true);
        return;
    }
    const bst_fits_file_info *f = bst_fits_reader_info(fits);
    cJSON_AddNumberToObject(sensor, "frames_in_file", (double)f->frames);
    cJSON_AddStringToObject(sensor, "layout", f->cube ? "cube" : "extensions");
    cJSON_AddStringToObject(sensor, "compression", f->compressed ? "rice" : "none");
    cJSON_AddBoolToObject(sensor, "cut_off", f->cut_off);
    if (complete && (f->cut_off || f->frames != kept)) {
        bst_run_reader_note_problem(run, "%s holds %lld whole frames, the table frames %lld", name,
                                    (long long)f->frames, (long long)kept);
    }
    bst_fits_reader_close(fits);
}

static void add_sensors(bst_run_reader *run, cJSON *out) {
    cJSON *list = cJSON_AddArrayToObject(out, "sensors");
    each_row(run,
             "SELECT sensor, observer, name, target, file, width_px, height_px FROM sensors"
             " ORDER BY sensor",
             0, put_sensor, list);
    cJSON *sensor;
    cJSON_ArrayForEach(sensor, list) {
        int64_t index = (int64_t)bst_json_member_number(sensor, "sensor");
        int64_t kept = bst_run_reader_int(
            run, "SELECT count(fits_index) FROM frames WHERE sensor = ?1", index, 0);
        cJSON_AddNumberToObject(
            sensor, "frames",
            (double)bst_run_reader_int(run, "SELECT count(*) FROM frames WHERE sensor = ?1", index,
                                       0));
        cJSON_AddNumberToObject(
            sensor, "bits",
            (double)bst_run_reader_int(run, "SELECT max(bits) FROM frames WHERE sensor = ?1", index,
                                       0));
        add_file(run, sensor, kept);
    }
}

static void put_table(cJSON *to, const bst_io_rows *rows) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "name", bst_io_rows_text(rows, 0));
    cJSON_AddStringToObject(node, "doc", bst_io_rows_text(rows, 1));
    cJSON_AddItemToArray(to, node);
}

/* Adds a column to the description of its table. */
static void put_column(cJSON *to, const bst_io_rows *rows) {
    cJSON *table;
    cJSON_ArrayForEach(table, to) {
        if (strcmp(bst_json_member_text(table, "name", ""), bst_io_rows_text(rows, 0)) == 0) {
            cJSON *columns = cJSON_GetObjectItemCaseSensitive(table, "columns");
            cJSON *node = cJSON_CreateObject();
            cJSON_AddStringToObject(node, "name", bst_io_rows_text(rows, 1));
            cJSON_AddStringToObject(node, "type", bst_io_rows_text(rows, 2));
            cJSON_AddStringToObject(node, "unit", bst_io_rows_text(rows, 3));
            cJSON_AddStringToObject(node, "doc", bst_io_rows_text(rows, 4));
            cJSON_AddItemToArray(columns ? columns : cJSON_AddArrayToObject(table, "columns"),
                                 node);
        }
    }
}

static void put_count(cJSON *to, const bst_io_rows *rows) {
    cJSON_AddNumberToObject(to, "rows", (double)bst_io_rows_int(rows, 0));
}

static void add_tables(bst_run_reader *run, cJSON *out) {
    cJSON *list = cJSON_AddArrayToObject(out, "tables");
    each_row(run, "SELECT \"table\", doc FROM tables ORDER BY rowid", 0, put_table, list);
    cJSON *table;
    cJSON_ArrayForEach(table, list) {
        char sql[200];
        const char *name = bst_json_member_text(table, "name", "");
        /* recorded names need no quoting; others are skipped */
        if (!strpbrk(name, "\"'") && strlen(name) < 100) {
            snprintf(sql, sizeof sql, "SELECT count(*) FROM \"%s\"", name);
            each_row(run, sql, 0, put_count, table);
        }
    }
    each_row(run,
             "SELECT \"table\", \"column\", type, unit, doc FROM columns ORDER BY \"table\","
             " position",
             0, put_column, list);
}

static void put_event(cJSON *to, const bst_io_rows *rows) {
    cJSON_AddNumberToObject(to, bst_io_rows_text(rows, 0), (double)bst_io_rows_int(rows, 1));
}

static int by_name(const struct dirent **a, const struct dirent **b) {
    return strcmp((*a)->d_name, (*b)->d_name);
}

static void add_files(const bst_run_reader *run, cJSON *out) {
    struct dirent **entries = NULL;
    int count = scandir(bst_run_reader_folder(run), &entries, NULL, by_name);
    cJSON *list = cJSON_AddArrayToObject(out, "files");
    double bytes = 0.0, blocks = 0.0;
    for (int i = 0; i < count; i++) {
        char path[4096];
        struct stat info;
        if (bst_run_reader_file(NULL, run, entries[i]->d_name, path, sizeof path) == BST_OK &&
            lstat(path, &info) == 0 && S_ISREG(info.st_mode)) {
            cJSON *node = cJSON_CreateObject();
            cJSON_AddStringToObject(node, "name", entries[i]->d_name);
            cJSON_AddNumberToObject(node, "bytes", (double)info.st_size);
            cJSON_AddItemToArray(list, node);
            bytes += (double)info.st_size;
            blocks += 512.0 * (double)info.st_blocks;
        }
        free(entries[i]);
    }
    free(entries);
    cJSON_AddNumberToObject(out, "bytes", bytes);
    cJSON_AddNumberToObject(out, "disk_bytes", blocks);
}

cJSON *bst_report_info(bst_run_reader *run) {
    cJSON *out = cJSON_CreateObject();
    add_identity(run, out);
    if (!bst_run_reader_manifest(run) && bst_run_reader_has_tables(run)) {
        each_row(run, "SELECT program FROM run", 0, put_program, out);
    }
    copy(out, "summary", bst_run_reader_manifest(run), "summary");
    if (bst_json_member(bst_run_reader_manifest(run), "sensors")) {
        copy(out, "sensor_summaries", bst_run_reader_manifest(run), "sensors");
    }
    if (bst_json_member(bst_run_reader_manifest(run), "sightings")) {
        copy(out, "sightings", bst_run_reader_manifest(run), "sightings");
    }
    copy(out, "counters", bst_run_reader_manifest(run), "counters");
    add_sensors(run, out);
    add_tables(run, out);
    cJSON *events = cJSON_AddObjectToObject(out, "events");
    if (bst_run_reader_int(run, "SELECT 1 FROM tables WHERE \"table\" = 'events'", 0, 0) == 1) {
        each_row(run, "SELECT kind, count(*) FROM events GROUP BY kind ORDER BY kind", 0, put_event,
                 events);
    }
    add_files(run, out);
    cJSON *problems = cJSON_AddArrayToObject(out, "problems");
    const char *text;
    for (int i = 0; (text = bst_run_reader_problem(run, i)); i++) {
        cJSON_AddItemToArray(problems, cJSON_CreateString(text));
    }
    return out;
}

/* ------------------------------------------------------------------ for people */

static void line(const char *name, const char *text) {
    printf("  %-26s %s\n", name, *text ? text : "-");
}

static void print_bytes(double bytes) {
    if (bytes < 1e4) {
        printf("%.0f B", bytes);
    } else if (bytes < 1e6) {
        printf("%.1f kB", bytes / 1e3);
    } else {
        printf("%.1f MB", bytes / 1e6);
    }
}

static void print_identity(const cJSON *info) {
    char text[400];
    line("scenario", bst_json_member_text(info, "scenario", ""));
    snprintf(text, sizeof text, "boresight %s%s%s%s",
             bst_json_member_text(info, "version", "of unknown version"),
             *bst_json_member_text(info, "git_revision", "") ? " (" : "",
             bst_json_member_text(info, "git_revision", ""),
             *bst_json_member_text(info, "git_revision", "") ? ")" : "");
    line("program", text);
    snprintf(text, sizeof text, "%s, run %.0f", bst_json_member_text(info, "seed", "?"),
             bst_json_member_number(info, "run"));
    line("seed", text);
    line("device", bst_json_member_text(info, "device", ""));
    const cJSON *plugin;
    cJSON_ArrayForEach(plugin, bst_json_member(info, "plugins")) {
        snprintf(
            text, sizeof text, "%s of %s, SHA-256 %s", bst_json_member_text(plugin, "type", "?"),
            bst_json_member_text(plugin, "file", "?"), bst_json_member_text(plugin, "sha256", "?"));
        line("plug-in", text);
    }
    snprintf(text, sizeof text, "%s to %s (%.3f s)", bst_json_member_text(info, "start_utc", "?"),
             bst_json_member_text(info, "end_utc", "?"),
             bst_json_member_number(info, "simulated_s"));
    line("span", text);
    if (isfinite(bst_json_member_number(info, "stars"))) {
        snprintf(text, sizeof text, "%s, %.0f stars",
                 bst_json_member_text(info, "star_catalogue", ""),
                 bst_json_member_number(info, "stars"));
        line("star catalogue", text);
    }
    if (isfinite(bst_json_member_number(info, "wall_time_s"))) {
        double warnings = bst_json_member_number(info, "warnings");
        snprintf(text, sizeof text, "%.2f s, %.0f warning%s",
                 bst_json_member_number(info, "wall_time_s"), warnings, warnings == 1.0 ? "" : "s");
        line("wall time", text);
    }
}

static void print_sensors(const cJSON *info) {
    const cJSON *sensor;
    printf("sensors\n");
    cJSON_ArrayForEach(sensor, bst_json_member(info, "sensors")) {
        double frames = bst_json_member_number(sensor, "frames");
        printf("  %s/%s: %.0f frame%s, %.0f x %.0f px",
               bst_json_member_text(sensor, "observer", ""),
               bst_json_member_text(sensor, "name", ""), frames, frames == 1.0 ? "" : "s",
               bst_json_member_number(sensor, "width_px"),
               bst_json_member_number(sensor, "height_px"));
        if (bst_json_member_number(sensor, "bits") > 0) {
            printf(", %.0f bit", bst_json_member_number(sensor, "bits"));
        }
        if (*bst_json_member_text(sensor, "target", "")) {
            printf(", target %s", bst_json_member_text(sensor, "target", ""));
        }
        printf("\n");
        if (!*bst_json_member_text(sensor, "file", "")) {
            printf("    frames are not kept\n");
        } else if (*bst_json_member_text(sensor, "layout", "")) {
            bool cube = strcmp(bst_json_member_text(sensor, "layout", ""), "cube") == 0;
            printf("    %s: %.0f %s, %s, ", bst_json_member_text(sensor, "file", ""),
                   bst_json_member_number(sensor, "frames_in_file"),
                   cube ? "planes of a cube" : "image extensions",
                   strcmp(bst_json_member_text(sensor, "compression", ""), "rice") == 0 ? "Rice"
                                                                                        : "raw");
            print_bytes(bst_json_member_number(sensor, "file_bytes"));
            printf("%s\n",
                   cJSON_IsTrue(bst_json_member(sensor, "cut_off")) ? ", cut off after these" : "");
        } else {
            printf("    %s: no whole frame\n", bst_json_member_text(sensor, "file", ""));
        }
    }
}

/* Prints the figures of a summary with the units from their keys. */
static void print_figures(const char *name, const cJSON *summary) {
    const cJSON *item;
    if (!cJSON_IsObject(summary)) {
        return;
    }
    printf("%s\n", name);
    cJSON_ArrayForEach(item, summary) {
        char text[64] = "-";
        if (cJSON_IsNumber(item)) {
            snprintf(text, sizeof text, "%.6g", item->valuedouble);
        } else if (cJSON_IsString(item)) {
            snprintf(text, sizeof text, "%s", item->valuestring);
        }
        line(item->string, text);
    }
}

static void print_tables(const cJSON *info, bool columns) {
    const cJSON *table, *column;
    printf("tables%s\n", columns ? "" : " (--columns lists their columns)");
    cJSON_ArrayForEach(table, bst_json_member(info, "tables")) {
        printf("  %-18s %10.0f rows %4d columns  %s\n", bst_json_member_text(table, "name", ""),
               bst_json_member_number(table, "rows"),
               cJSON_GetArraySize(bst_json_member(table, "columns")),
               bst_json_member_text(table, "doc", ""));
        const cJSON *list = columns ? bst_json_member(table, "columns") : NULL;
        cJSON_ArrayForEach(column, list) {
            printf("    %-28s %-8s %-10s %s\n", bst_json_member_text(column, "name", ""),
                   bst_json_member_text(column, "type", ""),
                   bst_json_member_text(column, "unit", ""),
                   bst_json_member_text(column, "doc", ""));
        }
    }
}

void bst_report_info_print(const bst_run_reader *run, const cJSON *info, bool columns) {
    const cJSON *item;
    printf("%s: %s%s\n", bst_run_reader_folder(run), bst_run_state_name(bst_run_reader_state(run)),
           cJSON_GetArraySize(bst_json_member(info, "problems")) > 0 ? ", damaged" : "");
    print_identity(info);
    print_sensors(info);
    print_figures("summary", bst_json_member(info, "summary"));
    const cJSON *sensors = bst_json_member(info, "sensor_summaries");
    cJSON_ArrayForEach(item, sensors) {
        print_figures(item->string, item);
    }
    print_figures("sightings", bst_json_member(info, "sightings"));
    print_tables(info, columns);
    print_figures("events", bst_json_member(info, "events"));
    print_figures("counters", bst_json_member(info, "counters"));
    printf("files\n");
    cJSON_ArrayForEach(item, bst_json_member(info, "files")) {
        printf("  %-26s ", bst_json_member_text(item, "name", ""));
        print_bytes(bst_json_member_number(item, "bytes"));
        printf("\n");
    }
    printf("  %-26s ", "on disk");
    print_bytes(bst_json_member_number(info, "disk_bytes"));
    printf("\n");
}
