#include "sim/studies/study_outcome.h"

#include <inttypes.h>

#include "sim/core/text.h"

enum { FAILURES_SHOWN = 5 };

void bst_study_print_outcome(FILE *stream, const bst_results *r, const bst_driver_outcome *o,
                             double wall, const char *out) {
    const bst_study *s = r->study;
    fprintf(stream, "%s: %" PRId64 " of %s in %s, %.1f s\n", s->config.name, r->done,
            bst_text_of_count((char[BST_COUNT_TEXT]){0}, s->runs, "run", "runs"),
            bst_text_of_count((char[BST_COUNT_TEXT]){0}, s->settings, "setting", "settings"), wall);
    for (int64_t i = 0; i < r->error_count && i < FAILURES_SHOWN; i++) {
        fprintf(stream, "  run %" PRId64 " failed: %s\n", r->errors[i].run, r->errors[i].text);
    }
    if (r->error_count > FAILURES_SHOWN) {
        fprintf(stream, "  and %" PRId64 " more: see status and error in the table runs\n",
                r->error_count - FAILURES_SHOWN);
    }
    if (o->missing > 0) {
        fprintf(stream, "  %s %s missing%s%s\n",
                bst_text_of_count((char[BST_COUNT_TEXT]){0}, o->missing, "run", "runs"),
                o->missing == 1 ? "is" : "are", *o->why ? ": " : "", o->why);
        fprintf(stream, "  go on: boresight study %s --resume\n", out);
    } else {
        fprintf(stream, "  results in %s/study.sqlite and CSV files beside it\n", out);
    }
    if (r->differing > 0) {
        fprintf(stream, "  warning: made twice with different results: %s\n",
                bst_text_of_count((char[BST_COUNT_TEXT]){0}, r->differing, "run", "runs"));
    }
}
