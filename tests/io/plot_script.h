/* What a plot asks gnuplot for: a stand-in on PATH keeps the script and writes an image of one
 * byte. */
#ifndef BST_TESTS_IO_PLOT_SCRIPT_H
#define BST_TESTS_IO_PLOT_SCRIPT_H

#include "tests/io/scratch.h"

typedef struct plot_script {
    scratch folder;
    char *search; /* PATH of before */
} plot_script;

static inline void plot_script_begin(plot_script *p) {
    char list[4096];
    scratch_make(&p->folder);
    const char *path = scratch_path(&p->folder, "gnuplot");
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "#!/bin/sh\ncat > '%s/script'\necho > \"$(sed -n \"s/^set output '\\(.*\\)'/\\1/p\" "
            "'%s/script')\"\n",
            p->folder.folder, p->folder.folder);
    fclose(f);
    assert_int_equal(chmod(path, 0755), 0);
    p->search = strdup(getenv("PATH"));
    assert_non_null(p->search);
    snprintf(list, sizeof list, "%s:%.3000s", p->folder.folder, p->search);
    setenv("PATH", list, 1);
}

/* Reads the script of the plot that was made last, and removes the folder. */
static inline void plot_script_end(plot_script *p, char *text, size_t size) {
    setenv("PATH", p->search, 1);
    free(p->search);
    FILE *f = fopen(scratch_path(&p->folder, "script"), "r");
    assert_non_null(f);
    size_t n = fread(text, 1, size - 1, f);
    text[n] = '\0';
    fclose(f);
    scratch_remove(&p->folder);
}

/* The numbers after `what`, the first time after `*from`, which is moved behind them; there must be
 * `count`. */
static inline void plot_script_numbers(const char **from, const char *what, int count,
                                       double *out) {
    const char *at = strstr(*from, what);
    if (!at) {
        fail_msg("the script has no \"%s\"", what);
        return;
    }
    at += strlen(what);
    for (int i = 0; i < count; i++) {
        char *end;
        at += strspn(at, " [:,");
        out[i] = strtod(at, &end);
        assert_true(end != at);
        at = end;
    }
    *from = at;
}

#endif
