/* What a run lost: detections, sources of the truth and tracks beyond the room for them, frames,
 * and what else it counted. One wording for the end of `run`, the manifest and the report. */
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

/* A line for each kind of loss of a sensor, such as "cut to imgproc's capacity: 5120 detections in
 * 12 of 300 frames". */
void bst_run_losses_report(const bst_run_losses *losses, bst_run_loss_fn fn, void *user);
/* A line for a counter of the engine: none for a count of 0, for what is no loss, and for those
 * that bst_run_losses_report has. */
void bst_run_losses_report_counter(const char *name, int64_t count, bst_run_loss_fn fn, void *user);

/* What prints such lines on the standard output, under a heading "losses" before the first. */
typedef struct bst_run_losses_printer {
    const char *sensor; /* before each line; NULL: none */
    bool begun;
} bst_run_losses_printer;
/* A bst_run_loss_fn; `user` is a bst_run_losses_printer. */
void bst_run_losses_print(void *user, bst_run_severity severity, const char *text);

/* Adds the losses above 0 to the object `losses` of a manifest under the sensor's name. */
void bst_run_losses_add(struct cJSON *manifest, const char *sensor, const bst_run_losses *losses);
/* The sensor's losses as the manifest has them, else those of the run's tables; `index` is its row
 * of the table sensors. */
void bst_run_losses_read(const bst_run_reader *run, const char *sensor, int64_t index,
                         bst_run_losses *out);

#endif
