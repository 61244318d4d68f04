/* The program's commands: each takes its own argv (argv[0] is the command's name) and returns the
 * exit code: 0 done, 1 failed, 2 called wrongly, 3 the run ended without its target in track (only
 * where asked), 4 a study with runs that failed, 130 interrupted. */
#ifndef BST_APP_APP_H
#define BST_APP_APP_H

#include "sim/app/registry.h"

enum {
    BST_EXIT_OK = 0,
    BST_EXIT_FAILED = 1,
    BST_EXIT_USAGE = 2,
    BST_EXIT_RUNS_FAILED = 4, /* a study is complete, but some of its runs failed by themselves */
    BST_EXIT_INTERRUPTED = 130
};

int bst_cmd_new(int argc, char **argv);
int bst_cmd_run(int argc, char **argv);
int bst_cmd_info(int argc, char **argv);
int bst_cmd_export(int argc, char **argv);
int bst_cmd_report(int argc, char **argv);
int bst_cmd_orbit(int argc, char **argv);
int bst_cmd_check(int argc, char **argv);
int bst_cmd_loop(int argc, char **argv);
int bst_cmd_schema(int argc, char **argv);
int bst_cmd_serve(int argc, char **argv);
int bst_cmd_icd(int argc, char **argv);
int bst_cmd_link_keys(int argc, char **argv);
int bst_cmd_stars(int argc, char **argv);
int bst_cmd_propagate(int argc, char **argv);
int bst_cmd_calframes(int argc, char **argv);
int bst_cmd_bench(int argc, char **argv);
int bst_cmd_pd(int argc, char **argv);
int bst_cmd_calibrate_obsgen(int argc, char **argv);
int bst_cmd_study(int argc, char **argv);

/* Log sink that writes to standard error: "boresight: warning: ...". */
void bst_app_log(void *user, bst_log_level level, const char *message);

#endif
