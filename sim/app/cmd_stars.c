/* boresight stars fetch | import | info */
#include <stdio.h>
#include <string.h>

#include "sim/app/app.h"
#include "sim/catalogue/star_install.h"
#include "sim/catalogue/star_summary.h"
#include "sim/cli/catalogue_progress.h"
#include "sim/cli/command_line.h"
#include "sim/cli/outputs.h"

static const char HELP[] =
    "boresight stars: the star catalogue (Tycho-2)\n"
    "\n"
    "  boresight stars fetch\n"
    "      Download Tycho-2 (2,557,501 stars; 121 MB) from Debian's source package `tycho2`, "
    "verify\n"
    "      and import it into your data folder. Uses your system's own apt sources in a private\n"
    "      configuration: changes nothing of the system, needs no root. Does nothing when the\n"
    "      catalogue is there already.\n"
    "  boresight stars import TARBALL [--out FILE] [--subset FILE]\n"
    "      Import a tycho2_2.orig.tar.xz that you have. --out: write there instead of your data\n"
    "      folder. --subset: keep only what FILE names, in lines `sky V` (once) and\n"
    "      `cone RA DEC RADIUS V` (degrees, ICRS).\n"
    "  boresight stars info [CATALOGUE]\n"
    "      Where the catalogue is, its stars per magnitude, how far it is complete, its licence.\n"
    "      CATALOGUE: a file, `embedded` (the stars in the program), or `default` (your full\n"
    "      catalogue when it is there, else the embedded stars), which is what is left out.\n"
    "\n"
    "Example:\n"
    "  boresight stars fetch && boresight stars info\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n";

static int fetch(int argc, char **argv) {
    if (argc > 1) {
        return bst_command_line_misuse("stars", "fetch takes no argument, got", argv[1]);
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_WARNING);
    char path[512];
    bool already = false;
    bst_catalogue_progress line = bst_catalogue_progress_start();
    bst_status status = bst_star_install_fetched(&ctx, bst_catalogue_progress_show, &line, path,
                                                 sizeof path, &already);
    bst_catalogue_progress_end(&line);
    if (status == BST_OK) {
        printf("%s: Tycho-2, %lld stars%s\n", path, BST_STAR_TYCHO2_COUNT,
               already ? " (there already)" : "");
    }
    return bst_command_line_end_as("stars", &ctx, status);
}

static int import(int argc, char **argv) {
    char *tarball = NULL;
    const char *out = NULL, *subset = NULL;
    for (int i = 1; i < argc; i++) {
        const char **value = strcmp(argv[i], "--out") == 0      ? &out
                             : strcmp(argv[i], "--subset") == 0 ? &subset
                                                                : NULL;
        if (value) {
            if (i + 1 == argc) {
                return bst_command_line_misuse("stars", "no file after", argv[i]);
            }
            *value = argv[++i];
        } else if (argv[i][0] == '-') {
            return bst_command_line_misuse("stars", "unknown option", argv[i]);
        } else if (tarball) {
            return bst_command_line_misuse("stars", "import takes one file, got also", argv[i]);
        } else {
            tarball = argv[i];
        }
    }
    if (!tarball) {
        return bst_command_line_misuse("stars", "import needs the path of a tycho2_2.orig.tar.xz",
                                       NULL);
    }
    const bst_option table[] = {
        {.name = "out", .kind = BST_OPTION_TEXT, .target = &out, .path = BST_PATH_OUTPUT},
        {.name = "subset", .kind = BST_OPTION_TEXT, .target = &subset, .path = BST_PATH_INPUT},
        {.name = NULL},
    };
    const bool given[] = {out != NULL, subset != NULL};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_WARNING);
    if (bst_outputs_check(&ctx, table, given, 1, &tarball) != BST_OK) {
        return bst_command_line_misuse("stars", ctx.message, NULL);
    }
    if (subset && !out) {
        return bst_command_line_misuse(
            "stars", "--subset needs --out: a part must not stand in for the whole", NULL);
    }
    bst_catalogue_progress line = bst_catalogue_progress_start();
    bst_star_install_request request = {tarball, subset, out, bst_catalogue_progress_show, &line};
    char path[512];
    long long stars = 0;
    bst_status status = bst_star_install(&ctx, &request, path, sizeof path, &stars);
    bst_catalogue_progress_end(&line);
    if (status == BST_OK) {
        printf("%s: Tycho-2, %lld stars\n", out ? out : path, stars);
    }
    return bst_command_line_end_as("stars", &ctx, status);
}

static int info(int argc, char **argv) {
    if (argc > 2) {
        return bst_command_line_misuse("stars", "info takes one catalogue, got also", argv[2]);
    }
    if (argc == 2 && argv[1][0] == '-') {
        return bst_command_line_misuse("stars", "unknown option", argv[1]);
    }
    bst_ctx ctx;
    char name[] = "stars";
    bst_ctx_init(&ctx, bst_cli_log_as, name, BST_LOG_WARNING);
    bst_stars *stars = NULL;
    bst_status status = bst_stars_open(&ctx, argc == 2 ? argv[1] : "default", &stars);
    if (status == BST_OK) {
        status = bst_stars_print_summary(&ctx, stars, stdout);
    }
    bst_stars_close(stars);
    return bst_command_line_end_as("stars", &ctx, status);
}

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} parts[] = {{"fetch", fetch}, {"import", import}, {"info", info}};

int bst_cmd_stars(int argc, char **argv) {
    if (argc < 2) {
        fputs(HELP, stderr);
        return BST_EXIT_USAGE;
    }
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            fputs(HELP, stdout);
            return BST_EXIT_OK;
        }
    }
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        if (strcmp(argv[1], parts[i].name) == 0) {
            return parts[i].run(argc - 1, argv + 1);
        }
    }
    return bst_command_line_misuse("stars", "unknown command", argv[1]);
}
