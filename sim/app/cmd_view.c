/* boresight view: shows a run in the browser, recorded or live. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/load.h"
#include "sim/cli/stop_signals.h"
#include "view/browser.h"
#include "view/server.h"

static const char help_text[] =
    "usage: boresight view [RUN | SCENARIO.json] [options]\n"
    "\n"
    "Shows a run in the browser: frames with truth, detections and tracks, plots over time, "
    "events.\n"
    "\n"
    "  boresight view runs/demo                           plays a recorded run back\n"
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

typedef struct view_request {
    bst_load_options load;
    const char *device, *out;
    int64_t port, threads;
    bool help, no_browser, overwrite;
} view_request;

/* Prints the address and opens a browser there. */
static void announce(const view_request *r, const char *url) {
    printf("%s\nCtrl-C ends it.\n", url);
    fflush(stdout);
    if (!r->no_browser) {
        bst_view_open_browser(url);
    }
}

static void wait_for_stop(void) {
    while (!bst_stop_requested()) {
        nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
    }
}

/* Serves a recorded run until a signal asks for the end. */
static bst_status serve_run(bst_ctx *ctx, const view_request *r, bst_view_subject *subject,
                            const char *folder) {
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES];
    int64_t number;
    if (folder) {
        BST_TRY(bst_view_subject_open(ctx, subject, folder, &number));
    }
    BST_TRY(bst_view_server_start(ctx, subject, NULL, (int)r->port, url, &server));
    announce(r, url);
    wait_for_stop();
    bst_view_server_stop(server);
    return BST_OK;
}

/* A folder in runs/ that does not exist yet. */
static void choose_folder(const bst_scenario *scenario, char *out, size_t bytes) {
    struct stat found;
    char partial[200];
    int number = 1;
    do {
        int length = snprintf(out, bytes, "runs/%s-live", scenario->name);
        if (number > 1 && length > 0 && (size_t)length < bytes) {
            snprintf(out + length, bytes - (size_t)length, "-%d", number);
        }
        snprintf(partial, sizeof partial, "%s.partial", out);
        number++;
    } while (stat(out, &found) == 0 || stat(partial, &found) == 0);
}

/* Runs a scenario that is read, steered from the page. */
static bst_status go_live(bst_ctx *ctx, const view_request *r, bst_run_parts *parts,
                          bst_view_subject *subject) {
    bst_view_live *live;
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES], chosen[160];
    const char *out = r->out;
    if (!out) {
        choose_folder(bst_run_parts_scenario(parts), chosen, sizeof chosen);
        out = chosen;
    }
    BST_TRY(bst_view_live_create(ctx, parts, subject, out, &live));
    bst_status status = bst_view_server_start(ctx, subject, live, (int)r->port, url, &server);
    if (status == BST_OK) {
        announce(r, url);
        status = bst_view_live_go(ctx, live, r->overwrite);
        bst_view_server_stop(server);
    }
    bst_view_live_free(live);
    return status;
}

static bst_status serve_live(bst_ctx *ctx, const view_request *r, bst_view_subject *subject,
                             const char *scenario) {
    const bst_simulation_options options = {
        .device = r->device, .threads = (int)r->threads, .parallel = true};
    bst_run_parts *parts;
    BST_TRY(bst_run_parts_open(ctx, scenario, &r->load, &options, &parts));
    bst_status status = go_live(ctx, r, parts, subject);
    bst_run_parts_free(parts);
    return status;
}

static bst_status serve(bst_ctx *ctx, const view_request *r, const char *path) {
    bst_view_subject *subject;
    struct stat found;
    BST_TRY(bst_view_subject_create(ctx, &subject));
    bst_stop_catch_signals();
    const bool scenario = path && stat(path, &found) == 0 && S_ISREG(found.st_mode);
    bst_status status =
        scenario ? serve_live(ctx, r, subject, path) : serve_run(ctx, r, subject, path);
    bst_view_subject_free(subject);
    return status;
}

#define FIELD(member) .offset = offsetof(view_request, member)

static const bst_option OPTIONS[] = {
    {.name = "no-browser",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(view_request, no_browser),
     .doc = "only print the address"},
    {.name = "port",
     .kind = BST_OPTION_INT,
     .offset = offsetof(view_request, port),
     .argument = "N",
     .doc = "TCP port on 127.0.0.1 (default 0: any free one)",
     .minimum = 0,
     .maximum = 65535},
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(view_request, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "live: where the run is recorded (default runs/NAME-live, with a free number)"},
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(view_request, overwrite),
     .doc = "live: replace an earlier run there"},
    BST_LOAD_OPTIONS_AT(FIELD, load),
    BST_DEVICE_OPTIONS_AT(FIELD, device, threads),
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(view_request, help),
     .doc = "print this"},
    {.name = NULL},
};

int bst_cmd_view(int argc, char **argv) {
    view_request r = {.load = BST_LOAD_DEFAULTS};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"view", help_text, table, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments > 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one folder of a run, one scenario file, or none is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "view");
    }
    if (bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "view");
    }
    return bst_command_line_end(&ctx, serve(&ctx, &r, arguments == 1 ? argv[1] : NULL));
}
