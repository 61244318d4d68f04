/* `boresight study --slurm` and `--scheduler`: read their files, and define the command of a job.
 */
#define _XOPEN_SOURCE 700 /* realpath */

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/studies/scheduler.h"
#include "sim/studies/slurm.h"
#include "sim/study_kinds/study_kinds.h"

/* The user's own site file; "": none. */
static const char *own_site(char *path, size_t bytes) {
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    int n = config && *config ? snprintf(path, bytes, "%s/boresight/slurm.json", config)
            : home && *home   ? snprintf(path, bytes, "%s/.config/boresight/slurm.json", home)
                              : -1;
    return n > 0 && (size_t)n < bytes && access(path, F_OK) == 0 ? path : NULL;
}

/* Path of this program. */
static bst_status own_program(bst_ctx *ctx, char path[4096]) {
    ssize_t length = readlink("/proc/self/exe", path, 4095);
    if (length <= 0) {
        return bst_fail(ctx, BST_ERR_IO, "/proc/self/exe: cannot be read");
    }
    path[length] = '\0';
    return BST_OK;
}

bst_status bst_study_site_load(bst_ctx *ctx, const char *file, bst_slurm_site *out) {
    char path[4096];
    return bst_slurm_site_load(ctx, file ? file : own_site(path, sizeof path), out);
}

bst_status bst_study_slurm(bst_ctx *ctx, const char *site_file, const char *device, const char *out,
                           bst_executor *executor) {
    char program[4096];
    bst_slurm_site site;
    BST_TRY(bst_study_site_load(ctx, site_file, &site));
    BST_TRY(own_program(ctx, program));
    /* a task starts in OUT/slurm */
    const char *const task[] = {program, "study", "..", "--quiet", "--shard", NULL};
    const char *const on_device[] = {program,    "study", "..",      "--quiet",
                                     "--device", device,  "--shard", NULL};
    return bst_slurm_create(ctx, &site, out, *device ? on_device : task, executor);
}

bst_status bst_study_scheduler(bst_ctx *ctx, const char *file, const char *device, const char *out,
                               bst_executor *executor) {
    char program[4096], folder[PATH_MAX];
    bst_scheduler scheduler;
    BST_TRY(bst_scheduler_load(ctx, file, &scheduler));
    BST_TRY(own_program(ctx, program));
    if (!realpath(out, folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", out, strerror(errno));
    }
    const char *const job[] = {program, "study", folder, "--quiet", "--shard", NULL};
    const char *const on_device[] = {program,    "study", folder,    "--quiet",
                                     "--device", device,  "--shard", NULL};
    return bst_scheduler_create(ctx, &scheduler, folder, *device ? on_device : job, executor);
}
