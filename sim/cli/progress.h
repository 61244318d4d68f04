/* How far a long command is: a line on the terminal, or lines in a file. */
#ifndef BST_CLI_PROGRESS_H
#define BST_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct bst_progress {
    const char *what;       /* "frames.mp4" */
    const char *unit;       /* "frames" */
    int64_t total;          /* 0: not known */
    bool off;               /* set by the caller: show nothing */
    bool terminal;          /* the standard error is one */
    bool shown;             /* a line is there to be removed */
    double started, newest; /* wall seconds */
} bst_progress;

/* Nothing is shown for commands shorter than two seconds. Where the standard error is no terminal,
 * a line is added every ten seconds. */
void bst_progress_start(bst_progress *progress, const char *what, const char *unit, int64_t total);

/* Prints the progress to stderr if enough time has passed since the last line.
 *
 * Given:     done  units done so far */
void bst_progress_update(bst_progress *progress, int64_t done);
/* Removes the line. */
void bst_progress_end(bst_progress *progress);

#endif
