#include "sim/studies/results.h"

#include <stdlib.h>
#include <string.h>

bst_status bst_results_create(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                              bst_results *out) {
    *out = (bst_results){.study = study, .kind = kind};
    size_t runs = (size_t)study->runs, metrics = (size_t)kind->metric_count;
    out->state = calloc(runs, 1);
    out->metrics = malloc(runs * metrics * sizeof *out->metrics + 1);
    out->wall_s = malloc(runs * sizeof *out->wall_s);
    out->cpu_s = malloc(runs * sizeof *out->cpu_s);
    if (!out->state || !out->metrics || !out->wall_s || !out->cpu_s) {
        bst_results_free(out);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the rows of %lld runs",
                        (long long)study->runs);
    }
    return BST_OK;
}

void bst_results_free(bst_results *r) {
    for (int64_t i = 0; i < r->error_count; i++) {
        free(r->errors[i].text);
    }
    free(r->errors);
    free(r->parts);
    free(r->series);
    free(r->state);
    free(r->metrics);
    free(r->wall_s);
    free(r->cpu_s);
    *r = (bst_results){.study = NULL};
}

void bst_results_forget(bst_results *r, int64_t run) {
    if (r->state[run] != BST_ROW_DONE) {
        return;
    }
    r->state[run] = BST_ROW_MISSING;
    r->done--;
    for (int64_t i = 0; i < r->part_count; i++) {
        if (r->parts[i].run == run) {
            r->parts[i] = r->parts[--r->part_count];
            break;
        }
    }
}

static int compare_errors(const void *a, const void *b) {
    const bst_study_row_error *x = a, *y = b;
    return (x->run > y->run) - (x->run < y->run);
}

static int compare_parts(const void *a, const void *b) {
    const bst_study_series_part *x = a, *y = b;
    return (x->run > y->run) - (x->run < y->run);
}

void bst_results_sort(bst_results *r) {
    if (r->error_count > 1) {
        qsort(r->errors, (size_t)r->error_count, sizeof *r->errors, compare_errors);
    }
    if (r->part_count > 1) {
        qsort(r->parts, (size_t)r->part_count, sizeof *r->parts, compare_parts);
    }
}

const char *bst_results_error(const bst_results *r, int64_t run) {
    for (int64_t i = 0; i < r->error_count; i++) {
        if (r->errors[i].run == run) {
            return r->errors[i].text;
        }
    }
    return NULL;
}
