/* boresight orbit: an orbit from the directions that a run measured, or a TDM holds. */
#include <stdio.h>
#include <sys/stat.h>

#include "sim/analysis/orbit/orbit_options.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"

static const char help_text[] =
    "usage: boresight orbit RUN [options]\n"
    "       boresight orbit FILE.tdm --observer FILE.oem [options]\n"
    "\n"
    "Finds the orbit of a track from its measured directions alone: a first orbit (Gauss's method, "
    "the admissible\n"
    "region, two-point searches; chosen by residuals), then batch least squares over the whole arc "
    "with numerically\n"
    "integrated motion or SGP4, light time and the observer's states as the spacecraft believes "
    "them. True states are\n"
    "not used; of the scenario only the law that moves the object (--forces).\n"
    "\n"
    "  boresight orbit runs/first\n"
    "  boresight orbit runs/first --oem target.oem --omm target.json --predict 86400\n"
    "  boresight orbit runs/first --track 3 --tdm angles.tdm --report orbit.json\n"
    "  boresight orbit angles.tdm --observer eye.oem --sigma 0.5 --oem target.oem\n"
    "\n"
    "Without --track it is the track of interest with the most observations, else the track with "
    "the most.\n"
    "\n"
    "options:\n";

/* Error of an option for angles of a TDM that is given with a run, or the reverse. */
static bst_status check_options(bst_ctx *ctx, const bst_orbit_determination *q, const char *path) {
    struct stat info;
    if (stat(path, &info) != 0) {
        return BST_OK; /* an error of the reader */
    }
    const char *option = bst_orbit_run_option(q);
    if (option && S_ISREG(info.st_mode)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s is for the tracks of a run, and %s is a file: give a run's folder, "
                        "or leave --%s out",
                        option, path, option);
    }
    option = bst_orbit_tdm_option(q);
    if (!option || !S_ISDIR(info.st_mode)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "--%s is for angles of a TDM, and %s is a run, which has its own: give a "
                    "FILE.tdm, or leave --%s out",
                    option, path, option);
}

int bst_cmd_orbit(int argc, char **argv) {
    bst_orbit_command q = BST_ORBIT_COMMAND_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_orbit_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"orbit", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "one folder of a run, or a TDM, is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "orbit");
    }
    if (check_options(&ctx, &q.determination, argv[1]) != BST_OK) {
        return bst_options_misuse(&ctx, "orbit");
    }
    bst_status status = bst_orbit_determine(&ctx, &q.determination, argv[1]);
    return bst_command_line_end_as("orbit", &ctx, status);
}
