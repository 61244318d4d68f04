#include "sim/cli/stars_import.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "sim/catalogue/star_install.h"
#include "sim/catalogue/star_merge.h"
#include "sim/cli/catalogue_progress.h"
#include "sim/core/file.h"

#define OFFSET(field) offsetof(bst_stars_import_request, field)

const bst_option bst_stars_import_options[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = OFFSET(out),
     .argument = "FILE",
     .doc = "catalogue to write (a table: required; Tycho-2: default your data folder)",
     .path = BST_PATH_OUTPUT},
    {.name = "subset",
     .kind = BST_OPTION_TEXT,
     .offset = OFFSET(subset),
     .argument = "FILE",
     .doc =
         "Tycho-2: keep only what FILE names, in lines `sky V` (once) and `cone RA DEC RADIUS V` "
         "(degrees, ICRS)",
     .needs = "out",
     .path = BST_PATH_INPUT},
    {.name = "base",
     .kind = BST_OPTION_TEXT,
     .offset = OFFSET(base),
     .argument = "CATALOGUE",
     .doc = "table: catalogue whose stars are kept besides: a file, `embedded`, `default` "
            "(default), or `none`"},
    {.name = "epoch",
     .kind = BST_OPTION_REAL,
     .offset = OFFSET(epoch_year),
     .argument = "YEAR",
     .doc = "table: Julian year of the positions, if it has no column of it (Gaia DR3: 2016)",
     .minimum = 1800,
     .maximum = 2200},
    {.name = "zero-point",
     .kind = BST_OPTION_REAL,
     .offset = OFFSET(zero_point_mag),
     .argument = "MAG",
     .doc = "table with a column electrons_per_s: V of a star of 1 electron/s",
     .minimum = 0,
     .maximum = 40},
    {.name = "light-curves",
     .kind = BST_OPTION_TEXT,
     .offset = OFFSET(curves),
     .argument = "FILE",
     .doc =
         "table: light curves of its variable stars, CSV with source_id, delta_mag, and phase or "
         "time_jd",
     .path = BST_PATH_INPUT},
    {.name = "complete-to",
     .kind = BST_OPTION_REAL,
     .offset = OFFSET(complete_to_v_mag),
     .argument = "V",
     .doc = "table: it has all stars to this V; fainter ones are added by statistics where a "
            "scenario asks for them",
     .minimum = 0,
     .maximum = 30},
    {.name = "cone",
     .kind = BST_OPTION_TEXT,
     .offset = OFFSET(cone),
     .argument = "RA,DEC,RADIUS",
     .doc = "table: complete in this cone only (degrees, ICRS; default: over the whole sky)",
     .needs = "complete-to"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = OFFSET(help), .doc = "show this help"},
    {.name = NULL},
};

bst_stars_import_request bst_stars_import_defaults(void) {
    return (bst_stars_import_request){
        .epoch_year = NAN, .zero_point_mag = NAN, .complete_to_v_mag = NAN};
}

/* Checks whether a file begins as Debian's archive of Tycho-2 does (xz). */
static bst_status is_archive(bst_ctx *ctx, const char *path, bool *yes) {
    static const unsigned char magic[6] = {0xFD, '7', 'z', 'X', 'Z', 0};
    unsigned char head[6] = {0};
    int fd;
    uint64_t bytes;
    BST_TRY(bst_file_open(ctx, path, UINT64_C(1) << 40,
                          "a table of stars, or Debian's tycho2_2.orig.tar.xz", &fd, &bytes));
    *yes = read(fd, head, sizeof head) == (ssize_t)sizeof head &&
           memcmp(head, magic, sizeof magic) == 0;
    close(fd);
    return BST_OK;
}

