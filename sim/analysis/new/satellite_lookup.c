#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/analysis/new/satellite_lookup.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/cli/shipped.h"
#include "sim/core/text.h"

static const char *const shipped_sets[] = {"scenarios/catalogue_2022-06.tle",
                                           "scenarios/objects_2022-06.tle"};
enum { SHIPPED_SETS = (int)(sizeof shipped_sets / sizeof *shipped_sets) };

static bool same_name(const char *a, const char *b) {
    while (*a && tolower((unsigned char)*a) == tolower((unsigned char)*b)) {
        a++;
        b++;
    }
    return *a == '\0' && *b == '\0';
}

static bst_status take(bst_ctx *ctx, const char *option, const char *file,
                       const bst_elements *elements, bst_new_satellite *out) {
    out->elements = *elements;
    if (!realpath(file, out->file)) {
        return bst_fail(ctx, BST_ERR_IO, "--%s: %.300s: %s", option, file, strerror(errno));
    }
    if (*elements->name) {
        snprintf(out->name, sizeof out->name, "%s", elements->name);
    } else {
        snprintf(out->name, sizeof out->name, "NORAD %d", elements->norad);
    }
    bst_status status = bst_tle_format(ctx, elements, out->line1, out->line2);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "--%s %.300s", option, file);
}

/* State of the search through the shipped element sets. */
typedef struct wanted {
    const char *option, *which;
    bool found;
    char near[32]; /* nearest other name; "": none */
    size_t best;
} wanted;

/* Looks for a catalogue number or name in a file. */
static bst_status seek(bst_ctx *ctx, const char *file, wanted *w, bst_new_satellite *out) {
    bst_elements *sets = NULL;
    int count = 0, norad = 0;
    bool number = bst_tle_decode_number(w->which, &norad);
    BST_TRY(bst_elements_load(ctx, file, &(bst_elements_options){.skip_bad_sets = true}, &sets,
                              &count));
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        bool named = same_name(sets[i].name, w->which);
        if (named && w->found && out->elements.norad != sets[i].norad) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT,
                              "--%s %.100s: several satellites are called so (%d and %d, ...); "
                              "give the catalogue number",
                              w->option, w->which, out->elements.norad, sets[i].norad);
        } else if (!w->found && (named || (number && sets[i].norad == norad))) {
            w->found = true;
            status = take(ctx, w->option, file, &sets[i], out);
        } else if (bst_text_is_nearer(w->which, sets[i].name, &w->best)) {
            memcpy(w->near, sets[i].name, sizeof w->near);
        }
    }
    free(sets);
    return status;
}

/* Reads the latest set of a satellite; norad 0: the only satellite of the file. */
static bst_status from_file(bst_ctx *ctx, const char *option, const char *file, int norad,
                            bst_new_satellite *out) {
    bst_elements *sets = NULL;
    int count = 0;
    const bst_elements_options only = {.norad = norad};
    bst_status status = bst_elements_load(ctx, file, &only, &sets, &count);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "--%s", option);
    }
    for (int i = 1; i < count && status == BST_OK; i++) {
        if (sets[i].norad != sets[0].norad) {
            status = bst_fail(ctx, BST_ERR_ARGUMENT,
                              "--%s %.300s: the file holds more than one satellite; say which: "
                              "%.300s:%d",
                              option, file, file, sets[0].norad);
        }
    }
    if (status == BST_OK) {
        int latest = 0;
        for (int i = 1; i < count; i++) {
            double days = sets[i].epoch_utc_jd1 - sets[latest].epoch_utc_jd1 +
                          sets[i].epoch_utc_jd2 - sets[latest].epoch_utc_jd2;
            latest = days > 0.0 ? i : latest;
        }
        status = take(ctx, option, file, &sets[latest], out);
    }
    free(sets);
    return status;
}

bst_status bst_new_satellite_find(bst_ctx *ctx, const char *option, const char *which,
                                  bst_new_satellite *out) {
    char file[4096];
    wanted w = {.option = option, .which = which, .best = SIZE_MAX};
    int norad = 0;
    const char *colon = strrchr(which, ':');
    if (access(which, F_OK) == 0) {
        return from_file(ctx, option, which, 0, out);
    }
    if (colon && (size_t)(colon - which) < sizeof file) {
        snprintf(file, sizeof file, "%.*s", (int)(colon - which), which);
        size_t digits = strspn(colon + 1, "0123456789");
        bool number = digits > 0 && digits <= 9 && !colon[1 + digits];
        norad = number ? (int)strtol(colon + 1, NULL, 10) : 0;
        if (norad > 0 || bst_tle_decode_number(colon + 1, &norad)) {
            return from_file(ctx, option, file, norad, out);
        }
        if (access(file, F_OK) == 0) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--%s %.200s: \"%.40s\" is no catalogue number (allowed: FILE:NUMBER, "
                            "1 to 999999999 or Alpha-5)",
                            option, which, colon + 1);
        }
    }
    for (int i = 0; i < SHIPPED_SETS; i++) {
        bst_cli_shipped_file(shipped_sets[i], file, sizeof file);
        BST_TRY(seek(ctx, file, &w, out));
    }
    return w.found ? BST_OK
                   : bst_fail(ctx, BST_ERR_NOT_FOUND,
                              "--%s %.200s: there is no such file, and no such catalogue number or "
                              "name in the element sets that come with Boresight (%s, %s)%s%s%s",
                              option, which, shipped_sets[0], shipped_sets[1],
                              *w.near ? "; did you mean \"" : "", w.near, *w.near ? "\"?" : "");
}
