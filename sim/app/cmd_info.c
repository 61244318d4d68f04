/* boresight info: what a run's folder holds. */
#include <stdio.h>

#include "sim/app/app.h"
#include "sim/cli/options.h"
#include "sim/report/report_info.h"

static const char help_text[] =
    "usage: boresight info RUN [options]\n"
    "\n"
    "Prints what the folder of a run holds: scenario, version, seed, device, span of time, how the "
    "run ended,\n"
    "frames per sensor, tables, summary figures, events and files. It reads folders of complete, "
    "interrupted\n"
    "and killed runs, and of runs that are still being written, and never changes anything in "
    "them.\n"
    "\n"
    "  boresight info runs/demo\n"
    "  boresight info runs/demo.partial --json | jq .state\n"
    "\n"
    "Exit code: 0; 1 when the folder is damaged or not a run's (what is wrong is on the standard "
    "error); 2\n"
    "wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_info(int argc, char **argv) {
    bool help = false, json = false, columns = false;
    const bst_option table[] = {
        {.name = "json",
         .kind = BST_OPTION_FLAG,
         .target = &json,
         .doc = "print JSON, for scripts"},
        {.name = "columns",
         .kind = BST_OPTION_FLAG,
         .target = &columns,
         .doc = "list the columns of the tables too"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "info");
    }
    if (help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one folder of a run is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "info");
    }
    bst_run_reader *run = NULL;
    if (bst_run_reader_open(&ctx, argv[1], &run) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_FAILED;
    }
    cJSON *info = bst_report_info(run);
    int code = BST_EXIT_OK;
    if (json) {
        char *text = cJSON_Print(info);
        printf("%s\n", text ? text : "");
        code = text ? code : BST_EXIT_FAILED;
        cJSON_free(text);
    } else {
        bst_report_info_print(run, info, columns);
    }
    fflush(stdout);
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(run, i)); i++) {
        fprintf(stderr, "boresight: %s\n", problem);
        code = BST_EXIT_FAILED;
    }
    if (ferror(stdout)) {
        fprintf(stderr, "boresight: the output cannot be written\n");
        code = BST_EXIT_FAILED;
    }
    cJSON_Delete(info);
    bst_run_reader_close(run);
    return code;
}
