/* Shards of a study as tasks of Slurm job arrays.
 *
 * Every batch of shards is one array; a task reads its runs from a table beside the script, runs
 * them, and leaves its exit code in a file, because Slurm forgets jobs and need not have an
 * accounting database. A task that is no longer in the queue and left no such file is lost: its
 * node died, its time ran out, somebody cancelled it. While the controller does not answer nothing
 * is taken for lost. Slurm may run a task twice (a node that lost its slurmd, a restarted
 * controller); the shard's results count once all the same. Nothing stays behind: the jobs of a
 * study carry its name, and the next driver cancels those of a driver that died. */
#ifndef BST_STUDIES_SLURM_H
#define BST_STUDIES_SLURM_H

#include "boresight/config.h"
#include "boresight/status.h"
#include "sim/studies/executor.h"

/* What differs between clusters; one small JSON file. Texts are "" where nothing is asked for. */
typedef struct bst_slurm_site {
    char account[64], partition[64], qos[64], gres[64];
    char options[512];  /* further options of sbatch, separated by blanks */
    char setup[4096];   /* shell script that every task sources before it starts */
    int64_t time_min;   /* 0: the partition's default */
    int64_t memory_mib; /* per task; 0: the partition's default */
    int64_t cpus_per_task;
    int64_t array_size; /* tasks of one array at most (MaxArraySize of the cluster less one) */
    int64_t queue_size; /* tasks in the queue at most */
    double poll_s, grace_s, patience_s;
} bst_slurm_site;

extern const bst_config_desc bst_slurm_site_table[];

/* Reads a site file; `path` NULL: all defaults. BST_ERR_CONFIG and the errors of bst_json_load. */
bst_status bst_slurm_site_load(bst_ctx *ctx, const char *path, bst_slurm_site *out) BST_MUST_CHECK;

/* An executor that submits with sbatch, watches with squeue and cancels with scancel. A task runs
 * `program` (NULL-terminated) with "FIRST:COUNT" as one more argument, in the folder
 * `study_folder`, which all nodes see under the same path; scripts and logs go to its folder
 * "slurm". Jobs that an earlier driver of this study left in the queue are cancelled.
 * BST_ERR_NOT_FOUND: there is no sbatch here; BST_ERR_IO: no folder, or squeue refuses. */
bst_status bst_slurm_create(bst_ctx *ctx, const bst_slurm_site *site, const char *study_folder,
                            const char *const program[], bst_executor *out) BST_MUST_CHECK;

#endif
