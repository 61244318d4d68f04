/* boresight report: a page of HTML about a run or a study. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/cli/stop_signals.h"
#include "sim/io/draft_file.h"
#include "sim/report/report_study.h"

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

/* report.html in the run's folder when nothing is given, or in the folder that is given. */
static bst_status choose_path(bst_ctx *ctx, const char *given, const char *folder,
                              char path[4096]) {
    struct stat info;
    bool inside = !given || (stat(given, &info) == 0 && S_ISDIR(info.st_mode));
    const char *base = given ? given : folder;
    int n = inside ? snprintf(path, 4096, "%s%sreport.html", base,
                              base[0] && base[strlen(base) - 1] == '/' ? "" : "/")
                   : snprintf(path, 4096, "%s", base);
    return n < 4096 ? BST_OK : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", base);
}

static bool is_study(const char *folder) {
    static const char *const names[] = {BST_STUDY_DATABASE, "study.json"};
    bool found = false;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        char path[4200];
        struct stat info;
        snprintf(path, sizeof path, "%.4096s/%s", folder, names[k]);
        found = found || stat(path, &info) == 0;
    }
    return found;
}

/* *damaged: the page is made, of a folder that is not whole. */
static bst_status make(bst_ctx *ctx, const char *folder, const char *out, char path[4096],
                       bool *damaged) {
    bst_run_reader *run = NULL;
    bst_draft draft;
    BST_TRY(choose_path(ctx, out, folder, path));
    bool study = is_study(folder);
    BST_TRY((study ? bst_run_reader_open_study : bst_run_reader_open)(ctx, folder, &run));
    bst_status status = bst_draft_open(ctx, path, &draft);
    if (status == BST_OK) {
        status = (study ? bst_report_study : bst_report_run)(ctx, run, draft.stream);
        status = bst_draft_close(ctx, &draft, status);
    }
    const char *problem;
    for (int i = 0; status == BST_OK && (problem = bst_run_reader_problem(run, i)); i++) {
        fprintf(stderr, "boresight: %s\n", problem);
        *damaged = true;
    }
    bst_run_reader_close(run);
    return status;
}

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
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "report");
    }
    if (help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one folder of a run or a study is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "report");
    }
    char path[4096];
    bst_stop_catch_signals();
    bool damaged = false;
    bst_status status = make(&ctx, argv[1], out, path, &damaged);
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED : BST_EXIT_FAILED;
    }
    printf("%s\n", path);
    return damaged ? BST_EXIT_FAILED : BST_EXIT_OK;
}
