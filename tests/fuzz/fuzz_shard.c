/* The reader of a study's rows (shards) on any bytes, as they are and with a right last line, for
 * studies with and without series. What is taken has its rows in their tables. */
#define _GNU_SOURCE /* memrchr */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/fnv.h"
#include "sim/studies/results.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static const bst_study_metric metrics[] = {{"a", "s", "A.", BST_METRIC_VALUE},
                                           {"b", "", "B.", BST_METRIC_FLAG}};
static const bst_study_metric series[] = {{"key", "", "Key.", BST_METRIC_KEY},
                                          {"hits", "", "Hits.", BST_METRIC_HITS}};
static const bst_study study = {.runs = 6, .digest = "0123456789abcdef"};

static void check(const bst_results *r) {
    int64_t done = 0, failed = 0;
    size_t rows = 0;
    for (int64_t run = 0; run < study.runs; run++) {
        done += r->state[run] != BST_ROW_MISSING;
        failed += r->state[run] == BST_ROW_FAILED;
        if ((bst_results_error(r, run) != NULL) != (r->state[run] == BST_ROW_FAILED)) {
            abort();
        }
    }
    for (int64_t i = 0; i < r->part_count; i++) {
        const bst_study_series_part *part = &r->parts[i];
        if (part->rows < 0 || part->first + (size_t)part->rows > r->series_rows ||
            r->state[part->run] != BST_ROW_DONE) {
            abort();
        }
        rows += (size_t)part->rows;
    }
    if (done != r->done || failed != r->failed || rows != r->series_rows ||
        r->error_count != failed) {
        abort();
    }
}

static void load(const void *data, size_t bytes, int series_count) {
    const bst_study_kind kind = {.name = "loop",
                                 .metrics = metrics,
                                 .metric_count = 2,
                                 .series_name = series_count ? "curve" : NULL,
                                 .series = series,
                                 .series_count = series_count};
    static const char *const names[] = {"000000000-000000002.rows", "any.rows"};
    bst_ctx ctx;
    bst_results results;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    if (bst_results_create(&ctx, &study, &kind, &results) != BST_OK) {
        abort();
    }
    for (int i = 0; i < 2; i++) {
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_status status =
            bst_results_load(&ctx, &results, fuzz_write_file(names[i], data, bytes));
        FUZZ_CHECK_REASON(ctx, status);
        bst_results_sort(&results);
        check(&results);
    }
    bst_results_free(&results);
}

/* The input with another last line: what a shard's text would end with. Freed by the caller. */
static char *seal(const uint8_t *data, size_t bytes, size_t *sealed) {
    const uint8_t *end = bytes > 1 ? memrchr(data, '\n', bytes - 1) : NULL;
    size_t head = end ? (size_t)(end + 1 - data) : 0, rows = 0;
    char *out = malloc(head + 64);
    memcpy(out, data, head);
    for (size_t i = 0; i + 1 < head; i++) {
        rows += out[i] == '\n' && (out[i + 1] == 'R' || out[i + 1] == 'F');
    }
    *sealed = head + (size_t)snprintf(out + head, 64, "end %zu %016" PRIx64 "\n", rows,
                                      bst_fnv(BST_FNV_START, out, head));
    return out;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    size_t sealed_bytes;
    char *sealed = seal(data, bytes, &sealed_bytes);
    load(data, bytes, 2);
    for (int series_count = 0; series_count <= 2; series_count += 2) {
        load(sealed, sealed_bytes, series_count);
    }
    free(sealed);
    return 0;
}
