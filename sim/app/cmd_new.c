/* boresight new: a first scenario for two satellites. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/analysis/check/scenario_rules.h"
#include "sim/app/app.h"
#include "sim/app/new_scene.h"
#include "sim/astro/tle.h"
#include "sim/cli/options.h"
#include "sim/cli/outputs.h"
#include "sim/cli/plugins.h"
#include "sim/cli/shipped.h"
#include "sim/core/text.h"
#include "sim/engine/simulation.h"
#include "sim/io/draft_file.h"

static const char help_text[] =
    "usage: boresight new [FILE.json] [options]\n"
    "\n"
    "Writes a small scenario in which one satellite finds and follows another: a telescope on the "
    "one, and a loop that\n"
    "holds. The time is one at which the target is in sunlight and clear of the Earth, the Moon "
    "and the Sun for the\n"
    "whole run, and slow; it is looked for in the two days from the later of the element sets. "
    "Exposure, frame\n"
    "rate and mount are chosen for it; boresight check warns of nothing. Without options NEOSSat "
    "looks at INMARSAT GX5.\n"
    "\n"
    "  boresight new first.json\n"
    "  boresight new pass.json --observer-tle 39089 --target-tle \"ISS (ZARYA)\" --aperture 0.1\n"
    "  boresight new mine.json --observer-tle eye.tle --target-tle catalogue.tle:44801 "
    "--focal-length "
    "0.9\n"
    "\n"
    "SATELLITE is a catalogue number or a name of the element sets that come with Boresight, a "
    "file "
    "of element sets\n"
    "that holds one satellite, or FILE:NUMBER. Without FILE.json the file is called NAME.json "
    "after "
    "the two.\n"
    "\n"
    "options:\n";

static const char *const shipped_sets[] = {"scenarios/catalogue_2022-06.tle",
                                           "scenarios/objects_2022-06.tle"};
enum { SHIPPED_SETS = (int)(sizeof shipped_sets / sizeof *shipped_sets) };

/* ------------------------------------------------------------------ satellites */

static bool same_name(const char *a, const char *b) {
    while (*a && tolower((unsigned char)*a) == tolower((unsigned char)*b)) {
        a++;
        b++;
    }
    return *a == '\0' && *b == '\0';
}

static bst_status take(bst_ctx *ctx, const char *option, const char *file,
                       const bst_elements *elements, bst_new_satellite *out) {
    out->elements = *elements;
    if (!realpath(file, out->file)) {
        return bst_fail(ctx, BST_ERR_IO, "--%s: %.300s: %s", option, file, strerror(errno));
    }
    if (*elements->name) {
        snprintf(out->name, sizeof out->name, "%s", elements->name);
    } else {
        snprintf(out->name, sizeof out->name, "NORAD %d", elements->norad);
    }
    bst_status status = bst_tle_format(ctx, elements, out->line1, out->line2);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "--%s %.300s", option, file);
}

/* What is looked for in the shipped element sets, and what was found. */
typedef struct wanted {
    const char *option, *which;
    bool found;
    char near[32]; /* the nearest other name, "": none */
    size_t best;
} wanted;

/* By number or name in a file. */
static bst_status seek(bst_ctx *ctx, const char *file, wanted *w, bst_new_satellite *out) {
    bst_elements *sets = NULL;
    int count = 0, norad = 0;
    bool number = bst_tle_decode_number(w->which, &norad);
    BST_TRY(bst_elements_load(ctx, file, &(bst_elements_options){.skip_bad_sets = true}, &sets,
                              &count));
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        bool named = same_name(sets[i].name, w->which);
        if (named && w->found && out->elements.norad != sets[i].norad) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT,
                              "--%s %.100s: several satellites are called so (%d and %d, ...); "
                              "give the catalogue number",
                              w->option, w->which, out->elements.norad, sets[i].norad);
        } else if (!w->found && (named || (number && sets[i].norad == norad))) {
            w->found = true;
            status = take(ctx, w->option, file, &sets[i], out);
        } else if (bst_text_is_nearer(w->which, sets[i].name, &w->best)) {
            memcpy(w->near, sets[i].name, sizeof w->near);
        }
    }
    free(sets);
    return status;
}

