/* Text for the time spans in warnings of `boresight check`. */
#ifndef BST_ANALYSIS_CHECK_CHECK_SPANS_H
#define BST_ANALYSIS_CHECK_CHECK_SPANS_H

#include <stdbool.h>

/* Time spans of one condition, in seconds after the epoch; {0}: none. */
typedef struct bst_check_spans {
    int count;
    double from_s, until_s; /* of the first span */
    double sum_s;           /* total duration */
} bst_check_spans;

typedef struct bst_check_span_words {
    char from[80];  /* first span: "from 1.0 s until 2.0 s" */
    char more[128]; /* " (the first of 3 times, 40 s in all)", and the examined part of the run; may
                       be "" */
} bst_check_span_words;

/* Adds an interval of time, in order of time; only the first one is kept, and the sum of lengths.
 *
 * Given:     from_s, until_s  seconds since the scenario's epoch */
void bst_check_spans_add(bst_check_spans *spans, double from_s, double until_s);

/* Words for a warning.
 *
 * Given:    spans       at least one
 *           examined_s  how much of the run was examined, s
 *           duration_s  of the run, s
 * Returned: words for the spans; a first span that lasts until examined_s has no end yet */
bst_check_span_words bst_check_spans_word(const bst_check_spans *spans, double examined_s,
                                          double duration_s);

#endif
