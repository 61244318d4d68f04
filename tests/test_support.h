/* What every test includes: cmocka with the headers that it needs first. */
#ifndef BST_TESTS_TEST_SUPPORT_H
#define BST_TESTS_TEST_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
/* after the standard headers, as cmocka asks */
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* "$TMPDIR/<name>_XXXXXX" for mkstemp and mkdtemp; /tmp where the variable is not set. */
#define BST_TEST_PATH 256
static inline void bst_test_template(char path[BST_TEST_PATH], const char *name) {
    const char *base = getenv("TMPDIR");
    int n = snprintf(path, BST_TEST_PATH, "%s/%s_XXXXXX", base && *base ? base : "/tmp", name);
    assert_true(n > 0 && n < BST_TEST_PATH);
}

/* Fails with both values when |actual - expected| > tolerance or actual is not a number.
 * Say at the call where the tolerance comes from. */
#define bst_assert_close(actual, expected, tolerance)                                             \
    do {                                                                                          \
        double bst_a_ = (double)(actual), bst_e_ = (double)(expected),                            \
               bst_t_ = (double)(tolerance);                                                      \
        if (!(fabs(bst_a_ - bst_e_) <= bst_t_)) {                                                 \
            fail_msg("%s = %.17g, expected %.17g within %g (off by %g)", #actual, bst_a_, bst_e_, \
                     bst_t_, bst_a_ - bst_e_);                                                    \
        }                                                                                         \
    } while (0)

/* Fails with the context's message when expr is not BST_OK. */
#define bst_assert_ok(ctx, expr)                                                    \
    do {                                                                            \
        bst_status bst_s_ = (expr);                                                 \
        if (bst_s_ != BST_OK) {                                                     \
            fail_msg("%s: %s: %s", #expr, bst_status_name(bst_s_), (ctx)->message); \
        }                                                                           \
    } while (0)

#endif
