#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "sim/app/app.h"
#include "sim/app/plugins.h"
#include "sim/core/version.h"

typedef struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *doc;
} command;

static const command commands[] = {
    {"run", bst_cmd_run, "run a scenario"},
    {"info", bst_cmd_info, "what the folder of a run holds"},
    {"report", bst_cmd_report, "a page of HTML about a run or a study"},
    {"export", bst_cmd_export, "frames, tables, orbits and observations of a run for others"},
    {"orbit", bst_cmd_orbit, "an orbit from the directions that a run measured"},
    {"check", bst_cmd_check, "validate a scenario and print it with every default written out"},
    {"loop", bst_cmd_loop, "margins and predicted pointing of a scenario's control loops"},
    {"schema", bst_cmd_schema, "print the JSON Schema of scenarios"},
    {"serve", bst_cmd_serve, "play a module of a scenario over the link"},
    {"icd", bst_cmd_icd, "print the interface control document of the link"},
    {"stars", bst_cmd_stars, "get, import or describe the star catalogue"},
    {"propagate", bst_cmd_propagate, "positions and velocities from two-line element sets"},
    {"calframes", bst_cmd_calframes, "bias, dark and flat frames of a scenario's sensors"},
    {"calibrate-obsgen", bst_cmd_calibrate_obsgen,
     "fit the observation generator to the image path, or compare them"},
    {"bench", bst_cmd_bench, "measure speed and error"},
    {"study", bst_cmd_study, "many runs of varied scenarios, as tables"},
    {"pd", bst_cmd_pd, "measure detection, false alarms and location against theory"},
};

void bst_app_log(void *user, bst_log_level level, const char *message) {
    (void)user;
    static const char *const names[] = {"error", "warning", "info", "debug"};
    if (level == BST_LOG_INFO) {
        fprintf(stderr, "boresight: %s\n", message);
    } else {
        fprintf(stderr, "boresight: %s: %s\n", names[level], message);
    }
}

static void usage(FILE *stream) {
    fprintf(stream,
            "Boresight simulates a space-based telescope that finds and tracks satellites.\n"
            "\n"
            "usage: boresight [--plugin FILE]... COMMAND [options]\n"
            "\n"
            "commands:\n");
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        fprintf(stream, "  %-16s %s\n", commands[i].name, commands[i].doc);
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
        "\"boresight COMMAND --help\" tells more. Exit codes: 0 done, 1 failed, 2 called wrongly,\n"
        "130 interrupted.\n");
}

int main(int argc, char **argv) {
    signal(SIGXFSZ, SIG_IGN); /* a limit on the size of files is an error of a write */
    if (argc < 2) {
        usage(stderr);
        return BST_EXIT_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 ||
        strcmp(argv[1], "help") == 0) {
        usage(stdout);
        return BST_EXIT_OK;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("boresight %s (%s)\n", bst_version(), bst_git_revision());
        return BST_EXIT_OK;
    }
    while (strcmp(argv[1], "--plugin") == 0) {
        bst_ctx ctx = {0};
        if (argc < 4) {
            fprintf(stderr,
                    "boresight: --plugin takes the path of a shared library, and a command "
                    "after it; see boresight --help\n");
            return BST_EXIT_USAGE;
        }
        if (bst_plugins_add(&ctx, argv[2]) != BST_OK) {
            fprintf(stderr, "boresight: %s\n", ctx.message);
            return BST_EXIT_USAGE;
        }
        argc -= 2;
        argv += 2;
    }
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        if (strcmp(argv[1], commands[i].name) == 0) {
            return commands[i].run(argc - 1, argv + 1);
        }
    }
    fprintf(stderr, "boresight: there is no command \"%s\"; see boresight --help\n", argv[1]);
    return BST_EXIT_USAGE;
}
