/* boresight turntable: pictures of a satellite's shape. */
#include <stdio.h>

#include "sim/analysis/shape/turntable.h"
#include "sim/app/app.h"
#include "sim/cli/command_line.h"
#include "sim/cli/options.h"

static const char help_text[] =
    "usage: boresight turntable SATELLITE [options]\n\n"
    "Draws a satellite's shape (JSON, OBJ, glTF or GLB) from eight sides, and writes it as a GLB "
    "file that\n"
    "other viewers open. Prints the number of parts and facets and its radius.\n\n"
    "  boresight turntable scenarios/satellites/gps_iif.json --png gps.png --glb gps.glb\n\n"
    "options:\n";

int bst_cmd_turntable(int argc, char **argv) {
    bool help = false;
    const char *png = NULL, *glb = NULL;
    int64_t size_px = 320;
    const bst_option table[] = {
        {.name = "png",
         .kind = BST_OPTION_TEXT,
         .target = &png,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "contact sheet: eight sides in two rows"},
        {.name = "glb",
         .kind = BST_OPTION_TEXT,
         .target = &glb,
         .path = BST_PATH_OUTPUT,
         .argument = "FILE",
         .doc = "the shape as binary glTF 2.0"},
        {.name = "size-px",
         .needs = "png",
         .kind = BST_OPTION_INT,
         .target = &size_px,
         .argument = "PX",
         .doc = "width of one picture of --png (default 320)",
         .minimum = 16,
         .maximum = 2048},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    const bst_command_line line = {"turntable", help_text, table, &help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "one satellite is expected, %d were given", arguments);
        return bst_options_misuse(&ctx, "turntable");
    }
    bst_satellite *satellite = NULL;
    bst_status status = bst_satellite_load(&ctx, argv[1], &satellite);
    if (status == BST_OK && png) {
        status = bst_turntable_draw(&ctx, satellite, png, (int)size_px);
    }
    if (status == BST_OK && glb) {
        status = bst_turntable_write_glb(&ctx, satellite, glb);
    }
    if (status == BST_OK) {
        printf("%d parts, %d facets, %d materials, radius %.4g m\n", satellite->part_count,
               satellite->facet_count, satellite->material_count, satellite->radius_m);
    }
    bst_satellite_free(satellite);
    return bst_command_line_end_as("turntable", &ctx, status);
}
