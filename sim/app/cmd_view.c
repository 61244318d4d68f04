/* boresight view: shows a run in the browser. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stop_signals.h"
#include "view/browser.h"
#include "view/server.h"

static const char help_text[] =
    "usage: boresight view RUN [options]\n"
    "\n"
    "Shows the folder of a run in the browser: frames with truth, detections and tracks, plots "
    "over "
    "time, events.\n"
    "The page comes from this program and needs no network. It is for this machine only, and only "
    "for those who\n"
    "have the address that is printed. Folders of interrupted and killed runs are shown, too; "
    "nothing in them is\n"
    "changed. Ctrl-C ends it.\n"
    "\n"
    "  boresight view runs/demo\n"
    "  boresight view runs/demo --no-browser --port 8080\n"
    "\n"
    "Exit code: 0; 1 when the folder is not a run's, or the port is in use; 2 wrong usage.\n"
    "\n"
    "options:\n";

/* Serves a run until a signal asks for the end. */
static bst_status serve(bst_ctx *ctx, const char *folder, int port, bool browser) {
    bst_view_subject *subject;
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES];
    int64_t number;
    BST_TRY(bst_view_subject_create(ctx, &subject));
    bst_status status = bst_view_subject_open(ctx, subject, folder, &number);
    bst_stop_catch_signals();
    status = status == BST_OK ? bst_view_server_start(ctx, subject, port, url, &server) : status;
    if (status == BST_OK) {
        printf("%s\nCtrl-C ends it.\n", url);
        fflush(stdout);
        if (browser) {
            bst_view_open_browser(url);
        }
        while (!bst_stop_requested()) {
            nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
        }
        bst_view_server_stop(server);
    }
    bst_view_subject_free(subject);
    return status;
}

int bst_cmd_view(int argc, char **argv) {
    bool help = false, no_browser = false;
    int64_t port = 0;
    const bst_option table[] = {
        {.name = "no-browser",
         .kind = BST_OPTION_FLAG,
         .target = &no_browser,
         .doc = "only print the address"},
        {.name = "port",
         .kind = BST_OPTION_INT,
         .target = &port,
         .argument = "N",
         .doc = "TCP port on 127.0.0.1 (default 0: any free one)",
         .minimum = 0,
         .maximum = 65535},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"view", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one folder of a run is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "view");
    }
    return bst_command_line_end(&ctx, serve(&ctx, argv[1], (int)port, !no_browser));
}
