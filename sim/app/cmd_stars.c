/* boresight stars fetch | import | info */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "sim/app/app.h"
#include "sim/catalogue/star_fetch.h"
#include "sim/catalogue/star_import.h"
#include "sim/catalogue/stars.h"
#include "sim/cli/outputs.h"
#include "sim/core/folder.h"
#include "sim/core/wall_clock.h"

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

enum { EXIT_OK = 0, EXIT_FAILED = 1, EXIT_USAGE = 2 };

static int usage_error(const char *what, const char *argument) {
    fprintf(stderr, "boresight stars: %s%s%s; see boresight stars --help\n", what,
            argument ? " " : "", argument ? argument : "");
    return EXIT_USAGE;
}

static int failed(const bst_ctx *ctx) {
    fprintf(stderr, "boresight stars: %s\n", ctx->message);
    return EXIT_FAILED;
}

typedef struct progress_line {
    const char *what; /* the stage on show; NULL before the first */
    double started_s, shown_s;
    int on_terminal;
} progress_line;

/* One line on the terminal, rewritten up to five times a second: stage, share, rate, time left. */
static void show_progress(void *user, const char *what, long long done, long long total) {
    progress_line *line = user;
    double now = bst_wall_seconds();
    if (!line->on_terminal) {
        return;
    }
    if (!line->what || strcmp(line->what, what) != 0) {
        if (line->what) {
            fputc('\n', stderr);
        }
        line->what = what;
        line->started_s = now;
        line->shown_s = 0.0;
    }
    if (now - line->shown_s < 0.2 && done != total) {
        return;
    }
    line->shown_s = now;
    double elapsed = now - line->started_s;
    if (total <= 0 || done <= 0 || elapsed <= 0.0) {
        fprintf(stderr, "\r\033[K%s: %.0f s", what, elapsed);
        return;
    }
    double rate = (double)done / elapsed;
    const char *unit = strcmp(what, "downloading") == 0 ? "MB/s" : "million stars/s";
    fprintf(stderr, "\r\033[K%s: %3.0f %%, %.1f %s, %.0f s left", what,
            100.0 * (double)done / (double)total, 1e-6 * rate, unit, (double)(total - done) / rate);
}

static progress_line progress_begin(void) {
    return (progress_line){NULL, 0.0, 0.0, isatty(STDERR_FILENO)};
}

static void progress_end(const progress_line *line) {
    if (line->what) {
        fputc('\n', stderr);
    }
}

static int fetch(int argc, char **argv) {
    if (argc > 1) {
        return usage_error("fetch takes no argument, got", argv[1]);
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_WARNING);
    char path[512];
    bool already = false;
    progress_line line = progress_begin();
    bst_status status = bst_stars_default_path(&ctx, path, sizeof path);
    if (status == BST_OK) {
        status = bst_star_fetch(&ctx, path, show_progress, &line, &already);
    }
    progress_end(&line);
    if (status != BST_OK) {
        return failed(&ctx);
    }
    printf("%s: Tycho-2, %lld stars%s\n", path, BST_STAR_TYCHO2_COUNT,
           already ? " (there already)" : "");
    return EXIT_OK;
}

