#include <stdio.h>
#include <stdlib.h>

#include "sim/app/app.h"
#include "sim/cli/load.h"
#include "sim/cli/stop_signals.h"
#include "sim/run/link_host.h"

static const char help_text[] =
    "usage: boresight serve SCENARIO.json --part MODULE --link ADDRESS [options]\n"
    "\n"
    "Plays one module of a scenario (image processing, tracker or control; plug-ins too) for a run "
    "elsewhere\n"
    "that has it outside, and ends with that run. Both are given the same scenario; the results "
    "are those of a\n"
    "run that has the module inside.\n"
    "\n"
    "  boresight run scenarios/neossat_geo_track.json --link tcp://127.0.0.1:5555 --external "
    "control &\n"
    "  boresight serve scenarios/neossat_geo_track.json --link tcp://127.0.0.1:5555 --part "
    "control\n"
    "\n"
    "options:\n";

typedef struct serve_request {
    bst_load_options load;
    const char *part, *address;
    int64_t threads;
    double timeout_s;
    bool help, shared;
} serve_request;

static int serve(bst_ctx *ctx, const char *file, const serve_request *r) {
    bst_json *json = NULL;
    bst_scenario scenario;
    if (bst_load_scenario(ctx, file, &r->load, &json, &scenario) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    bst_stop_catch_signals();
    bst_link_host *host = NULL;
    int reason = 0;
    bst_status status = bst_link_host_create(ctx, &scenario, r->part, (int)r->threads, &host);
    if (status == BST_OK) {
        bst_link_host_use_keys(host, r->load.link_keys);
        status = bst_link_host_play(ctx, host, r->address, r->shared, r->timeout_s,
                                    bst_stop_requested, &reason);
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
    }
    bst_link_host_free(host);
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status == BST_ERR_INTERRUPTED     ? BST_EXIT_INTERRUPTED
           : status != BST_OK || reason == 2 ? BST_EXIT_FAILED
                                             : BST_EXIT_OK;
}

int bst_cmd_serve(int argc, char **argv) {
    serve_request r = {.load = BST_LOAD_DEFAULTS, .timeout_s = 60.0};
    const bst_option table[] = {
        {.name = "link",
         .kind = BST_OPTION_TEXT,
         .target = &r.address,
         .argument = "ADDRESS",
         .doc = "where the run is: tcp://127.0.0.1:PORT or ipc://PATH"},
        {.name = "link-keys",
         .kind = BST_OPTION_TEXT,
         .target = &r.load.link_keys,
         .path = BST_PATH_INPUT,
         .argument = "FILE",
         .doc = "keys of boresight link-keys, where the run asks for them"},
        {.name = "part",
         .kind = BST_OPTION_TEXT,
         .target = &r.part,
         .argument = "MODULE",
         .doc = "imgproc, tracker, control, or OBSERVER/SENSOR/MODULE"},
        {.name = "shared-memory",
         .kind = BST_OPTION_FLAG,
         .target = &r.shared,
         .doc = "take frames by shared memory where the run offers it"},
        {.name = "timeout",
         .kind = BST_OPTION_REAL,
         .target = &r.timeout_s,
         .argument = "S",
         .doc = "end when nothing has come for so long (default 60)",
         .minimum = 0.1,
         .maximum = 1e6},
        BST_LOAD_OPTIONS(r.load),
        {.name = "threads",
         .kind = BST_OPTION_INT,
         .target = &r.threads,
         .argument = "N",
         .doc = "threads (default: one per processor)",
         .minimum = 0,
         .maximum = 1024},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &r.help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_INFO);
    int arguments = 0;
    if (bst_options_parse(&ctx, table, argc, argv, &arguments) != BST_OK) {
        return bst_options_misuse(&ctx, "serve");
    }
    if (r.help) {
        fputs(help_text, stdout);
        bst_options_print(stdout, table);
        return BST_EXIT_OK;
    }
    if (arguments != 1 || !r.part || !r.address) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one scenario file, --part and --link are expected");
        return bst_options_misuse(&ctx, "serve");
    }
    if (bst_load_check(&ctx, &r.load, table) != BST_OK) {
        return bst_options_misuse(&ctx, "serve");
    }
    return serve(&ctx, argv[1], &r);
}
