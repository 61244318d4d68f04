/* Runs benchmarks and reports their results. */
#ifndef BST_BENCH_BENCH_RUN_H
#define BST_BENCH_BENCH_RUN_H

#include <stdbool.h>

#include "sim/bench/bench.h"

/* Runs the benchmarks that bst_bench_is_wanted selects, each in a process of its own, and prints
 * the machine and the table of results to stdout.
 *
 * Given:     json          file for the results; NULL: none
 *            count, names  benchmarks; none: the standard set
 * Errors:    those of the benchmarks and of writing the file */
bst_status bst_bench_run(bst_ctx *ctx, const bst_bench_options *options, const char *json,
                         bool markdown, int count, char *const *names) BST_MUST_CHECK;

#endif
