#include "sim/bench/bench_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/bench/bench_list.h"
#include "sim/bench/bench_table.h"
#include "sim/io/manifest.h"

/* Argument of run_bench. */
typedef struct task {
    const bst_bench *bench;
    const bst_bench_options *options;
} task;

static bst_status run_bench(bst_ctx *ctx, void *user, void *out) {
    const task *e = user;
    bst_bench_result *result = out;
    BST_TRY(e->bench->run(ctx, e->bench, e->options, result));
    if (isnan(result->peak_rss_mib)) {
        result->peak_rss_mib = bst_bench_peak_rss_mib();
    }
    return BST_OK;
}

/* Each benchmark runs in a process of its own, so that memory and caches of others do not count. */
static bst_status run_all(bst_ctx *ctx, const bst_bench_options *options, bool markdown, int count,
                          char *const *names, const bst_bench_device *device, cJSON *results) {
    bst_bench_print_head(stdout, markdown);
    for (int b = 0; b < BST_BENCHES; b++) {
        if (!bst_bench_is_wanted(&bst_bench_list[b], count, names)) {
            continue;
        }
        bst_bench_result result = bst_bench_nothing(bst_bench_list[b].name);
        task e = {&bst_bench_list[b], options};
        BST_TRY(bst_bench_apart(ctx, run_bench, &e, &result, sizeof result));
        bst_bench_print_result(stdout, &result, markdown);
        cJSON_AddItemToArray(results, bst_bench_result_json(&result, device));
    }
    return BST_OK;
}

static void print_machine(const cJSON *machine) {
    const cJSON *item;
    cJSON_ArrayForEach(item, machine) {
        printf("%s%s", item->prev && item->prev->next ? ", " : "",
               cJSON_IsString(item) ? item->valuestring : item->string);
        if (cJSON_IsNumber(item)) {
            printf(" %g", item->valuedouble);
        }
    }
    printf("\n\n");
}

bst_status bst_bench_run(bst_ctx *ctx, const bst_bench_options *options, const char *json,
                         bool markdown, int count, char *const *names) {
    bst_bench_device device;
    BST_TRY(bst_bench_describe_device(ctx, options, &device));
    cJSON *root = cJSON_CreateObject(), *machine = bst_bench_machine(&device);
    cJSON_AddItemToObject(root, "machine", machine);
    cJSON *results = cJSON_AddArrayToObject(root, "results");
    print_machine(machine);
    bst_status status = run_all(ctx, options, markdown, count, names, &device, results);
    if (status == BST_OK && json) {
        char *text = cJSON_Print(root);
        status = text ? bst_io_write_file_atomic(ctx, json, text, strlen(text))
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the results");
        free(text);
    }
    cJSON_Delete(root);
    return status;
}
