/* boresight calibrate-obsgen: fits the observation generator to the image path. */
#include <stdio.h>

#include "sim/analysis/calibration/calibrate_scenarios.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"

static const char help_text[] =
    "usage: boresight calibrate-obsgen SCENARIO.json... --out FILE [options]\n"
    "       boresight calibrate-obsgen --check SCENARIO.json... [--calibration FILE] "
    "[options]\n\n"
    "Runs the image path of scenarios and fits to it what the observation generator takes from "
    "measurement:\n"
    "threshold, noise, Pd by SNR and streak length, false alarms, errors of places. The file "
    "goes into the\n"
    "scenario's obsgen block as calibration_file. Only the first sensor counts; each run has "
    "another number.\n\n"
    "With --check: runs each scenario with images and with the generator and compares them: "
    "95 % bootstrap\n"
    "intervals over the runs, against the margins of equivalence. Exit code 1 when an interval "
    "is not inside.\n\n"
    "  boresight calibrate-obsgen scenarios/calibration/*.json --out obsgen.json\n"
    "  boresight calibrate-obsgen --check scenarios/neossat_geo_track.json --calibration "
    "obsgen.json --seeds 100\n\noptions:\n";

int bst_cmd_calibrate_obsgen(int argc, char **argv) {
    bst_calibration_order e = {.load = BST_LOAD_DEFAULTS, .seeds = 2};
    bool help = false;
    const bst_option table[] = {
        {.name = "out",
         .kind = BST_OPTION_TEXT,
         .target = &e.out,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "where the calibration goes"},
        {.name = "seeds",
         .kind = BST_OPTION_INT,
         .target = &e.seeds,
         .argument = "N",
         .doc = "runs of each scenario (default 2)",
         .minimum = 1,
         .maximum = 100000},
        {.name = "check",
         .kind = BST_OPTION_FLAG,
         .target = &e.check,
         .doc = "compare images and generator instead"},
        {.name = "calibration",
         .needs = "check",
         .kind = BST_OPTION_TEXT,
         .target = &e.calibration,
         .path = BST_PATH_INPUT,
         .argument = "FILE",
         .doc = "with --check: the generator's calibration (default: as the scenario says)"},
        {.name = "json",
         .needs = "check",
         .kind = BST_OPTION_TEXT,
         .target = &e.json,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "with --check and one scenario: write the figures there"},
        BST_LOAD_OPTIONS(e.load),
        BST_DEVICE_OPTIONS(e.device, e.threads),
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_ERROR);
    const bst_command_line line = {"calibrate-obsgen", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments < 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "at least one scenario file is expected");
    } else if (!e.check && !e.out) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--out is needed: where the calibration goes");
    } else if (e.check && e.out) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--check writes no calibration: leave --out away");
    } else if (e.json && arguments > 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "--json takes the figures of one scenario, %d were given: leave it away, or give "
                 "one scenario at a time",
                 arguments);
    }
    if (*ctx.message || bst_load_check(&ctx, &e.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "calibrate-obsgen");
    }
    bool equivalent = true;
    bst_status status = e.check ? bst_calibration_check(&ctx, &e, arguments, argv + 1, &equivalent)
                                : bst_calibration_make(&ctx, &e, arguments, argv + 1);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    return equivalent ? BST_EXIT_OK : BST_EXIT_FAILED;
}
