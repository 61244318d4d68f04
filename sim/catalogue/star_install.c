#include "sim/catalogue/star_install.h"

#include "sim/catalogue/star_fetch.h"
#include "sim/catalogue/stars.h"
#include "sim/core/folder.h"

bst_status bst_star_install_fetched(bst_ctx *ctx, bst_star_progress_fn progress,
                                    void *progress_user, char *path, size_t path_bytes,
                                    bool *already) {
    BST_TRY(bst_stars_default_path(ctx, path, path_bytes));
    return bst_star_fetch(ctx, path, progress, progress_user, already);
}

bst_status bst_star_install(bst_ctx *ctx, const bst_star_install_request *request, char *path,
                            size_t path_bytes, long long *stars) {
    bst_star_import_options options = bst_star_import_all();
    const char *out = request->out;
    options.progress = request->progress;
    options.progress_user = request->progress_user;
    if (request->subset) {
        BST_TRY(bst_star_subset_read(ctx, request->subset, &options.subset));
    }
    if (!out) {
        BST_TRY(bst_stars_default_path(ctx, path, path_bytes));
        BST_TRY(bst_folder_make_above(ctx, path));
        out = path;
    }
    return bst_star_import_tarball(ctx, request->tarball, &options, out, stars);
}
