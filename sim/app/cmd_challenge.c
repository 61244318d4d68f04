/* boresight challenge: random frames with hidden truth. */
#include <errno.h>
#include <stdlib.h>

#include "sim/analysis/challenge/challenge.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"

static const char help_text[] =
    "usage: boresight challenge SEED --out FOLDER [options]\n"
    "\n"
    "Makes sequences of five frames of a random camera, in which up to six satellites move among "
    "the stars. Detectors\n"
    "get FOLDER/public: frames.fits, and frames.csv with sequence and number of each frame. "
    "FOLDER/truth stays with\n"
    "who scores: truth.csv, and the scenario and run that gave it. The seed gives the truth away, "
    "too.\n"
    "\n"
    "  boresight challenge 20261127 --out runs/challenge\n"
    "  boresight score mine.csv --truth runs/challenge/truth/truth.csv\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_challenge(int argc, char **argv) {
    bst_challenge_request q = BST_CHALLENGE_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_challenge_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_ERROR);
    const bst_command_line line = {"challenge", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    char *end = NULL;
    errno = 0;
    q.seed = arguments == 1 ? strtoull(argv[1], &end, 0) : 0;
    if (arguments != 1 || *end || end == argv[1] || *argv[1] == '-' || errno != 0) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one seed is expected, such as 42 or 0x2A");
        return bst_options_misuse(&ctx, "challenge");
    }
    q.table = options;
    bst_stop_catch_signals();
    return bst_command_line_end_as("challenge", &ctx, bst_challenge_make(&ctx, &q));
}
