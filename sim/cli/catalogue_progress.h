/* Progress of fetching and importing a star catalogue, as a line on the terminal. */
#ifndef BST_CLI_CATALOGUE_PROGRESS_H
#define BST_CLI_CATALOGUE_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>

typedef struct bst_catalogue_progress {
    const char *stage;         /* that is shown; NULL before the first */
    double started_s, shown_s; /* wall time: start of the stage, last change of the line */
    bool on_terminal;          /* the standard error is a terminal; nothing is shown otherwise */
} bst_catalogue_progress;

/* Progress before the first stage. */
bst_catalogue_progress bst_catalogue_progress_start(void);

/* Writes the text of the line: stage, share done, rate and time left; only the elapsed time while
 * nothing is done yet or the total is unknown (0). Rates are in MB/s for the stage "downloading",
 * in million stars/s for others.
 *
 * Given:     done, total  bytes or stars
 *            elapsed_s    since the start of the stage
 *            bytes        size of `text` */
void bst_catalogue_progress_text(const char *stage, long long done, long long total,
                                 double elapsed_s, char *text, size_t bytes);

/* Shows the progress, up to five times a second. As bst_star_progress_fn.
 *
 * Given:     user  a bst_catalogue_progress */
void bst_catalogue_progress_show(void *user, const char *stage, long long done, long long total);

/* Ends the line if one is shown. */
void bst_catalogue_progress_end(const bst_catalogue_progress *progress);

#endif
