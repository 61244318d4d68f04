#include "sim/studies/shard_range.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Parts of a study at most. */
static const int64_t PARTS_MOST = 1000000000;

/* Variables with the number of a job in its array, the first that is set counts. */
static const struct array_variable {
    const char *name;
    const char *start; /* variable with the array's first number; NULL: `first` */
    int64_t first;
} array_variables[] = {
    {"BORESIGHT_SHARD_INDEX", NULL, 0},
    {"JOB_COMPLETION_INDEX", NULL, 0},      /* Kubernetes, indexed jobs */
    {"AWS_BATCH_JOB_ARRAY_INDEX", NULL, 0}, /* AWS Batch, array jobs */
    {"SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_MIN", 0},
    {"SGE_TASK_ID", "SGE_TASK_FIRST", 1},
    {"LSB_JOBINDEX", NULL, 1}, /* LSF */
};

static bool read_number(const char *text, int64_t *out) {
    char rest;
    return text && sscanf(text, "%" SCNd64 "%c", out, &rest) == 1;
}

/* True if a value says that the job is in no array: SGE's word, and the 0 of LSF. */
static bool is_outside(const char *name, const char *value) {
    return strcmp(value, "undefined") == 0 ||
           (strcmp(name, "LSB_JOBINDEX") == 0 && strcmp(value, "0") == 0);
}

/* Number of this job in its array of `jobs`, from 1. */
static bst_status array_number(bst_ctx *ctx, const char *shard, int64_t jobs, int64_t *out) {
    for (size_t i = 0; i < sizeof array_variables / sizeof *array_variables; i++) {
        const struct array_variable *v = &array_variables[i];
        const char *text = getenv(v->name);
        int64_t first = v->first, number;
        if (!text || is_outside(v->name, text)) {
            continue;
        }
        if (v->start && getenv(v->start) && !read_number(getenv(v->start), &first)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--shard %s: %s=%s is no number", shard,
                            v->start, getenv(v->start));
        }
        if (!read_number(text, &number)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "--shard %s: %s=%s is no number", shard, v->name,
                            text);
        }
        if (jobs >= 1 && (number < first || (uint64_t)number - (uint64_t)first >= (uint64_t)jobs)) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "--shard %s: %s=%s is out of range (allowed: %" PRId64 " to %" PRId64
                            "); give the array as many jobs as the study has parts",
                            shard, v->name, text, first, first + jobs - 1);
        }
        *out = number - first + 1;
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "--shard %s: no variable of the environment holds the number of this job; set "
                    "BORESIGHT_SHARD_INDEX, from 0",
                    shard);
}

/* Reads "I/N", or "env/N" with I from the environment. */
static bst_status part_of(bst_ctx *ctx, const char *text, int64_t *i, int64_t *n, bool *read) {
    if (strncmp(text, "env/", 4) == 0) {
        *read = read_number(text + 4, n) && *n <= PARTS_MOST;
        return *read ? array_number(ctx, text, *n, i) : BST_OK;
    }
    char rest;
    *read = sscanf(text, "%" SCNd64 "/%" SCNd64 "%c", i, n, &rest) == 2;
    return BST_OK;
}

bst_status bst_study_shard_range(bst_ctx *ctx, const char *text, int64_t runs,
                                 bst_study_shard_job *job, bool *exact) {
    int64_t i, n;
    char rest;
    bool read;
    *exact = sscanf(text, "%" SCNd64 ":%" SCNd64 "%c", &i, &n, &rest) == 2;
    if (*exact && i >= 0 && n >= 1 && i < runs && n <= runs - i) {
        job->first = i;
        job->count = n;
        return BST_OK;
    }
    BST_TRY(part_of(ctx, text, &i, &n, &read));
    if (!read || n < 1 || i < 1 || i > n || n > PARTS_MOST) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--shard %s: I/N is expected, from 1/N to N/N, such as 3/8, or env/N, or "
                        "FIRST:COUNT within the study's %" PRId64 " runs",
                        text, runs);
    }
    job->first = (int64_t)((double)runs * (double)(i - 1) / (double)n);
    job->count = (int64_t)((double)runs * (double)i / (double)n) - job->first;
    return BST_OK;
}
