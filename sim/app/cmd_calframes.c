/* boresight calframes: bias, dark and flat frames of a scenario's sensors. */
#include <stdio.h>

#include "sim/analysis/calibration/calibration_frames.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/cli/stop_signals.h"

typedef struct calframes_request {
    bst_load_options load;
    bst_calibration_frames frames;
    int64_t threads;
    bool help;
} calframes_request;

#define FIELD(member) .offset = offsetof(calframes_request, member)

static const bst_option OPTIONS[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(calframes_request, frames.out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where the files go; it is made when missing",
     .required = true},
    {.name = "bias",
     .kind = BST_OPTION_INT,
     .offset = offsetof(calframes_request, frames.bias),
     .argument = "N",
     .doc = "frames without light and exposure (default 10; 0: none)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "dark",
     .kind = BST_OPTION_INT,
     .offset = offsetof(calframes_request, frames.dark),
     .argument = "N",
     .doc = "frames without light (default 10)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "flat",
     .kind = BST_OPTION_INT,
     .offset = offsetof(calframes_request, frames.flat),
     .argument = "N",
     .doc = "frames in even light (default 10)",
     .minimum = 0,
     .maximum = 1e6},
    {.name = "linearity",
     .kind = BST_OPTION_INT,
     .offset = offsetof(calframes_request, frames.linearity),
     .argument = "N",
     .doc = "exposures in the light of the flats, two frames each, to beyond what fits (default 0)",
     .minimum = 0,
     .maximum = 10000},
    {.name = "exposure",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(calframes_request, frames.exposure_s),
     .argument = "S",
     .doc = "exposure time of darks and flats (default: the scenario's)",
     .minimum = 1e-6,
     .maximum = 1e6},
    {.name = "level",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(calframes_request, frames.level_e),
     .argument = "E",
     .doc = "electrons of light per pixel in flats (default: half of what fits)",
     .minimum = 1e-3,
     .maximum = 1e9},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(calframes_request, frames.sensor),
     .argument = "OBSERVER/SENSOR",
     .doc = "only this one (default all)"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, frames.device, threads),
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(calframes_request, help),
     .doc = "print this"},
    {.name = NULL},
};

/* Refuses to make nothing, and options of series that are not made. */
static bst_status check_series(bst_ctx *ctx, const bst_calibration_frames *f) {
    if (f->bias + f->dark + f->flat + f->linearity == 0) {
        return bst_fail(
            ctx, BST_ERR_ARGUMENT,
            "--bias, --dark, --flat and --linearity are all 0, so that nothing would be made");
    }
    if (f->level_e > 0.0 && f->flat + f->linearity == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--level has no effect, as --flat and --linearity are 0: leave it out");
    }
    if (f->exposure_s > 0.0 && f->dark + f->flat + f->linearity == 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--exposure has no effect, as --dark, --flat and --linearity are 0: leave "
                        "it out");
    }
    return BST_OK;
}

int bst_cmd_calframes(int argc, char **argv) {
    calframes_request r = {.load = BST_LOAD_DEFAULTS,
                           .frames = {.bias = 10, .dark = 10, .flat = 10}};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_ERROR);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "calframes");
    }
    if (r.help) {
        printf(
            "usage: boresight calframes SCENARIO.json --out FOLDER [options]\n\n"
            "Makes bias, dark and flat frames of a scenario's sensors: FITS files\n"
            "OBSERVER_SENSOR_bias.fits, _dark.fits, _flat.fits and _linearity.fits with one "
            "extension per frame.\n"
            "Fixed patterns are those of the scenario's runs.\n\n"
            "  boresight calframes scenarios/neossat_geo_track.json --out cal --dark 50\n\n"
            "options:\n");
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "calframes");
    }
    if (check_series(&ctx, &r.frames) != BST_OK || bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "calframes");
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    if (bst_load_scenario(&ctx, argv[1], &r.load, &json, &scenario) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    bst_stop_catch_signals();
    r.frames.threads = (int)r.threads;
    bst_status status = bst_load_check_sensor(&ctx, &scenario, r.frames.sensor);
    if (status == BST_OK) {
        status = bst_calibration_frames_make(&ctx, &r.frames, &scenario);
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return bst_command_line_end(&ctx, status);
}
