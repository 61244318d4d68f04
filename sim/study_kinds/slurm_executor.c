/* `boresight study --slurm`: reads the site file, and defines the command of an array task. */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

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

bst_status bst_study_slurm(bst_ctx *ctx, const char *site_file, const char *device, const char *out,
                           bst_executor *executor) {
    char path[4096], program[4096];
    bst_slurm_site site;
    BST_TRY(bst_slurm_site_load(ctx, site_file ? site_file : own_site(path, sizeof path), &site));
    ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
    if (length <= 0) {
        return bst_fail(ctx, BST_ERR_IO, "/proc/self/exe: cannot be read");
    }
    program[length] = '\0';
    /* a task starts in OUT/slurm */
    const char *const task[] = {program, "study", "..", "--quiet", "--shard", NULL};
    const char *const on_device[] = {program,    "study", "..",      "--quiet",
                                     "--device", device,  "--shard", NULL};
    return bst_slurm_create(ctx, &site, out, *device ? on_device : task, executor);
}