/* FILE, or FILE:NUMBER. */
static bst_status from_file(bst_ctx *ctx, const char *option, const char *file, int norad,
                            bst_new_satellite *out) {
    bst_elements *sets = NULL;
    int count = 0;
    const bst_elements_options only = {.norad = norad};
    bst_status status = bst_elements_load(ctx, file, &only, &sets, &count);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "--%s", option);
    }
    for (int i = 1; i < count && status == BST_OK; i++) {
        if (sets[i].norad != sets[0].norad) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT,
                              "--%s %.300s: the file holds more than one satellite; say which: "
                              "%.300s:%d",
                              option, file, file, sets[0].norad);
        }
    }
    if (status == BST_OK) {
        int latest = 0;
        for (int i = 1; i < count; i++) {
            double days = sets[i].epoch_utc_jd1 - sets[latest].epoch_utc_jd1 +
                          sets[i].epoch_utc_jd2 - sets[latest].epoch_utc_jd2;
            latest = days > 0.0 ? i : latest;
        }
        status = take(ctx, option, file, &sets[latest], out);
    }
    free(sets);
    return status;
}

static bst_status find_satellite(bst_ctx *ctx, const char *option, const char *which,
                                 bst_new_satellite *out) {
    char file[4096];
    wanted w = {.option = option, .which = which, .best = SIZE_MAX};
    int norad = 0;
    const char *colon = strrchr(which, ':');
    if (access(which, F_OK) == 0) {
        return from_file(ctx, option, which, 0, out);
    }
    if (colon && (size_t)(colon - which) < sizeof file) {
        snprintf(file, sizeof file, "%.*s", (int)(colon - which), which);
        size_t digits = strspn(colon + 1, "0123456789");
        bool number = digits > 0 && digits <= 9 && !colon[1 + digits];
        norad = number ? (int)strtol(colon + 1, NULL, 10) : 0;
        if (norad > 0 || bst_tle_decode_number(colon + 1, &norad)) {
            return from_file(ctx, option, file, norad, out);
        }
        if (access(file, F_OK) == 0) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s %.200s: \"%.40s\" is no catalogue number (allowed: FILE:NUMBER, "
                            "1 to 999999999 or Alpha-5)",
                            option, which, colon + 1);
        }
    }
    for (int i = 0; i < SHIPPED_SETS; i++) {
        bst_cli_shipped_file(shipped_sets[i], file, sizeof file);
        BST_TRY(seek(ctx, file, &w, out));
    }
    return w.found ? BST_OK
                   : bst_fail(ctx, BST_ERR_NOT_FOUND,
                              "--%s %.200s: there is no such file, and no such catalogue number or "
                              "name in the element sets that come with Boresight (%s, %s)%s%s%s",
                              option, which, shipped_sets[0], shipped_sets[1],
                              *w.near ? "; did you mean \"" : "", w.near, *w.near ? "\"?" : "");
}

/* ------------------------------------------------------------------ the judge */

typedef struct warnings {
    int count;
    char first[256];
} warnings;

static void note_warning(void *user, bst_log_level level, const char *message) {
    warnings *w = user;
    /* dates beyond the Earth-orientation table are not a fault of the time within two days */
    if (level <= BST_LOG_WARNING && !strstr(message, "/world/earth_orientation")) {
        if (w->count++ == 0) {
            snprintf(w->first, sizeof w->first, "%s", message);
        }
    }
}

static bst_status text_of(bst_ctx *ctx, const bst_new_request *q, const bst_new_scene *scene,
                          char **text, size_t *bytes) {
    FILE *stream = open_memstream(text, bytes);
    if (!stream) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
    }
    bst_new_scene_write(stream, q, scene);
    return fclose(stream) == 0 ? BST_OK
                               : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
}

