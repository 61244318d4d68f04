/* The program's commands: each takes its own argv (argv[0] is the command's name) and returns the
 * exit code: 0 done, 1 failed, 2 called wrongly, 3 the run ended without its target in track (only
 * where asked), 4 a study with runs that failed, 130 interrupted. */
#ifndef BST_APP_APP_H
#define BST_APP_APP_H

#include "sim/cli/cli.h"
#include "sim/registry/registry.h"

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

#endif
