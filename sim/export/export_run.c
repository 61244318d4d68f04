/* Executes all requested exports of a run, one after the other. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/core/folder.h"
#include "sim/export/export.h"

bool bst_export_into_folder(const bst_export_parts *r) {
    return r->frames != BST_EXPORT_NOT || r->table != BST_EXPORT_NOT ||
           r->orbits != BST_EXPORT_NOT || r->observations != BST_EXPORT_NOT;
}

/* Creates the output folder: RUN.export beside the run by default. */
static bst_status make_folder(bst_ctx *ctx, const char *given, const bst_run_reader *run, char *out,
                              size_t bytes) {
    const char *folder = bst_run_reader_folder(run);
    int n = given ? snprintf(out, bytes, "%s", given) : snprintf(out, bytes, "%s.export", folder);
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", given ? given : folder);
    }
    BST_TRY(bst_folder_make(ctx, out));
    struct stat info, source;
    if (stat(out, &info) == 0 && stat(folder, &source) == 0 && source.st_ino == info.st_ino &&
        source.st_dev == info.st_dev) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: is the run itself, which is not changed; choose another --out", out);
    }
    return BST_OK;
}

/* Folder of --satnet, --coco or --yolo; a relative path is inside --out. */
static bst_status make_set_folder(bst_ctx *ctx, const char *given, const char *base,
                                  const bst_run_reader *run, char *out, size_t bytes) {
    char path[4096];
    if (!base || given[0] == '/') {
        return make_folder(ctx, given, run, out, bytes);
    }
    BST_TRY(make_folder(ctx, base, run, out, bytes));
    if ((size_t)snprintf(path, sizeof path, "%s/%s", base, given) >= sizeof path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", given);
    }
    return make_folder(ctx, path, run, out, bytes);
}

/* Checks that the run has the requested frames; a run without tables is not checked. */
static bst_status check_frames(bst_ctx *ctx, const bst_export *e, bool asked) {
    char sql[200];
    snprintf(sql, sizeof sql,
             "SELECT count(*) FROM exposures WHERE exposure_id BETWEEN %lld AND %lld"
             " AND (exposure_id - %lld) %% %lld = 0",
             (long long)e->first, (long long)e->last, (long long)e->first, (long long)e->every);
    bool some = !asked || (e->first == 0 && e->every == 1) || !bst_run_reader_has_tables(e->run) ||
                bst_run_reader_int(e->run, sql, 0, 1) != 0;
    return some ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND,
                           "%s: none of its frames is among those asked for by --first, --last and "
                           "--every (it has %lld to %lld)",
                           bst_run_reader_folder(e->run),
                           (long long)bst_run_reader_int(
                               e->run, "SELECT min(exposure_id) FROM exposures", 0, 0),
                           (long long)bst_run_reader_int(
                               e->run, "SELECT max(exposure_id) FROM exposures", 0, 0));
}

/* Resolves the folders of --satnet, --coco and --yolo. */
static bst_status make_set_folders(bst_ctx *ctx, bst_export_parts *r, char sets[3][4096]) {
    const char **const of_sets[] = {&r->e.satnet, &r->e.coco, &r->e.yolo};
    for (int k = 0; k < 3; k++) {
        if (*of_sets[k]) {
            BST_TRY(make_set_folder(ctx, *of_sets[k], r->out, r->e.run, sets[k], sizeof sets[k]));
            *of_sets[k] = sets[k];
            for (size_t n = strlen(sets[k]); n > 1 && sets[k][n - 1] == '/';) {
                sets[k][--n] = '\0';
            }
        }
    }
    return BST_OK;
}

/* Executes all requested exports of an open run. */
bst_status bst_export_run(bst_ctx *ctx, bst_export_parts *r) {
    bst_export *e = &r->e;
    char folder[4096], sets[3][4096];
    e->out = folder;
    const char *problem;
    for (int i = 0; (problem = bst_run_reader_problem(e->run, i)); i++) {
        bst_log(ctx, BST_LOG_WARNING, "%s", problem);
    }
    BST_TRY(check_frames(ctx, e, r->frames != BST_EXPORT_NOT || e->satnet || e->coco || e->yolo));
    if (bst_export_into_folder(r)) {
        BST_TRY(make_folder(ctx, r->out, e->run, folder, sizeof folder));
    }
    BST_TRY(make_set_folders(ctx, r, sets));
    BST_TRY(r->table != BST_EXPORT_NOT ? bst_export_tables(ctx, e, r->tables) : BST_OK);
    BST_TRY(r->orbits != BST_EXPORT_NOT ? bst_export_orbits(ctx, e) : BST_OK);
    BST_TRY(r->observations != BST_EXPORT_NOT ? bst_export_observations(ctx, e) : BST_OK);
    BST_TRY(r->observations == BST_OBSERVATIONS_TDM ? bst_export_observers(ctx, e) : BST_OK);
    BST_TRY(r->frames != BST_EXPORT_NOT ? bst_export_frames(ctx, e) : BST_OK);
    BST_TRY(e->satnet ? bst_export_satnet(ctx, e) : BST_OK);
    return e->coco || e->yolo ? bst_export_boxes(ctx, e) : BST_OK;
}
