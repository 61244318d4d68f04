/* boresight loop: margins and predicted pointing of a scenario's control loops. */
#include "sim/analysis/loop/loop_sensors.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/io/plot.h"

static const char help_text[] =
    "usage: boresight loop SCENARIO.json [options]\n\n"
    "Linearises the control loops of a scenario and prints, for each axis of a mount, the "
    "margins of its\n"
    "servo and of the tracking loop round it, and the pointing error that jitter, drift "
    "and the frames'\n"
    "errors leave. Nothing is simulated.\n\n"
    "  boresight loop scenarios/neossat_geo_track.json --plot loop.png --json loop.json\n\n"
    "options:\n";

int bst_cmd_loop(int argc, char **argv) {
    bool help = false;
    bst_load_options load = BST_LOAD_DEFAULTS;
    bst_loop_report_request r = {.loop = BST_LOOP_DEFAULTS};
    const bst_option table[] = {
        {.name = "plot",
         .kind = BST_OPTION_TEXT,
         .target = &r.plot,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "Bode, Nyquist, step response and rejection as PNG or SVG (the first sensor's)"},
        {.name = "json",
         .kind = BST_OPTION_TEXT,
         .target = &r.json,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "the figures as JSON; - prints them in place of the table"},
        {.name = "sensor",
         .kind = BST_OPTION_TEXT,
         .target = &r.sensor,
         .argument = "OBSERVER/SENSOR",
         .doc = "this sensor only"},
        {.name = "fix-sigma-px",
         .kind = BST_OPTION_REAL,
         .target = &r.loop.fix_sigma_px,
         .argument = "PX",
         .doc = "error of the attitude from a frame's stars, per axis (default 0.01)",
         .minimum = 0,
         .maximum = 100},
        BST_LOAD_OPTIONS(load),
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"loop", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (bst_plot_check_path(&ctx, r.plot) != BST_OK) {
        return bst_options_misuse(&ctx, "loop");
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "loop");
    }
    if (bst_load_check(&ctx, &load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "loop");
    }
    bst_json *json = NULL;
    bst_scenario scenario;
    bst_status status = bst_load_scenario(&ctx, argv[1], &load, &json, &scenario);
    if (status == BST_OK) {
        status = bst_loop_report_sensors(&ctx, &r, &scenario);
        bst_scenario_free(&scenario);
        bst_json_free(json);
    }
    return bst_command_line_end(&ctx, status);
}
