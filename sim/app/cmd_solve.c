/* boresight solve: attitude and pixel scale of a FITS frame from its pixels alone. */
#include <stdio.h>

#include "sim/analysis/solve/solve_frame.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"

static const char help_text[] =
    "usage: boresight solve FRAME.fits --scale ARCSEC --utc UTC [options]\n"
    "\n"
    "Finds where a frame looks from its stars alone, without any attitude. The stars may be points "
    "or streaks of a\n"
    "common shape, straight or curved: the brightest one that lies wholly in the frame gives the "
    "shape. Directions are\n"
    "apparent, of the middle of the frame; of streaks, at both ends.\n"
    "\n"
    "  boresight solve frame.fits --scale 3 --utc 2024-08-26T17:45:45Z\n"
    "\n"
    "Exit code: 0 solved, 1 not, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_solve(int argc, char **argv) {
    bst_solve_request q = BST_SOLVE_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_solve_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"solve", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one FITS file of a frame is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "solve");
    }
    bool solved = false;
    bst_status status = bst_solve_frame(&ctx, &q, argv[1], stdout, &solved);
    code = bst_command_line_end_as("solve", &ctx, status);
    return code == BST_EXIT_OK && !solved ? BST_EXIT_FAILED : code;
}
