/* The options of boresight study. */
#ifndef BST_STUDY_KINDS_STUDY_REQUEST_H
#define BST_STUDY_KINDS_STUDY_REQUEST_H

#include "sim/cli/options.h"
#include "sim/study_kinds/study_devices.h"

/* What the command line asks for. */
typedef struct bst_study_request {
    const char *out, *shard, *site, *scheduler, *device; /* these options; NULL: not given */
    int64_t workers, cores, shard_runs;                  /* 0: not given */
    int64_t emit;                                        /* number of a run; -1: not given */
    bool resume, gather, dry_run, quiet, schema, help, unpinned, slurm;
    char **parts; /* folders that --gather reads */
    int part_count;
    bst_study_devices devices; /* those of `device` */
} bst_study_request;

/* Table of the options, with offsets in a bst_study_request. */
extern const bst_option bst_study_options[];

/* Checks that the options given fit together.
 *
 * Errors:    BST_ERR_ARGUMENT: two options that each ask for another action, --workers with a
 *            scheduler, two schedulers, or an option without effect on the action */
bst_status bst_study_request_check(bst_ctx *ctx, const bst_study_request *request) BST_MUST_CHECK;

#endif
