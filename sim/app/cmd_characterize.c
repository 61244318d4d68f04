/* boresight characterize: a sensor's detector block from its own frames. */
#include <math.h>

#include "sim/analysis/characterize/characterize.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"

static const char help_text[] =
    "usage: boresight characterize --map MAP --out FOLDER [--bias PATH]... [--dark PATH]... "
    "[--flat PATH]... [--linearity PATH]... [options]\n"
    "\n"
    "Measures a sensor from its bias, dark and flat frames: gain, read noise, level and drift, "
    "offsets, dark current,\n"
    "hot pixels, response, linearity, full well, signal of the read-out, coherent pick-up, trails "
    "of charge, radiation\n"
    "hits; each with its uncertainty. Only\n"
    "what the given frames determine is written: FOLDER/detector.json (a scenario's camera keys), "
    "report.json, maps\n"
    "and a plot.\n"
    "\n"
    "  boresight characterize --map neossat --dark dark.fits --out runs/sensor\n"
    "  boresight characterize --map boresight --bias cal/a_b_bias.fits --dark cal/a_b_dark.fits "
    "\\\n"
    "    --flat cal/a_b_flat.fits --extends scenarios/neossat_geo_stare.json --out runs/sensor\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_characterize(int argc, char **argv) {
    bst_characterize_request q = BST_CHARACTERIZE_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_characterize_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"characterize", help_text, options, &q.help};
    int code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, NULL, &code)) {
        return code;
    }
    if (q.bias.count + q.dark.count + q.flat.count == 0) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--bias, --dark or --flat is expected");
        return bst_options_misuse(&ctx, "characterize");
    }
    if ((q.warm.count > 0) != isfinite(q.warmer_k) || q.warmer_k == 0.0) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "--warm and --warmer belong together, and --warmer is not 0: darks at another "
                 "temperature, and by how much it is higher");
        return bst_options_misuse(&ctx, "characterize");
    }
    bst_stop_catch_signals();
    return bst_command_line_end_as("characterize", &ctx, bst_characterize_run(&ctx, &q, stdout));
}
