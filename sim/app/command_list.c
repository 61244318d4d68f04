/* The commands by name: help, options before the command, and the call. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "boresight/version.h"
#include "sim/app/app.h"
#include "sim/cli/plugin_options.h"
#include "sim/cli/stack.h"
#include "sim/core/text.h"

static const bst_app_command commands[] = {
    {"new", bst_cmd_new, "write a first scenario for two satellites"},
    {"run", bst_cmd_run, "run a scenario"},
    {"info", bst_cmd_info, "what the folder of a run holds"},
    {"report", bst_cmd_report, "a page of HTML about a run or a study"},
    {"export", bst_cmd_export, "frames, tables, orbits and observations of a run for others"},
    {"orbit", bst_cmd_orbit, "an orbit from the directions that a run measured"},
    {"process", bst_cmd_process, "frames of other programs through the onboard chain"},
    {"twin", bst_cmd_twin, "a scenario that renders what a recorded frame shows"},
    {"solve", bst_cmd_solve, "where a frame looks, from its stars alone"},
    {"score", bst_cmd_score, "detections or tracks against truth or annotations"},
    {"challenge", bst_cmd_challenge, "random frames with hidden truth, for detectors to find"},
    {"check", bst_cmd_check, "validate a scenario and print it with every default written out"},
    {"loop", bst_cmd_loop, "margins and predicted pointing of a scenario's control loops"},
    {"lightcurve", bst_cmd_lightcurve, "magnitude of an object or a shape against time"},
    {"turntable", bst_cmd_turntable, "pictures of a satellite's shape, and a GLB file of it"},
    {"schema", bst_cmd_schema, "print the JSON Schema of scenarios"},
    {"serve", bst_cmd_serve, "play a module of a scenario over the link"},
    {"link-keys", bst_cmd_link_keys, "make keys for a link that takes only peers that have them"},
    {"icd", bst_cmd_icd, "print the interface control document of the link"},
    {"stars", bst_cmd_stars, "get, import or describe the star catalogue"},
    {"propagate", bst_cmd_propagate, "positions and velocities from two-line element sets"},
    {"calframes", bst_cmd_calframes, "bias, dark and flat frames of a scenario's sensors"},
    {"characterize", bst_cmd_characterize, "a sensor from its own bias, dark and flat frames"},
    {"calibrate-camera", bst_cmd_calibrate_camera, "a camera from the stars of its own frames"},
    {"calibrate-obsgen", bst_cmd_calibrate_obsgen, "fit the observation generator to images"},
    {"study", bst_cmd_study, "many runs of varied scenarios, as tables"},
    {"pd", bst_cmd_pd, "measure detection, false alarms and location against theory"},
};

static void usage(FILE *stream, const bst_app_command *more) {
    fprintf(stream,
            "Boresight simulates a space-based telescope that finds and tracks satellites.\n"
            "\n"
            "usage: boresight [--plugin FILE]... [--no-plugins] COMMAND [options]\n"
            "       boresight help [COMMAND]\n"
            "\ncommands:\n");
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        fprintf(stream, "  %-16s %s\n", commands[i].name, commands[i].doc);
    }
    for (; more && more->name; more++) {
        fprintf(stream, "  %-16s %s\n", more->name, more->doc);
    }
    fprintf(
        stream,
        "\n"
        "A first run:\n"
        "  boresight run scenarios/neossat_geo_track.json --out runs/first\n"
        "\n"
        "--plugin FILE adds the modules of a shared library to those that scenarios can name:\n"
        "  boresight --plugin ./my_detector.so pd scenarios/detection.json \\\n"
        "    --set /observers/0/sensors/0/modules/imgproc='{\"type\": \"mine\"}'\n"
        "\n"
        "--no-plugins refuses scenarios that name shared libraries: for those that others wrote.\n"
        "\n"
        "\"boresight help COMMAND\" says more. Exit codes: 0 done, 1 failed, 2 called wrongly,\n"
        "130 interrupted.\n");
}

static const bst_app_command *find_command(const char *name, const bst_app_command *more) {
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (strcmp(name, commands[i].name) == 0) {
            return &commands[i];
        }
    }
    while (more && more->name && strcmp(name, more->name) != 0) {
        more++;
    }
    return more && more->name ? more : NULL;
}

static int unknown_command(const char *name, const bst_app_command *more) {
    const char *nearest = NULL;
    size_t best = SIZE_MAX;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (bst_text_is_nearer(name, commands[i].name, &best)) {
            nearest = commands[i].name;
        }
    }
    for (; more && more->name; more++) {
        if (bst_text_is_nearer(name, more->name, &best)) {
            nearest = more->name;
        }
    }
    fprintf(stderr, "boresight: there is no command \"%.80s\"%s%s%s; see boresight --help\n", name,
            nearest ? "; did you mean \"" : "", nearest ? nearest : "", nearest ? "\"?" : "");
    return BST_EXIT_USAGE;
}

/* "boresight help COMMAND" is "boresight COMMAND --help". */
static int help(int argc, char **argv, const bst_app_command *more) {
    if (argc < 3 || strcmp(argv[2], "help") == 0) {
        usage(stdout, more);
        return BST_EXIT_OK;
    }
    const bst_app_command *found = find_command(argv[2], more);
    if (!found) {
        return unknown_command(argv[2], more);
    }
    if (argc > 3) {
        fprintf(stderr, "boresight: help takes one command (found also \"%.80s\")\n", argv[3]);
        return BST_EXIT_USAGE;
    }
    char option[] = "--help";
    char *words[] = {argv[2], option, NULL};
    return bst_cli_run_with_stack(found->run, 2, words);
}

int bst_app_run(int argc, char **argv, const bst_app_command *more) {
    if (argc < 2) {
        usage(stderr, more);
        return BST_EXIT_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0) {
        usage(stdout, more);
        return BST_EXIT_OK;
    }
    if (strcmp(argv[1], "help") == 0) {
        return help(argc, argv, more);
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("boresight %s (%s)\n", bst_version(), bst_version_git_revision());
        return BST_EXIT_OK;
    }
    bst_ctx ctx = {0};
    int first = 1;
    if (bst_plugin_options_take(&ctx, argc, argv, &first) != BST_OK) {
        fprintf(stderr, "boresight: %s\n", ctx.message);
        return BST_EXIT_USAGE;
    }
    if (first == argc) {
        usage(stderr, more);
        return BST_EXIT_USAGE;
    }
    const bst_app_command *found = find_command(argv[first], more);
    return found ? bst_cli_run_with_stack(found->run, argc - first, argv + first)
                 : unknown_command(argv[first], more);
}
