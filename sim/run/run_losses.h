/* Losses of a run: detections, truth items and tracks beyond capacity, lost frames, and counters.
 * The same text is used by `run`, manifest and report. */
#ifndef BST_RUN_RUN_LOSSES_H
#define BST_RUN_RUN_LOSSES_H

#include "sim/eval/run_metrics.h"
#include "sim/io/run_reader.h"

struct cJSON;

typedef enum bst_run_severity {
    BST_SEVERITY_PROBLEM,
    BST_SEVERITY_WARNING,
    BST_SEVERITY_NOTE
} bst_run_severity;

typedef void (*bst_run_loss_fn)(void *user, bst_run_severity severity, const char *text);

/* Reports a line for each kind of loss of a sensor, such as "cut to imgproc's capacity: 5120
 * detections in 12 of 300 frames". */
void bst_run_losses_report(const bst_run_losses *losses, bst_run_loss_fn fn, void *user);
/* Reports a line for a counter of the engine; none for 0, for harmless counters, and for those in
 * bst_run_losses_report. */
void bst_run_losses_report_counter(const char *name, int64_t count, bst_run_loss_fn fn, void *user);

/* Prints losses to standard output, with a heading "losses" before the first. */
typedef struct bst_run_losses_printer {
    const char *sensor; /* prefix of each line; NULL: none */
    bool begun;
} bst_run_losses_printer;
/* A bst_run_loss_fn; `user` is a bst_run_losses_printer. */
void bst_run_losses_print(void *user, bst_run_severity severity, const char *text);

/* Adds the non-zero losses of a sensor to the object `losses` of a manifest. */
void bst_run_losses_add(struct cJSON *manifest, const char *sensor, const bst_run_losses *losses);
/* Reads the losses of a sensor from the manifest, else from the run's tables; `index`: its row of
 * the table sensors. */
void bst_run_losses_read(const bst_run_reader *run, const char *sensor, int64_t index,
                         bst_run_losses *out);

#endif
