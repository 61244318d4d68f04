#include "sim/report/report_file.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/io/draft_file.h"
#include "sim/report/report_study.h"

bst_status bst_report_path(bst_ctx *ctx, const char *given, const char *folder, char path[4096]) {
    struct stat info;
    bool inside = !given || (stat(given, &info) == 0 && S_ISDIR(info.st_mode));
    const char *base = given ? given : folder;
    int n = inside ? snprintf(path, 4096, "%s%sreport.html", base,
                              base[0] && base[strlen(base) - 1] == '/' ? "" : "/")
                   : snprintf(path, 4096, "%s", base);
    return n < 4096 ? BST_OK : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", base);
}

static bool is_study(const char *folder) {
    static const char *const names[] = {BST_STUDY_DATABASE, "study.json"};
    bool found = false;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        char path[4200];
        struct stat info;
        snprintf(path, sizeof path, "%.4096s/%s", folder, names[k]);
        found = found || stat(path, &info) == 0;
    }
    return found;
}

bst_status bst_report_write(bst_ctx *ctx, const char *folder, const char *out, char path[4096],
                            bool *damaged) {
    bst_run_reader *run = NULL;
    bst_draft draft;
    BST_TRY(bst_report_path(ctx, out, folder, path));
    bool study = is_study(folder);
    BST_TRY((study ? bst_run_reader_open_study : bst_run_reader_open)(ctx, folder, &run));
    bst_status status = bst_draft_open(ctx, path, &draft);
    if (status == BST_OK) {
        status = (study ? bst_report_study : bst_report_run)(ctx, run, draft.stream);
        status = bst_draft_close(ctx, &draft, status);
    }
    const char *problem;
    for (int i = 0; status == BST_OK && (problem = bst_run_reader_problem(run, i)); i++) {
        fprintf(stderr, "boresight: %s\n", problem);
        *damaged = true;
    }
    bst_run_reader_close(run);
    return status;
}
