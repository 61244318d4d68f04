#include "sim/study_kinds/study_request.h"

const bst_option bst_study_options[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_study_request, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "where the results go (default studies/NAME)"},
    {.name = "workers",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_study_request, workers),
     .argument = "N",
     .doc = "worker processes (default: one a core, or one for each of --device)",
     .minimum = 1,
     .maximum = 1024},
    {.name = "cores",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_study_request, cores),
     .argument = "N",
     .doc = "cores of each worker (default: all, in equal parts)",
     .minimum = 1,
     .maximum = 1024},
    {.name = "device",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_study_request, device),
     .argument = "NAME,...",
     .doc = "OpenCL devices by part of a name or P:D, which the workers take in turn"},
    {.name = "slurm",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, slurm),
     .doc = "execute on a cluster, as job arrays of Slurm (docs/how-to/slurm.md)"},
    {.name = "site",
     .needs = "slurm",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_study_request, site),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "what --slurm is to know of the cluster: account, partition, time (default "
            "boresight/slurm.json in the user's configuration folder, where there is one)"},
    {.name = "scheduler",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_study_request, scheduler),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "execute through any scheduler: JSON with its commands submit, poll and cancel "
            "(docs/how-to/schedulers.md)"},
    {.name = "resume",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, resume),
     .doc = "do what is missing of a study that was begun there"},
    {.name = "gather",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, gather),
     .doc = "read the folders PART..., which --shard made elsewhere, into FOLDER, and make the "
            "tables"},
    {.name = "dry-run",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, dry_run),
     .doc = "only check the study, and tell its runs, time and disk"},
    {.name = "emit",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_study_request, emit),
     .argument = "N",
     .doc = "write the scenario of run N to the standard output, and how to run it by hand to "
            "the standard error",
     .minimum = 0,
     .maximum = 1e9},
    {.name = "shard",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(bst_study_request, shard),
     .argument = "I/N",
     .doc = "execute part I of N here, for a scheduler of your own (env/N: I is the number of "
            "this job in its array; or FIRST:COUNT); then --resume for the tables"},
    {.name = "shard-runs",
     .kind = BST_OPTION_INT,
     .offset = offsetof(bst_study_request, shard_runs),
     .argument = "N",
     .doc = "runs that a worker does at a time (default: some seconds' worth)",
     .minimum = 1,
     .maximum = 1e6},
    {.name = "unpinned",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, unpinned),
     .doc = "do not bind workers to cores"},
    {.name = "schema",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, schema),
     .doc = "print the JSON Schema of studies"},
    {.name = "quiet",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, quiet),
     .doc = "no progress line"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(bst_study_request, help),
     .doc = "print this"},
    {.name = NULL},
};

/* What a study may be asked for beside its execution by worker processes here. */
enum { SCHEMA = 1, EMIT = 2, GATHER = 4, SHARD = 8, SCHEDULED = 16 };

/* Fails if an option has no effect on what the request asks for. A dry run takes the options of the
 * execution that it is of. */
static bst_status check_effects(bst_ctx *ctx, const bst_study_request *r) {
    const struct {
        const char *name;
        bool given;
        int what;
    } asked[] = {{"schema", r->schema, SCHEMA},  {"emit", r->emit >= 0, EMIT},
                 {"gather", r->gather, GATHER},  {"shard", r->shard != NULL, SHARD},
                 {"slurm", r->slurm, SCHEDULED}, {"scheduler", r->scheduler != NULL, SCHEDULED}};
    const struct {
        const char *name;
        bool given;
        int useless; /* with any of these */
    } options[] = {{"out", r->out != NULL, SCHEMA | EMIT},
                   {"workers", r->workers > 0, SCHEMA | EMIT | GATHER | SHARD},
                   {"cores", r->cores > 0, SCHEMA | EMIT | GATHER | SCHEDULED},
                   {"device", r->device != NULL, SCHEMA | EMIT | GATHER},
                   {"slurm", r->slurm, SCHEMA | EMIT | GATHER | SHARD},
                   {"scheduler", r->scheduler != NULL, SCHEMA | EMIT | GATHER | SHARD},
                   {"shard-runs", r->shard_runs > 0, SCHEMA | EMIT | GATHER | SHARD},
                   {"unpinned", r->unpinned, SCHEMA | EMIT | GATHER | SHARD | SCHEDULED}};
    for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
        for (size_t k = 0; k < sizeof asked / sizeof *asked && options[i].given; k++) {
            if (asked[k].given && (options[i].useless & asked[k].what)) {
                return bst_fail(ctx, BST_ERR_ARGUMENT,
                                "--%s has no effect with --%s: leave one of them out",
                                options[i].name, asked[k].name);
            }
        }
    }
    return BST_OK;
}

bst_status bst_study_request_check(bst_ctx *ctx, const bst_study_request *r) {
    const char *const actions[] = {r->schema ? "schema" : NULL,   r->emit >= 0 ? "emit" : NULL,
                                   r->dry_run ? "dry-run" : NULL, r->resume ? "resume" : NULL,
                                   r->gather ? "gather" : NULL,   r->shard ? "shard" : NULL};
    BST_TRY(bst_options_one_of(ctx, actions, sizeof actions / sizeof *actions));
    const char *const places[] = {r->workers > 0 ? "workers" : NULL, r->slurm ? "slurm" : NULL,
                                  r->scheduler ? "scheduler" : NULL};
    BST_TRY(bst_options_one_of(ctx, places, sizeof places / sizeof *places));
    return check_effects(ctx, r);
}