static int import(int argc, char **argv) {
    const char *tarball = NULL, *out = NULL, *subset = NULL;
    for (int i = 1; i < argc; i++) {
        const char **value = strcmp(argv[i], "--out") == 0      ? &out
                             : strcmp(argv[i], "--subset") == 0 ? &subset
                                                                : NULL;
        if (value) {
            if (i + 1 == argc) {
                return usage_error("no file after", argv[i]);
            }
            *value = argv[++i];
        } else if (argv[i][0] == '-') {
            return usage_error("unknown option", argv[i]);
        } else if (tarball) {
            return usage_error("import takes one file, got also", argv[i]);
        } else {
            tarball = argv[i];
        }
    }
    if (!tarball) {
        return usage_error("import needs the path of a tycho2_2.orig.tar.xz", NULL);
    }
    const bst_option table[] = {
        {.name = "out", .kind = BST_OPTION_TEXT, .target = &out, .path = BST_PATH_OUTPUT},
        {.name = "subset", .kind = BST_OPTION_TEXT, .target = &subset, .path = BST_PATH_INPUT},
        {.name = NULL},
    };
    const bool given[] = {out != NULL, subset != NULL};
    char tarball_word[4096];
    char *const words[] = {tarball_word};
    bst_ctx outputs = {0};
    snprintf(tarball_word, sizeof tarball_word, "%s", tarball);
    if (bst_outputs_check(&outputs, table, given, 1, words) != BST_OK) {
        return usage_error(outputs.message, NULL);
    }
    if (subset && !out) {
        return usage_error("--subset needs --out: a part must not stand in for the whole", NULL);
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_WARNING);
    bst_star_import_options options = bst_star_import_all();
    progress_line line = progress_begin();
    options.progress = show_progress;
    options.progress_user = &line;
    char path[512];
    bst_status status = BST_OK;
    if (subset) {
        status = bst_star_subset_read(&ctx, subset, &options.subset);
    }
    if (status == BST_OK && !out) {
        status = bst_stars_default_path(&ctx, path, sizeof path);
        out = path;
        if (status == BST_OK) {
            char folder[512];
            snprintf(folder, sizeof folder, "%.*s", (int)(strrchr(path, '/') - path), path);
            status = bst_folder_make(&ctx, folder);
        }
    }
    long long stars = 0;
    if (status == BST_OK) {
        status = bst_star_import_tarball(&ctx, tarball, &options, out, &stars);
    }
    progress_end(&line);
    if (status != BST_OK) {
        return failed(&ctx);
    }
    printf("%s: Tycho-2, %lld stars\n", out, stars);
    return EXIT_OK;
}

static void print_log(void *user, bst_log_level level, const char *message) {
    (void)user;
    (void)level;
    fprintf(stderr, "boresight stars: %s\n", message);
}

static int info(int argc, char **argv) {
    if (argc > 2) {
        return usage_error("info takes one catalogue, got also", argv[2]);
    }
    if (argc == 2 && argv[1][0] == '-') {
        return usage_error("unknown option", argv[1]);
    }
    bst_ctx ctx;
    bst_ctx_init(&ctx, print_log, NULL, BST_LOG_WARNING);
    bst_stars *stars = NULL;
    if (bst_stars_open(&ctx, argc == 2 ? argv[1] : "default", &stars) != BST_OK) {
        return failed(&ctx);
    }
    bst_stars_info i;
    bst_stars_get_info(stars, &i);
    printf("source    %s\n", i.source);
    printf("path      %s\n", i.embedded ? "(in the program)" : i.path);
    printf("stars     %lld\n", i.count);
    printf("complete  to V %.1f over the whole sky%s\n", i.complete_to_v_mag,
           i.complete_to_v_mag == BST_STAR_TYCHO2_COMPLETE_V ? " (98 % of the stars there)" : "");
    for (int p = 0; p < i.patches; p++) {
        bst_vec3 centre;
        double radius, v, ra, dec;
        bst_stars_patch(stars, p, &centre, &radius, &v);
        bst_vec3_to_radec(centre, &ra, &dec);
        printf("          all of Tycho-2 to V %.1f within %.1f deg of RA %.4f Dec %+.4f deg\n", v,
               radius / BST_DEG_RAD, ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    }
    printf("counts    V <=       stars\n");
    int status = EXIT_OK;
    for (int v = 0, count = 0; v <= 15 && count < i.count; v++) {
        if (bst_stars_query(&ctx, stars, (bst_vec3){0.0, 0.0, 1.0}, BST_PI, (double)v,
                            BST_STAR_EPOCH_YEAR, NULL, 0, &count) != BST_OK) {
            status = failed(&ctx);
            break;
        }
        printf("          %4d  %10d\n", v, count);
    }
    printf(
        "licence   Tycho-2 (Hog et al. 2000): BSD-2-Clause, as Debian's package tycho2 states\n");
    bst_stars_close(stars);
    return status;
}

int bst_cmd_stars(int argc, char **argv) {
    if (argc < 2) {
        fputs(HELP, stderr);
        return EXIT_USAGE;
    }
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            fputs(HELP, stdout);
            return EXIT_OK;
        }
    }
    if (strcmp(argv[1], "fetch") == 0) {
        return fetch(argc - 1, argv + 1);
    }
    if (strcmp(argv[1], "import") == 0) {
        return import(argc - 1, argv + 1);
    }
    if (strcmp(argv[1], "info") == 0) {
        return info(argc - 1, argv + 1);
    }
    return usage_error("unknown command", argv[1]);
}
