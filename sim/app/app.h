/* The commands of the program. Each takes its own argv (argv[0] is the name of the command) and
 * returns the exit status (sim/cli/cli.h). */
#ifndef BST_APP_APP_H
#define BST_APP_APP_H

#include "sim/cli/cli.h"
#include "sim/registry/registry.h"

/* A command of the program. */
typedef struct bst_app_command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *doc; /* one line for the list of commands */
} bst_app_command;

/* Runs the command that a command line names.
 *
 * Given:     argc, argv  of the program
 *            more        commands besides those that libboresight has, ended by name NULL;
 *                        NULL: none
 * Returned:  exit status (sim/cli/cli.h) */
int bst_app_run(int argc, char **argv, const bst_app_command *more);

struct bst_view_attached;
struct bst_run_steering;

struct bst_view_page_request; /* view/page_export.h */

/* What `boresight run --view` (view/attach.h) and `boresight export --page` use. */
typedef struct bst_app_viewer {
    bst_status (*attach)(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                         struct bst_view_attached **attached);
    const struct bst_run_steering *(*steering)(const struct bst_view_attached *attached);
    void (*detach)(struct bst_view_attached *attached);
    bst_status (*export_page)(bst_ctx *ctx, const struct bst_view_page_request *request);
} bst_app_viewer;

/* Viewer of the program; NULL in libboresight, which has none. Set it before bst_app_run. */
extern const bst_app_viewer *bst_app_page;

/* Opens a page of a run that is about to begin, as bst_view_attach.
 *
 * Errors:    BST_ERR_ARGUMENT: there is no viewer; those of bst_view_attach
 * Ownership: end it with bst_app_close_page */
bst_status bst_app_open_page(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                             struct bst_view_attached **page) BST_MUST_CHECK;
/* Closes a page; NULL is allowed. */
void bst_app_close_page(struct bst_view_attached *page);

/* boresight new: writes a scenario for an observer and a target. */
int bst_cmd_new(int argc, char **argv);
/* boresight run: runs a scenario and records it. */
int bst_cmd_run(int argc, char **argv);
/* boresight info: describes a run folder. */
int bst_cmd_info(int argc, char **argv);
/* boresight export: writes pictures, tables, orbits or observations of a run. */
int bst_cmd_export(int argc, char **argv);
/* boresight report: writes an HTML page about a run or study. */
int bst_cmd_report(int argc, char **argv);
/* boresight orbit: determines an orbit from the angles of a track. */
int bst_cmd_orbit(int argc, char **argv);
/* boresight process: recorded frames through the onboard chain. */
int bst_cmd_process(int argc, char **argv);
/* boresight twin: a scenario that renders what a recorded frame shows. */
int bst_cmd_twin(int argc, char **argv);
/* boresight solve: attitude of a FITS frame; argv[0] is "solve". Returns the exit code. */
int bst_cmd_solve(int argc, char **argv);
/* boresight score: detections or tracks against truth. */
int bst_cmd_score(int argc, char **argv);
/* boresight challenge: random frames with hidden truth. */
int bst_cmd_challenge(int argc, char **argv);
/* boresight characterize: a detector block from bias, dark and flat frames. */
int bst_cmd_characterize(int argc, char **argv);
/* boresight check: checks a scenario without running it. */
int bst_cmd_check(int argc, char **argv);
/* boresight loop: margins and predicted pointing of the control loops. */
int bst_cmd_loop(int argc, char **argv);
/* boresight lightcurve: magnitude of an object against time. */
int bst_cmd_lightcurve(int argc, char **argv);
/* boresight turntable: pictures of a satellite's shape. */
int bst_cmd_turntable(int argc, char **argv);
/* boresight schema: prints the JSON Schema of scenarios. */
int bst_cmd_schema(int argc, char **argv);
/* boresight serve: takes part in a run over the link. */
int bst_cmd_serve(int argc, char **argv);
/* boresight icd: prints the interface control document of the link. */
int bst_cmd_icd(int argc, char **argv);
/* boresight link-keys: writes new keys of the link to a file. */
int bst_cmd_link_keys(int argc, char **argv);
/* boresight stars: fetches, imports or describes a star catalogue. */
int bst_cmd_stars(int argc, char **argv);
/* boresight propagate: propagates element sets. */
int bst_cmd_propagate(int argc, char **argv);
/* boresight calframes: renders bias, dark and flat frames. */
int bst_cmd_calframes(int argc, char **argv);
/* boresight bench: measures the speed of the program. */
int bst_cmd_bench(int argc, char **argv);
/* boresight version: prints versions. */
int bst_cmd_version(int argc, char **argv);
/* boresight view: shows a run in the browser. */
int bst_cmd_view(int argc, char **argv);
/* boresight pd: measures the probability of detection of a sensor. */
int bst_cmd_pd(int argc, char **argv);
/* boresight calibrate-camera: measures a camera from the identified stars of a run. */
int bst_cmd_calibrate_camera(int argc, char **argv);
/* boresight calibrate-obsgen: fits the observation generator to rendered images. */
int bst_cmd_calibrate_obsgen(int argc, char **argv);
/* boresight study: runs a study, or one of its shards. */
int bst_cmd_study(int argc, char **argv);

#endif