static bst_status import_archive(bst_ctx *ctx, const bst_stars_import_request *q,
                                 const char *file) {
    if (q->base || q->cone || !isnan(q->epoch_year) || !isnan(q->zero_point_mag) ||
        !isnan(q->complete_to_v_mag) || q->curves) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s is no table of stars: --base, --epoch, --zero-point, --light-curves, "
                        "--complete-to and --cone have no effect",
                        file);
    }
    bst_catalogue_progress line = bst_catalogue_progress_start();
    bst_star_install_request request = {file, q->subset, q->out, bst_catalogue_progress_show,
                                        &line};
    char path[512];
    long long stars = 0;
    bst_status status = bst_star_install(ctx, &request, path, sizeof path, &stars);
    bst_catalogue_progress_end(&line);
    if (status == BST_OK) {
        printf("%s: Tycho-2, %lld stars\n", q->out ? q->out : path, stars);
    }
    return status;
}

static bst_status read_cone(bst_ctx *ctx, const char *text, bst_star_patch *out) {
    int length = 0;
    if (sscanf(text, "%lf,%lf,%lf%n", &out->ra_deg, &out->dec_deg, &out->radius_deg, &length) ==
            3 &&
        text[length] == '\0' && out->ra_deg >= 0.0 && out->ra_deg < 360.0 &&
        fabs(out->dec_deg) <= 90.0 && out->radius_deg > 0.0 && out->radius_deg <= 180.0) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "--cone %s: give RA,DEC,RADIUS in degrees (RA 0 to 360, Dec -90 to 90, radius "
                    "0 to 180)",
                    text);
}

static bst_status import_table(bst_ctx *ctx, const bst_stars_import_request *q, const char *file) {
    bst_star_merge_request request = {
        .table = file,
        .options = {.epoch_year = q->epoch_year, .zero_point_mag = q->zero_point_mag},
        .base = !q->base                       ? "default"
                : strcmp(q->base, "none") == 0 ? NULL
                                               : q->base,
        .curves = q->curves,
        .complete_to_v_mag = q->complete_to_v_mag,
        .has_cone = q->cone != NULL,
        .out = q->out,
        .progress = bst_catalogue_progress_show};
    if (!q->out) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a table needs --out FILE: the catalogue that a scenario names in "
                        "/world/star_catalogue");
    }
    if (q->subset) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--subset is for Tycho-2's archive, and %s is none",
                        file);
    }
    if (q->cone) {
        BST_TRY(read_cone(ctx, q->cone, &request.cone));
    }
    bst_catalogue_progress line = bst_catalogue_progress_start();
    request.progress_user = &line;
    bst_star_merge_counts n;
    bst_status status = bst_star_merge(ctx, &request, &n);
    bst_catalogue_progress_end(&line);
    if (status == BST_OK) {
        printf("%s: %lld stars: %lld of the base, of which the table has %lld, and %lld more\n",
               q->out, (long long)n.written, (long long)n.base, (long long)n.same,
               (long long)(n.written - n.base));
        if (n.parallaxes > 0 || n.variables > 0) {
            printf("%lld have a parallax, %lld are variable\n", (long long)n.parallaxes,
                   (long long)n.variables);
        }
        if (n.curves_left > 0) {
            printf("%lld stars with a light curve are not in the table\n",
                   (long long)n.curves_left);
        }
        if (n.at_rest > 0) {
            printf("%lld rows have no proper motion: their stars stay where they were\n",
                   (long long)n.at_rest);
        }
        if (n.skipped > 0) {
            printf("%lld of %lld rows have no position or no magnitude and were left out\n",
                   (long long)n.skipped, (long long)n.rows);
        }
    }
    return status;
}

bst_status bst_stars_import(bst_ctx *ctx, const bst_stars_import_request *q, const char *file) {
    bool archive = false;
    if (q->subset) { /* wrong ones are refused before the archive is looked for */
        bst_star_subset ignored;
        BST_TRY(bst_star_subset_read(ctx, q->subset, &ignored));
    }
    BST_TRY(is_archive(ctx, file, &archive));
    return archive ? import_archive(ctx, q, file) : import_table(ctx, q, file);
}
