/* Shards of a study as tasks of Slurm job arrays.
 *
 * Each batch of shards is one array. A task reads its runs from a table beside the script, executes
 * them, and writes its exit code to a file, because Slurm forgets jobs and may have no accounting
 * database. A task that is not in the queue and has no such file is lost: node failure, time limit,
 * or cancelled. While the controller does not answer, no task counts as lost. Slurm may run a task
 * twice (lost slurmd, restarted controller); the results of a shard still count once. Jobs carry
 * the name of the study: the next driver cancels those of a dead driver. */
#ifndef BST_STUDIES_SLURM_H
#define BST_STUDIES_SLURM_H

#include "boresight/config.h"
#include "boresight/status.h"
#include "sim/studies/executor.h"

/* Settings of a cluster, from a small JSON file; "": not set. */
typedef struct bst_slurm_site {
    char account[64], partition[64], qos[64], gres[64];
    char options[512];  /* further options of sbatch, separated by spaces */
    char setup[4096];   /* shell script that every task sources first */
    int64_t time_min;   /* 0: the partition's default */
    int64_t memory_mib; /* per task; 0: the partition's default */
    int64_t cpus_per_task;
    int64_t array_size; /* maximum tasks per array (MaxArraySize of the cluster minus one) */
    int64_t queue_size; /* maximum tasks in the queue */
    double poll_s, grace_s, patience_s;
} bst_slurm_site;

extern const bst_config_desc bst_slurm_site_table[];

/* Reads a site file; `path` NULL: defaults. BST_ERR_CONFIG; errors of bst_json_load. */
bst_status bst_slurm_site_load(bst_ctx *ctx, const char *path, bst_slurm_site *out) BST_MUST_CHECK;

/* Creates an executor that uses sbatch, squeue and scancel. A task runs `program` (NULL-terminated)
 * with the additional argument "FIRST:COUNT" in the folder `study_folder`, which all nodes see
 * under the same path; scripts and logs go to its folder "slurm". Jobs of an earlier driver of this
 * study are cancelled. BST_ERR_NOT_FOUND: no sbatch; BST_ERR_IO: no folder, or squeue fails. */
bst_status bst_slurm_create(bst_ctx *ctx, const bst_slurm_site *site, const char *study_folder,
                            const char *const program[], bst_executor *out) BST_MUST_CHECK;

#endif
