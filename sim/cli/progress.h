/* Progress display of a long command: one line on a terminal, or several in a file. */
#ifndef BST_CLI_PROGRESS_H
#define BST_CLI_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct bst_progress {
    const char *what;       /* "frames.mp4" */
    const char *unit;       /* "frames" */
    int64_t total;          /* 0: unknown */
    bool off;               /* set by the caller: no display */
    bool terminal;          /* standard error is a terminal */
    bool shown;             /* a line is displayed */
    double started, newest; /* wall seconds */
} bst_progress;

/* Starts a progress display. Nothing is shown during the first two seconds. If standard error is no
 * terminal, a line is added every ten seconds. */
void bst_progress_start(bst_progress *progress, const char *what, const char *unit, int64_t total);

/* Prints the progress to stderr if enough time has passed since the last line.
 *
 * Given:     done  units done so far */
void bst_progress_update(bst_progress *progress, int64_t done);
/* Removes the progress line. */
void bst_progress_end(bst_progress *progress);

#endif
