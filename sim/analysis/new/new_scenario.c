#include "sim/analysis/new/new_scenario.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/analysis/check/scenario_rules.h"
#include "sim/analysis/new/satellite_lookup.h"
#include "sim/analysis/new/scenario_template.h"
#include "sim/cli/outputs.h"
#include "sim/cli/plugins.h"
#include "sim/engine/simulation.h"
#include "sim/io/draft_file.h"

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
    bst_new_scenario_write(stream, q, scene);
    return fclose(stream) == 0 ? BST_OK
                               : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the scenario");
}

/* Accepts a scene of which `boresight check` warns of nothing. */
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
        status = bst_simulation_create(&quiet, &scenario,
                                       &(bst_simulation_options){.never_steps = true}, &simulation);
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

void bst_new_plain_name(const char *name, char *out, size_t bytes) {
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
    bst_new_scenario_write(draft.stream, q, scene);
    return bst_draft_close(ctx, &draft, BST_OK);
}

bst_status bst_new_scenario_make(bst_ctx *ctx, const bst_new_order *w, const bst_option *table) {
    char name[60], file[80], utc[48];
    bst_new_request request = w->request, *q = &request;
    bst_new_scene scene;
    BST_TRY(bst_new_satellite_find(ctx, "observer-tle", w->observer, &q->observer));
    BST_TRY(bst_new_satellite_find(ctx, "target-tle", w->target, &q->target));
    if (q->observer.elements.norad == q->target.elements.norad) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--target-tle %.200s: is the observer itself; name another satellite",
                        w->target);
    }
    char observer[28], target[28];
    bst_new_plain_name(q->observer.name, observer, sizeof observer);
    bst_new_plain_name(q->target.name, target, sizeof target);
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
        "  frames of %g s every %g s, pixels of %.3g arcsec\n%s"
        "Run it:\n  boresight run %s --out runs/%s\n",
        out, q->observer.name, q->target.name, utc, scene.duration_s, scene.v_mag,
        1e-3 * scene.range_m, scene.rate_arcsec_per_s, scene.exposure_s, scene.period_s,
        scene.pixel_arcsec,
        scene.few_stars ? "  too few stars in the field for an attitude: attitude telemetry alone\n"
                        : "",
        out, name);
    return BST_OK;
}
