#include "sim/analysis/check/check_spans.h"

#include <stdio.h>

#include "sim/astro/time.h"

void bst_check_spans_add(bst_check_spans *spans, double from_s, double until_s) {
    if (spans->count++ == 0) {
        spans->from_s = from_s;
        spans->until_s = until_s;
    }
    spans->sum_s += until_s - from_s;
}

bst_check_span_words bst_check_spans_word(const bst_check_spans *spans, double examined_s,
                                          double duration_s) {
    bst_check_span_words words = {.more = ""};
    bool cut = examined_s < duration_s;
    if (spans->until_s < examined_s) {
        snprintf(words.from, sizeof words.from, "from %.1f s until %.1f s", spans->from_s,
                 spans->until_s);
    } else {
        snprintf(words.from, sizeof words.from, "from %.1f s until the end of %s", spans->from_s,
                 cut ? "the time that was examined" : "the run");
    }
    int length = 0;
    if (spans->count > 1) {
        length = snprintf(words.more, sizeof words.more, " (the first of %d times, %.0f s in all)",
                          spans->count, spans->sum_s);
    }
    if (cut) {
        snprintf(words.more + length, sizeof words.more - (size_t)length, " in the first %.3g days",
                 examined_s / BST_DAY_S);
    }
    return words;
}
