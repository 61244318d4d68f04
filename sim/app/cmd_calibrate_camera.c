/* boresight calibrate-camera: a camera from the identified stars of a run. */
#include "sim/analysis/camera/camera_calibration.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"

static const char help_text[] =
    "usage: boresight calibrate-camera RUN --out FOLDER [options]\n"
    "\n"
    "Measures a camera from the stars that a run has identified in its frames, recorded ones "
    "(boresight process) or\n"
    "rendered ones: pixel scale, distortion, width of the stars over the field, zero point and "
    "colour term, each with\n"
    "its uncertainty. Each frame's attitude is free. FOLDER/camera.json has a scenario's camera "
    "keys; report.json,\n"
    "stars.csv and plot.png say how good it is. With --psf-columns and --psf-rows FOLDER/psf.fits "
    "is "
    "the PSF, measured on\n"
    "the stars.\n"
    "\n"
    "  boresight process night/*.fits --map neossat --out runs/real\n"
    "  boresight calibrate-camera runs/real/run --extends my_camera.json --out runs/camera\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

int bst_cmd_calibrate_camera(int argc, char **argv) {
    bst_camera_calibration_request q = BST_CAMERA_CALIBRATION_DEFAULTS;
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_camera_calibration_options, &q, options);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"calibrate-camera", help_text, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one folder of a run is expected, %d were given",
                 arguments);
        return bst_options_misuse(&ctx, "calibrate-camera");
    }
    return bst_command_line_end_as("calibrate-camera", &ctx,
                                   bst_camera_calibration_run(&ctx, &q, argv[1], stdout));
}
