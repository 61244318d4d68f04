/* boresight stars fetch | import | info */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/app/app.h"
#include "sim/catalogue/star_install.h"
#include "sim/catalogue/star_summary.h"
#include "sim/cli/catalogue_progress.h"
#include "sim/cli/command_line.h"
#include "sim/cli/stars_import.h"

static const char HELP[] =
    "boresight stars: the star catalogue (Tycho-2, or your own)\n"
    "\n"
    "  boresight stars fetch\n"
    "      Download Tycho-2 (2,557,501 stars; 121 MB) from Debian's source package `tycho2`, "
    "verify\n"
    "      and import it into your data folder. Uses your system's own apt sources in a private\n"
    "      configuration: changes nothing of the system, needs no root. Does nothing when the\n"
    "      catalogue is there already.\n"
    "  boresight stars import FILE [options]\n"
    "      Make a catalogue of your own table (Gaia, VizieR, CSV or FITS), with Tycho-2's stars, "
    "or\n"
    "      of a tycho2_2.orig.tar.xz that you have; see `boresight stars import --help`.\n"
    "  boresight stars info [CATALOGUE] [ID]\n"
    "      Where the catalogue is, its stars per magnitude, how far it is complete, its licence; "
    "or\n"
    "      the star with the identity ID of a run's tables.\n"
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

static const char import_help[] =
    "usage: boresight stars import FILE [options]\n"
    "\n"
    "Makes a star catalogue of a table of stars, or of Tycho-2 (the file tycho2_2.orig.tar.xz).\n"
    "A table is VOTable, CSV, ECSV or FITS, gzipped or not, as Gaia's archive and VizieR have it:\n"
    "ra, dec (degrees, ICRS), ref_epoch, pmra, pmdec (mas/yr), phot_g_mean_mag, bp_rp, source_id;\n"
    "or v_mag, b_minus_v; or electrons_per_s; also parallax (mas), and for variable stars "
    "period_d,\n"
    "amplitude_mag and maximum_jd. Stars that the base has too are united.\n"
    "\n"
    "  boresight stars import gaia.csv --complete-to 16 --cone 83.8,-5.4,2 --out orion.stars\n"
    "\n"
    "A scenario uses it by /world/star_catalogue: \"orion.stars\".\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage.\n"
    "\n"
    "options:\n";

static int import(int argc, char **argv) {
    bst_stars_import_request q = bst_stars_import_defaults();
    bst_option options[BST_OPTIONS_MAX];
    bst_options_bind(bst_stars_import_options, &q, options);
    bst_ctx ctx;
    char name[] = "stars";
    bst_ctx_init(&ctx, bst_cli_log_as, name, BST_LOG_WARNING);
    const bst_command_line line = {"stars", import_help, options, &q.help};
    int arguments = 0, code = BST_EXIT_OK;
    if (!bst_command_line_read(&ctx, &line, argc, argv, &arguments, &code)) {
        return code;
    }
    if (arguments != 1) {
        return bst_command_line_misuse("stars",
                                       "import takes one file: a table of stars, or a "
                                       "tycho2_2.orig.tar.xz",
                                       NULL);
    }
    bst_status status = bst_stars_import(&ctx, &q, argv[1]);
    return status == BST_ERR_ARGUMENT ? bst_command_line_misuse("stars", ctx.message, NULL)
                                      : bst_command_line_end_as("stars", &ctx, status);
}

static int info(int argc, char **argv) {
    if (argc > 3) {
        return bst_command_line_misuse("stars", "info takes a catalogue and an identity, got also",
                                       argv[3]);
    }
    if (argc > 1 && argv[1][0] == '-') {
        return bst_command_line_misuse("stars", "unknown option", argv[1]);
    }
    char *end = NULL;
    unsigned long long id = argc == 3 ? strtoull(argv[2], &end, 10) : 0;
    if (argc == 3 && (*end != '\0' || argv[2][0] == '-' || id == 0 || id > UINT32_MAX)) {
        return bst_command_line_misuse("stars", "no identity of a star:", argv[2]);
    }
    bst_ctx ctx;
    char name[] = "stars";
    bst_ctx_init(&ctx, bst_cli_log_as, name, BST_LOG_WARNING);
    bst_stars *stars = NULL;
    bst_status status = bst_stars_open(&ctx, argc > 1 ? argv[1] : "default", &stars);
    if (status == BST_OK) {
        status = id ? bst_stars_print_star(&ctx, stars, (uint32_t)id, stdout)
                    : bst_stars_print_summary(&ctx, stars, stdout);
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
    for (int i = 1; i < argc && strcmp(argv[1], "import") != 0; i++) {
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
