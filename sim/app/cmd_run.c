/* boresight run: runs a scenario and records it. */
#include <stdio.h>
#include <unistd.h>

#include "sim/analysis/check/scenario_rules.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/cli/stop_signals.h"
#include "sim/run/run_link.h"
#include "sim/run/run_parts.h"
#include "sim/run/run_scenario.h"

static const char help_text[] =
    "usage: boresight run SCENARIO.json [options]\n"
    "\nRuns a scenario and writes its results to a folder: frames.fits (opens in ds9), run.sqlite\n"
    "(truth, detections, tracks, commands, telemetry, events), manifest.json, quicklook.png,\n"
    "pointing.png. While it runs the folder is OUT.partial. Ctrl-C closes the run properly,\n"
    "a second one ends it at once.\n\n"
    "  boresight run scenarios/neossat_geo_track.json --out runs/demo\n"
    "  boresight run scenarios/neossat_geo_track.json --duration 60 --set /record/frames=none\n"
    "\noptions:\n";

typedef struct run_request {
    bst_load_options load;
    bst_simulation_options simulation;
    bst_run_saving saving;
    const char *out, *replay;
    int64_t threads;
    bool help, overwrite, quiet, serial, force, view, no_pictures;
} run_request;

/* Creates the simulation and runs it. */
static bst_status create_and_run(bst_ctx *ctx, run_request *r, const bst_json *json,
                                 const bst_scenario *scenario, bst_simulation **sim,
                                 bst_run_request *request) {
    if (scenario->changes.count > 0) {
        return bst_run_parts_read(ctx, json, &r->simulation, bst_check_rules_apply, request);
    }
    BST_TRY(bst_run_restored_read(ctx, scenario, &r->saving, request->out, r->replay != NULL,
                                  &r->simulation, &request->restored));
    bst_status status = bst_simulation_create(ctx, scenario, &r->simulation, sim);
    if (status != BST_OK) {
        bst_json_name_file(ctx, json);
        return status;
    }
    BST_TRY(bst_run_link_prepare(ctx, &r->load, scenario, *sim, r->replay));
    BST_TRY(bst_check_rules_apply(ctx, scenario, *sim));
    return bst_run_scenario(ctx, scenario, *sim, request, NULL);
}

static bst_status run_loaded(bst_ctx *ctx, run_request *r, const bst_json *json,
                             const bst_scenario *scenario) {
    char default_out[128];
    snprintf(default_out, sizeof default_out, "runs/%s", scenario->name);
    bst_run_request request = {.out = r->out ? r->out : default_out,
                               .overwrite = r->overwrite,
                               .force = r->force,
                               .progress = !r->quiet && isatty(STDERR_FILENO),
                               .print = true,
                               .no_pictures = r->no_pictures,
                               .saving = &r->saving};
    bst_simulation *sim = NULL;
    struct bst_view_attached *page = NULL;
    bst_status status = r->view ? bst_app_open_page(ctx, scenario, request.out, &page) : BST_OK;
    request.steering = page ? bst_app_page->steering(page) : NULL;
    status = status == BST_OK ? create_and_run(ctx, r, json, scenario, &sim, &request) : status;
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
    }
    bst_run_link_end(sim, status, ctx->message);
    bst_simulation_free(sim);
    bst_run_restored_free(request.restored);
    bst_app_close_page(page);
    return status;
}

#define FIELD(member) .offset = offsetof(run_request, member)

static const bst_option OPTIONS[] = {
    BST_RUN_FOLDER_OPTIONS_AT(FIELD, out, overwrite, force),
    BST_RUN_SAVING_OPTIONS_AT(FIELD, saving),
    BST_LINK_OPTIONS_AT(FIELD, load),
    {.name = "replay",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(run_request, replay),
     .path = BST_PATH_INPUT,
     .argument = "RUN",
     .doc = "external modules do what they did in the run of this folder, without their peers"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, simulation.device, threads),
    {.name = "serial",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(run_request, serial),
     .doc = "do not process and record beside the simulation; the results are the same"},
    {.name = "no-pictures",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(run_request, no_pictures),
     .doc = "do not write quicklook.png and pointing.png"},
    {.name = "view",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(run_request, view),
     .doc = "show the run in the browser until its end, at an address that is printed"},
    {.name = "quiet",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(run_request, quiet),
     .doc = "no progress line"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(run_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_run(int argc, char **argv) {
    run_request r = {.load = BST_LOAD_DEFAULTS};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_INFO);
    const bst_command_line line = {"run", help_text, table, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "run");
    }
    ctx.log_level = r.quiet ? BST_LOG_WARNING : BST_LOG_INFO;
    r.simulation.threads = (int)r.threads;
    r.simulation.parallel = !r.serial;
    r.simulation.pace = true;
    r.simulation.replay = r.replay != NULL;
    if (bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "run");
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    if (bst_load_scenario(&ctx, argv[1], &r.load, &json, &scenario) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    bst_stop_catch_signals();
    bst_status status = run_loaded(&ctx, &r, json, &scenario);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return bst_command_line_exit_code(status);
}
