/* The benchmarks by name. */
#ifndef BST_BENCH_BENCH_LIST_H
#define BST_BENCH_BENCH_LIST_H

#include <stdbool.h>

#include "sim/bench/bench.h"

enum { BST_BENCHES = 45 };

/* All benchmarks, in the order in which they run. */
extern const bst_bench bst_bench_list[BST_BENCHES];

/* True if a benchmark is among names[count], or if no name is given and it belongs to the standard
 * set (all but "small"). */
bool bst_bench_is_wanted(const bst_bench *bench, int count, char *const *names);

/* Checks that all names are those of benchmarks.
 *
 * Errors:    BST_ERR_ARGUMENT with the first that is not */
bst_status bst_bench_check_names(bst_ctx *ctx, int count, char *const *names) BST_MUST_CHECK;

/* Checks that one of the wanted benchmarks reads what is given.
 *
 * Given:     tle, scenario  a file of element sets, and a scenario, are given
 *            names          [count] of benchmarks; none: all
 * Errors:    BST_ERR_ARGUMENT with the option that has no effect */
bst_status bst_bench_check_files(bst_ctx *ctx, bool tle, bool scenario, int count,
                                 char *const *names) BST_MUST_CHECK;

#endif
