/* boresight view: shows a run in the browser, recorded or live. */
#include <sys/stat.h>

#include "sim/analysis/check/scenario_rules.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "view/session.h"
#include "view/study_view.h"

static const char help_text[] =
    "usage: boresight view [RUN [RUN] | STUDY | SCENARIO.json] [options]\n"
    "\n"
    "Shows a run in the browser: frames with truth, detections and tracks, plots over time, "
    "events.\n"
    "\n"
    "  boresight view runs/demo                           plays a recorded run back\n"
    "  boresight view runs/demo runs/other                compares two runs\n"
    "  boresight view runs/study                          compares the runs of a study\n"
    "  boresight view scenarios/neossat_geo_track.json    runs it live: pause, step, change, "
    "rewind, branch\n"
    "  boresight view                                     shipped scenarios and the runs in runs/\n"
    "\n"
    "The page comes from this program and needs no network. It is for this machine only, and only "
    "for those who\n"
    "have the address that is printed. Folders of interrupted and killed runs are shown, too; "
    "nothing in them is\n"
    "changed. A live run is recorded with its changes: boresight run repeats it from the "
    "scenario.json of its folder.\n"
    "Ctrl-C ends it.\n"
    "\n"
    "Exit code: 0; 1 when the folder is not a run's, the scenario cannot run, or the port is in "
    "use; 2 wrong usage.\n"
    "\n"
    "options:\n";

#define FIELD(member) .offset = offsetof(bst_view_session, member)

static const bst_option OPTIONS[] = {
    {.name = "no-browser",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_view_session, no_browser),
     .doc = "only print the address"},
    {.name = "port",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_view_session, port),
     .argument = "N",
     .doc = "TCP port on 127.0.0.1 (default 0: any free one)",
     .minimum = 0,
     .maximum = 65535},
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_view_session, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "live: where the run is recorded (default runs/NAME-live, with a free number)"},
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_view_session, overwrite),
     .doc = "live: replace an earlier run there"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, device, threads),
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_view_session, help),
     .doc = "print this"},
    {.name = NULL},
};

/* Refuses options of a live run for what is no scenario. */
static bst_status check_use(bst_ctx *ctx, const bst_view_session *r, const char *path) {
    struct stat found;
    if (path && (stat(path, &found) != 0 || !S_ISDIR(found.st_mode))) {
        return BST_OK;
    }
    const struct {
        const char *name;
        bool given;
    } of[] = {{"out", r->out},
              {"overwrite", r->overwrite},
              {"set", r->load.set.count > 0},
              {"seed", r->load.seed},
              {"duration", r->load.duration_s >= 0},
              {"run-number", r->load.run >= 0},
              {"device", r->device},
              {"threads", r->threads > 0}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        if (of[i].given) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s is for a live run, and %s: give a SCENARIO.json, or leave --%s "
                            "away",
                            of[i].name, path ? "a recorded one was given" : "no file was given",
                            of[i].name);
        }
    }
    return BST_OK;
}

static bool is_file(const char *path) {
    struct stat found;
    return stat(path, &found) == 0 && S_ISREG(found.st_mode);
}

/* Refuses a scenario file or a study beside another path. */
static bst_status check_pair(bst_ctx *ctx, const char *path, const char *other) {
    const char *const both[] = {path, other};
    for (int i = 0; i < 2 && other; i++) {
        if (is_file(both[i]) || bst_view_is_study(both[i])) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "%s is %s, which is shown alone: two folders of runs can be compared",
                            both[i],
                            is_file(both[i]) ? "a scenario file" : "the folder of a study");
        }
    }
    return BST_OK;
}

int bst_cmd_view(int argc, char **argv) {
    bst_view_session r = {.load = BST_LOAD_DEFAULTS, .check = bst_check_rules_apply};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"view", help_text, table, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    const char *path = arguments > 0 ? argv[1] : NULL;
    r.other = arguments > 1 ? argv[2] : NULL;
    if (arguments > 2) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one or two folders of runs, the folder of a study, one scenario file, or none is "
                 "expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "view");
    }
    if (check_pair(&ctx, path, r.other) != BST_OK || check_use(&ctx, &r, path) != BST_OK ||
        bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "view");
    }
    return bst_command_line_end(&ctx, bst_view_serve(&ctx, &r, path));
}