/* What `boresight check` does. */
static bst_status judge(void *user, bst_ctx *ctx, const bst_new_scene *scene, bool *holds,
                        char why[256]) {
    const bst_new_request *q = user;
    char *text = NULL;
    size_t bytes = 0;
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_simulation *simulation = NULL;
    warnings found = {0};
    BST_TRY(text_of(ctx, q, scene, &text, &bytes));
    bst_status status = bst_json_parse(ctx, q->name, text, bytes, &json);
    free(text);
    if (status != BST_OK) {
        return status;
    }
    bst_ctx quiet;
    bst_ctx_init(&quiet, note_warning, &found, BST_LOG_ERROR);
    status = bst_plugins_scenario_read(&quiet, json, &scenario);
    if (status == BST_OK) {
        status =
            bst_simulation_create(&quiet, &scenario, &(bst_simulation_options){0}, &simulation);
    }
    if (status == BST_OK) {
        quiet.log_level = BST_LOG_WARNING;
        status = bst_check_rules_apply(&quiet, &scenario, simulation);
    }
    bst_simulation_free(simulation);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    *holds = found.count == 0;
    snprintf(why, 256, "%s", found.first);
    return status == BST_OK ? BST_OK : bst_fail(ctx, status, "%s", quiet.message);
}

/* ------------------------------------------------------------------ the command */

typedef struct words {
    const char *observer, *target, *out;
    bool help, overwrite;
} words;

/* "NEOSSAT (X)" -> "neossat_x": what names of scenarios and observers may hold. */
static void plain_name(const char *name, char *out, size_t bytes) {
    size_t n = 0;
    for (const char *c = name; *c && n + 1 < bytes; c++) {
        if (isalnum((unsigned char)*c)) {
            out[n++] = (char)tolower((unsigned char)*c);
        } else if (n > 0 && out[n - 1] != '_') {
            out[n++] = '_';
        }
    }
    while (n > 0 && out[n - 1] == '_') {
        n--;
    }
    out[n] = '\0';
}

static bst_status write_file(bst_ctx *ctx, const char *path, const bst_new_request *q,
                             const bst_new_scene *scene) {
    bst_draft draft;
    BST_TRY(bst_draft_open(ctx, path, &draft));
    bst_new_scene_write(draft.stream, q, scene);
    return bst_draft_close(ctx, &draft, BST_OK);
}

static bst_status make(bst_ctx *ctx, const words *w, const bst_option *table, bst_new_request *q) {
    char name[60], file[80], utc[48];
    bst_new_scene scene;
    BST_TRY(find_satellite(ctx, "observer-tle", w->observer, &q->observer));
    BST_TRY(find_satellite(ctx, "target-tle", w->target, &q->target));
    if (q->observer.elements.norad == q->target.elements.norad) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--target-tle %.200s: is the observer itself; name another satellite",
                        w->target);
    }
    char observer[28], target[28];
    plain_name(q->observer.name, observer, sizeof observer);
    plain_name(q->target.name, target, sizeof target);
    snprintf(name, sizeof name, "%s_%s", observer, target);
    q->name = name;
    q->observer_label = observer;
    snprintf(file, sizeof file, "%s.json", name);
    const char *out = w->out ? w->out : file;
    BST_TRY(bst_outputs_spare(ctx, table, q->observer.file, "--observer-tle names it"));
    BST_TRY(bst_outputs_spare(ctx, table, q->target.file, "--target-tle names it"));
    if (!w->overwrite && strcmp(out, "/dev/stdout") != 0 && access(out, F_OK) == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--out %.300s: the file is there already; give another name, or "
                        "--overwrite",
                        out);
    }
    BST_TRY(bst_new_scene_find(ctx, q, judge, q, &scene));
    BST_TRY(write_file(ctx, out, q, &scene));
    bst_time_to_utc(scene.epoch, 0, utc, sizeof utc);
    printf(
        "%s: %s looks at %s from %s for %g s\n"
        "  V %.1f, %.0f km away or more, at up to %.3g arcsec/s\n"
        "  frames of %g s every %g s, pixels of %.3g arcsec\n"
        "Run it:\n  boresight run %s --out runs/%s\n",
        out, q->observer.name, q->target.name, utc, scene.duration_s, scene.v_mag,
        1e-3 * scene.range_m, scene.rate_arcsec_per_s, scene.exposure_s, scene.period_s,
        scene.pixel_arcsec, out, name);
    return BST_OK;
}

