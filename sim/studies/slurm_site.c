#include <stdio.h>

#include "sim/studies/slurm.h"

const bst_config_desc bst_slurm_site_table[] = {
    BST_STRING(bst_slurm_site, account, "\"\"",
               "Account that the jobs are charged to (sbatch --account)."),
    BST_STRING(bst_slurm_site, partition, "\"\"", "Partition (sbatch --partition)."),
    BST_STRING(bst_slurm_site, qos, "\"\"", "Quality of service (sbatch --qos)."),
    BST_STRING(bst_slurm_site, gres, "\"\"",
               "Generic resources of a task, for example \"gpu:1\" (sbatch --gres)."),
    BST_STRING(bst_slurm_site, options, "\"\"",
               "Further options of sbatch, separated by blanks, for example \"--exclude=node7\"."),
    BST_PATH(bst_slurm_site, setup, "\"\"",
             "Shell script that every task sources first, for modules and variables."),
    BST_INT(bst_slurm_site, time_min, "min", 0, 525600, "0",
            "Time limit of a task; 0: the partition's default."),
    BST_INT(bst_slurm_site, memory_mib, "MiB", 0, 16777216, "0",
            "Memory of a task; 0: the partition's default."),
    BST_INT(bst_slurm_site, cpus_per_task, "", 1, 1024, "1", "Processor cores of a task."),
    BST_INT(bst_slurm_site, array_size, "", 1, 4000000, "1000",
            "Tasks of one job array at most: MaxArraySize of the cluster less one."),
    BST_INT(bst_slurm_site, queue_size, "", 1, 4000000, "5000",
            "Tasks in the queue at most, for clusters that limit them (MaxSubmitJobs)."),
    BST_REAL(bst_slurm_site, poll_s, "s", 0.1, 3600, "5", "Time between two looks at the queue."),
    BST_REAL(bst_slurm_site, grace_s, "s", 0, 3600, "10",
             "Time that a task may be gone from the queue before its exit code is seen."),
    BST_REAL(bst_slurm_site, patience_s, "s", 1, 86400, "900",
             "Time that the controller may be silent before the study stops."),
    BST_CONFIG_END};

bst_status bst_slurm_site_load(bst_ctx *ctx, const char *path, bst_slurm_site *out) {
    if (!path) {
        return bst_config_defaults(ctx, bst_slurm_site_table, out);
    }
    bst_json *json = NULL;
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status =
        bst_config_read(ctx, json, bst_json_root(json), "", bst_slurm_site_table, out);
    bst_json_free(json);
    return status;
}
