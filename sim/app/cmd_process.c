/* boresight process: frames of other programs through the chain that flies in the simulator. */
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "sim/process/process.h"

static const char help_text[] =
    "usage: boresight process FILES... --map MAP --out FOLDER [options]\n"
    "\n"
    "Processes recorded frames as if they came from a simulated sensor. FILES are FITS files, "
    "side tables (CSV)\n"
    "of PNG or TIFF files, folders of them, runs, SatNet sets, or text files with a path a line. "
    "Each frame's attitude and the path of its "
    "streaks come from its\n"
    "stars alone. A scenario with these frames is written and run: detections, star "
    "identification, tracks. Written\n"
    "are FOLDER/report.html, products/ (CSV tables, light curves, TDM, annotated pictures), run/ "
    "(tables, and frames\n"
    "with their WCS) and input/ (the scenario).\n"
    "\n"
    "  boresight process night/*.fits --map neossat --out runs/real\n"
    "  boresight process night/ --map my_camera.json --scale 3.1 --out runs/real\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage. Frames without enough stars are no failure.\n"
    "\n"
    "options:\n";

int bst_cmd_process(int argc, char **argv) {
    bst_process_request q = BST_PROCESS_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_process_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"process", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments < 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "at least one file of frames is expected");
        return bst_options_misuse(&ctx, "process");
    }
    q.table = options;
    bst_stop_catch_signals();
    bst_status status = bst_process_frames(&ctx, &q, (const char *const *)(argv + 1), arguments);
    return bst_command_line_end_as("process", &ctx, status);
}
