#include "sim/studies/shard_range.h"

#include <inttypes.h>
#include <stdio.h>

bst_status bst_study_shard_range(bst_ctx *ctx, const char *text, int64_t runs,
                                 bst_study_shard_job *job, bool *exact) {
    int64_t i, n;
    char rest;
    *exact = sscanf(text, "%" SCNd64 ":%" SCNd64 "%c", &i, &n, &rest) == 2;
    if (*exact && i >= 0 && n >= 1 && i < runs && n <= runs - i) {
        job->first = i;
        job->count = n;
        return BST_OK;
    }
    if (sscanf(text, "%" SCNd64 "/%" SCNd64 "%c", &i, &n, &rest) != 2 || n < 1 || i < 1 || i > n ||
        n > 1000000000) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--shard %s: I/N is expected, from 1/N to N/N, such as 3/8, or FIRST:COUNT "
                        "within the study's %" PRId64 " runs",
                        text, runs);
    }
    job->first = (int64_t)((double)runs * (double)(i - 1) / (double)n);
    job->count = (int64_t)((double)runs * (double)i / (double)n) - job->first;
    return BST_OK;
}