/* FILE.json before or among the options is --out. */
static bst_status take_out(bst_ctx *ctx, const bst_option *table, int arguments, char **argv,
                           words *w) {
    bool given[32] = {false};
    if (arguments == 0) {
        return BST_OK;
    }
    if (arguments > 1 || w->out) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "one FILE.json is written, %d were named",
                        arguments + (w->out ? 1 : 0));
    }
    w->out = argv[1];
    for (int i = 0; table[i].name; i++) {
        given[i] = table[i].target == (const void *)&w->out;
    }
    return bst_outputs_check(ctx, table, given, 0, NULL);
}

static int carry_out(const bst_option *table, int argc, char **argv, words *w, bst_new_request *q) {
    bst_ctx ctx;
    bst_time start;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "new");
    }
    if (w->help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    bst_status status = take_out(&ctx, table, arguments, argv, w);
    if (status == BST_OK && q->focal_m > 0.0 && q->pixel_arcsec > 0.0) {
        status = bst_fail(&ctx, BST_ERR_ARGUMENT,
                          "--pixel-scale and --focal-length say the same; give one of them");
    }
    if (status == BST_OK && q->start && bst_time_from_utc(&ctx, q->start, &start) != BST_OK) {
        status = bst_fail_prefix(&ctx, BST_ERR_ARGUMENT, "--start");
    }
    if (status != BST_OK) {
        return bst_options_misuse(&ctx, "new");
    }
    if (make(&ctx, w, table, q) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return BST_EXIT_OK;
}

#define TEXT_OPTION(name_, target_, path_, argument_, doc_)                          \
    {                                                                                \
        .name = name_, .kind = BST_OPTION_TEXT, .target = &(target_), .path = path_, \
        .argument = argument_, .doc = doc_                                           \
    }
#define REAL_OPTION(name_, target_, argument_, least, most, doc_)                       \
    {                                                                                   \
        .name = name_, .kind = BST_OPTION_REAL, .target = &(target_), .minimum = least, \
        .maximum = most, .argument = argument_, .doc = doc_                             \
    }

int bst_cmd_new(int argc, char **argv) {
    words w = {.observer = "39089", .target = "44801"};
    bst_new_request q = {.aperture_m = 0.15};
    const bst_option table[] = {
        TEXT_OPTION("out", w.out, BST_PATH_OUTPUT, "FILE", "the same as FILE.json"),
        {.name = "overwrite",
         .kind = BST_OPTION_FLAG,
         .target = &w.overwrite,
         .doc = "replace the file where there is one"},
        TEXT_OPTION("observer-tle", w.observer, BST_PATH_INPUT, "SATELLITE",
                    "who looks (default 39089, NEOSSat)"),
        TEXT_OPTION("target-tle", w.target, BST_PATH_INPUT, "SATELLITE",
                    "at what (default 44801, INMARSAT GX5)"),
        REAL_OPTION("aperture", q.aperture_m, "M", 0.001, 20,
                    "diameter of the telescope in metres (default 0.15)"),
        REAL_OPTION("pixel-scale", q.pixel_arcsec, "ARCSEC", 0.01, 120,
                    "size of a pixel in the sky (default 3 to 10, by the target's rate and the "
                    "known stars)"),
        REAL_OPTION("focal-length", q.focal_m, "M", 0.01, 200,
                    "instead of it: focal length in metres, with pixels of 13 um"),
        REAL_OPTION("period", q.period_s, "S", 0.02, 10,
                    "seconds from frame to frame (default 1 to 0.1 by the target's rate)"),
        REAL_OPTION("duration", q.duration_s, "S", 10, 86400,
                    "simulated time in seconds (default 120, or 60 periods)"),
        TEXT_OPTION("start", q.start, BST_PATH_NONE, "UTC",
                    "look for a time in the two days from then, as 2022-06-16T22:10:00Z"),
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &w.help, .doc = "print this"},
        {.name = NULL},
    };
    return carry_out(table, argc, argv, &w, &q);
}
