/* What a function prints to stdout, as text. */
#ifndef BST_TESTS_STDOUT_TEXT_H
#define BST_TESTS_STDOUT_TEXT_H

#include <unistd.h>

#include "tests/test_support.h"

typedef struct bst_stdout_text {
    FILE *file;
    int kept; /* descriptor of the former stdout */
} bst_stdout_text;

/* From here on stdout goes into a file without a name. */
static inline void bst_stdout_take(bst_stdout_text *t) {
    fflush(stdout);
    t->file = tmpfile();
    assert_non_null(t->file);
    t->kept = dup(STDOUT_FILENO);
    assert_true(t->kept >= 0);
    assert_true(dup2(fileno(t->file), STDOUT_FILENO) >= 0);
}

/* Ends it: the text, cut to `bytes`. */
static inline void bst_stdout_give(bst_stdout_text *t, char *text, size_t bytes) {
    fflush(stdout);
    assert_true(dup2(t->kept, STDOUT_FILENO) >= 0);
    close(t->kept);
    rewind(t->file);
    text[fread(text, 1, bytes - 1, t->file)] = '\0';
    fclose(t->file);
}

/* Fails unless the text has the part. */
static inline void bst_assert_has(const char *text, const char *part) {
    if (!strstr(text, part)) {
        fail_msg("no \"%s\" in:\n%s", part, text);
    }
}

#endif
