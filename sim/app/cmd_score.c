/* boresight score: detections or tracks against truth or annotations. */
#include "sim/analysis/score/score.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"

static const char help_text[] =
    "usage: boresight score FOUND --truth PATH [options]\n"
    "\n"
    "Compares detections or tracks with the truth: precision, recall, F1, the metric of the "
    "spotGEO competition,\n"
    "GOSPA, each with a bootstrap interval. FOUND and PATH are the folder of a run, SatNet "
    "annotations (a folder or\n"
    "a file), a JSON file as spotGEO has them, or a CSV file with the columns x, y, frame and, if "
    "there are, score, id\n"
    "and sequence.\n"
    "\n"
    "  boresight score runs/demo --truth runs/demo --least-snr 6\n"
    "  boresight score mine.csv --truth runs/challenge_truth --json score.json\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_score(int argc, char **argv) {
    bst_score_request q = BST_SCORE_REQUEST_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_score_request_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"score", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one source of detections or tracks is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "score");
    }
    if (bst_score_request_check(&ctx, &q, argv[1]) != BST_OK) {
        return bst_options_misuse(&ctx, "score");
    }
    return bst_command_line_end_as("score", &ctx, bst_score_run(&ctx, &q, argv[1], stdout));
}
