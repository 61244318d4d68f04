/* boresight study: runs of varied scenarios, and tables of their results. */
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/print_json.h"
#include "sim/cli/stop_signals.h"
#include "sim/registry/registry.h"
#include "sim/studies/local_pool.h"
#include "sim/study_kinds/study_emit.h"
#include "sim/study_kinds/study_execution.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_plugins.h"
#include "sim/study_kinds/study_shard.h"

static const char help_text[] =
    "usage: boresight study STUDY.json [options]\n"
    "       boresight study FOLDER --resume\n"
    "       boresight study STUDY.json --out FOLDER --gather PART...\n"
    "\n"
    "Goes through the settings of a study (docs/how-to/studies.md), runs each as often as it says, "
    "and\n"
    "makes tables of the results: FOLDER/study.sqlite and CSV files. Runs are executed by worker\n"
    "processes, each on cores of its own. What is done is safe: after Ctrl-C or a crash --resume\n"
    "does the rest, and the tables are the same. Every run can be made again by itself.\n"
    "\n"
    "  boresight study scenarios/studies/pd_trade.json --dry-run\n"
    "  boresight study scenarios/studies/pd_trade.json --out studies/pd\n"
    "  boresight study scenarios/studies/pd_trade.json --emit 17 > run17.json\n"
    "\n"
    "Exit codes: 0 all runs done, 1 some are missing, 4 all done but some failed by themselves,\n"
    "130 interrupted.\n"
    "\n"
    "options:\n";

static bool is_folder(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

static int command(bst_ctx *ctx, const bst_study_request *r, const char *given) {
    char file[4200], out[4200];
    bst_study study;
    bool folder = is_folder(given);
    snprintf(file, sizeof file, folder ? "%.4000s/study.json" : "%.4000s", given);
    if (bst_study_open(ctx, file, bst_registry_tables(), &study) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        return BST_EXIT_FAILED;
    }
    bst_study_plugins plugins = {.count = 0};
    bst_study_kind with_plugins = *bst_study_kind_of(study.config.kind);
    const bst_study_kind *kind = &with_plugins;
    with_plugins.user = &plugins;
    snprintf(out, sizeof out, "%s%.4000s", r->out || folder ? "" : "studies/",
             r->out   ? r->out
             : folder ? given
                      : study.config.name);
    bst_status status = BST_OK;
    int code = BST_EXIT_OK;
    if (r->emit >= 0) {
        status = bst_study_emit(ctx, &study, kind, r->emit, stdout, stderr);
    } else {
        snprintf(file, sizeof file, "%.4000s/study.json", out);
        bool checked = r->shard && access(file, F_OK) == 0; /* when the folder was made */
        status = checked ? BST_OK : bst_study_check(ctx, &study, kind);
        study.notes = plugins.notes;
        study.note_count = plugins.count;
        if (status == BST_OK && r->dry_run) {
            status = bst_study_check_inputs(ctx, r);
        }
        if (status == BST_OK) {
            if (r->dry_run) {
                bst_study_print_plan(&study, kind,
                                     bst_local_workers((int)r->workers, r->devices.count),
                                     bst_study_device(&r->devices, 0), out);
            } else {
                code = r->shard ? bst_study_execute_shard(ctx, r, &study, kind, out)
                                : bst_study_execute(ctx, r, &study, kind, out);
            }
        }
    }
    if (status != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx->message);
        code = status == BST_ERR_INTERRUPTED ? BST_EXIT_INTERRUPTED : BST_EXIT_FAILED;
    }
    bst_study_plugins_free(&plugins);
    bst_study_close(&study);
    return code;
}

int bst_cmd_study(int argc, char **argv) {
    bst_study_request r = {.emit = -1};
    bst_option table[BST_OPTIONS_MAX];
    bst_options_bind(bst_study_options, &r, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"study", help_text, table, &r.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (bst_study_request_check(&ctx, &r) != BST_OK) {
        return bst_options_misuse(&ctx, "study");
    }
    if (r.gather && arguments > 1) {
        r.parts = argv + 2;
        r.part_count = arguments - 1;
        arguments = 1;
    }
    if (arguments != !r.schema) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "%s study file is expected, %d were given",
                 r.schema ? "with --schema no" : "one", arguments);
        return bst_options_misuse(&ctx, "study");
    }
    if (r.gather && r.part_count == 0) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--gather: name the folders that --shard has made");
        return bst_options_misuse(&ctx, "study");
    }
    if (r.schema) {
        return bst_cli_print_json(bst_study_schema());
    }
    if (bst_study_devices_read(&ctx, r.device, &r.devices) != BST_OK) {
        return bst_options_misuse(&ctx, "study");
    }
    bst_stop_catch_signals();
    return command(&ctx, &r, argv[1]);
}
