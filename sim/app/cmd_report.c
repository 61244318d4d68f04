/* boresight report: a page of HTML about a run or a study. */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "sim/report/report_file.h"

static const char help_text[] =
    "usage: boresight report RUN|STUDY [options]\n"
    "\n"
    "Writes one page of HTML about a run: what went wrong first, what was run, the figures, charts "
    "of pointing,\n"
    "track, detections and geometry over time, some frames with what was detected and what is "
    "true, "
    "and the events.\n"
    "Of a study: failures first, what was varied, the figures and their intervals, charts against "
    "each axis,\n"
    "curves, histograms, sensitivity. The file holds all that it shows and opens in a browser "
    "without a network.\n"
    "Interrupted and killed runs are reported as far as they go. Nothing that a run or a study "
    "wrote "
    "is changed.\n"
    "\n"
    "  boresight report runs/demo --out demo.html\n"
    "  boresight report studies/noise\n"
    "\n"
    "Exit code: 0; 1 when it cannot be made (no file is left then), or is made of a damaged "
    "folder; 2 "
    "wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_report(int argc, char **argv) {
    bool help = false;
    const char *out = NULL;
    const bst_option table[] = {
        {.name = "out",
         .kind = BST_OPTION_TEXT,
         .target = &out,
         .path = BST_PATH_OUTPUT_INTO,
         .argument = "FILE",
         .doc = "where the page goes (default report.html in the folder)"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"report", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one folder of a run or a study is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "report");
    }
    char path[4096];
    bst_stop_catch_signals();
    bool damaged = false;
    bst_status status = bst_report_write(&ctx, argv[1], out, path, &damaged);
    if (status != BST_OK) {
        return bst_command_line_end(&ctx, status);
    }
    printf("%s\n", path);
    return damaged ? BST_EXIT_FAILED : BST_EXIT_OK;
}
