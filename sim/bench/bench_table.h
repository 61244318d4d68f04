/* Results of benchmarks as a table, plain or in Markdown. */
#ifndef BST_BENCH_BENCH_TABLE_H
#define BST_BENCH_BENCH_TABLE_H

#include <stdbool.h>
#include <stdio.h>

#include "sim/bench/bench.h"

/* Prints the titles of the columns. */
void bst_bench_print_head(FILE *stream, bool markdown);

/* Prints the row of a result; members that are NAN become "-". The plain table adds lines for
 * set-up time, errors, detections and phases that the result has. */
void bst_bench_print_result(FILE *stream, const bst_bench_result *result, bool markdown);

#endif
