/* boresight twin: a scenario that renders what a recorded frame shows. */
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "sim/process/twin/twin.h"

static const char help_text[] =
    "usage: boresight twin FILES... --map MAP --out FILE.json [options]\n"
    "\n"
    "Makes the digital twin of a recorded frame. Its stars give the attitude. The path of the line "
    "of sight within\n"
    "the exposure, PSF, background, noise, zero point, colour term and the light of all stars are "
    "fitted to the pixels,\n"
    "also of stars that no catalogue has. Written are the scenario FILE.json, and beside it what "
    "it reads (FILE_path.json,\n"
    "FILE_psf.fits, FILE_stars.bin, FILE_dark.fits), its run (FILE_run), and the comparison with "
    "the recorded frame\n"
    "(FILE_report.html, FILE_report.json, FILE_report.png). Change the scenario and run it: what "
    "if.\n"
    "\n"
    "  boresight twin frame.fits --map neossat --out runs/twin.json\n"
    "  boresight run runs/twin.json --out runs/half --set "
    "/observers/0/sensors/0/camera/aperture_m=0.1\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_twin(int argc, char **argv) {
    bst_twin_request q = BST_TWIN_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_twin_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"twin", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments < 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "at least one file of frames is expected");
        return bst_options_misuse(&ctx, "twin");
    }
    q.table = options;
    bst_stop_catch_signals();
    return bst_command_line_end_as(
        "twin", &ctx, bst_twin_make(&ctx, &q, (const char *const *)(argv + 1), arguments));
}
