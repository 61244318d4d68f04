/* What the program hands in to have runs executed: studies themselves name no subsystem. */
#ifndef BST_STUDIES_KIND_H
#define BST_STUDIES_KIND_H

#include <stdio.h>

#include "sim/studies/study.h"

typedef enum bst_study_metric_kind {
    BST_METRIC_VALUE,  /* a number; NAN: there is none */
    BST_METRIC_FLAG,   /* 1 or 0: over runs it is a rate */
    BST_METRIC_KEY,    /* of a series: rows of one key belong together over the runs of a setting */
    BST_METRIC_TRIALS, /* of a series: summed over runs */
    BST_METRIC_HITS,   /* of a series: of the trials before it; together a rate */
} bst_study_metric_kind;

typedef struct bst_study_metric {
    const char *name, *unit, *doc;
    int kind; /* bst_study_metric_kind */
} bst_study_metric;

/* At most; each kind asserts that its own fit. */
enum { BST_STUDY_METRICS = 48, BST_SERIES_COLUMNS = 40 };

struct bst_results;

/* One run, ready to be executed. */
typedef struct bst_study_run {
    const bst_study *study;
    bst_study_place place;
    bst_json *scenario;
    const struct cJSON *settings; /* of the kind */
    const char *folder;           /* where it may leave files: "STUDY/runs/000017"; NULL: nowhere */
    const char *out;              /* the study's folder */
    double most_s; /* > 0: only to learn how long it takes; it may end after so much time */
} bst_study_run;

/* What it gave. */
typedef struct bst_study_result {
    double metrics[BST_STUDY_METRICS];
    double *series; /* [rows][series_count of the kind]; freed by who called run */
    int rows;
    double cpu_s;  /* processor time of the run on all threads; filled in by the caller of run */
    double left_s; /* of a run that ended after most_s: what the rest of it would take */
} bst_study_result;

/* Where a worker is to work. */
typedef struct bst_study_worker_place {
    int threads;        /* cores that are its own */
    const char *device; /* OpenCL device, as bst_device_open takes it; "": the default. Lent for the
                           worker's life */
} bst_study_worker_place;

typedef struct bst_study_kind {
    const char *name; /* as in the study file */
    const bst_study_metric *metrics;
    int metric_count;
    const char *series_name; /* "curve"; NULL: none */
    const bst_study_metric *series;
    int series_count;
    void *user;
    /* Whether a run's documents are right, as far as that can be said without starting it. `deep`:
     * also open the files that they name. */
    bst_status (*check)(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep);
    /* What a worker keeps from run to run. */
    bst_status (*open)(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                       void **worker);
    void (*close)(void *worker);
    /* Executes a run. BST_ERR_INTERRUPTED: it was asked to stop. BST_ERR_IO, BST_ERR_MEMORY and
     * BST_ERR_DEVICE say that it could not be executed here and now; all other errors are the run's
     * own, which it would have anywhere. */
    bst_status (*run)(bst_ctx *ctx, void *worker, const bst_study_run *run, bst_study_result *out);
    /* Writes the scenario with every default to `scenario` and the command that executes it by hand
     * to `command`. */
    bst_status (*emit)(bst_ctx *ctx, void *user, const bst_study_run *run, FILE *scenario,
                       FILE *command);
    /* Whether what a run left in the study's folder is still there as its row (metrics) says. NULL:
     * runs leave nothing that matters. */
    bool (*intact)(void *user, const bst_study_run *run, const double *metrics);
    /* After the last run, before the tables are put in their place: what belongs beside them. NULL:
     * nothing. */
    bst_status (*finish)(bst_ctx *ctx, void *user, const struct bst_results *results,
                         const char *out);
    /* Whether the user asked to stop. */
    bool (*stop_requested)(void *user);
} bst_study_kind;

/* Index of a metric, -1 when there is none of that name. */
int bst_kind_metric(const bst_study_kind *kind, const char *name);

/* Checks the study before anything runs: names of metrics; every value at the ends of ranges and of
 * lists, each by itself; the runs as they are, all or a thousand of them. `kind` is that of the
 * study. The message begins with what is varied. */
bst_status bst_study_check(bst_ctx *ctx, const bst_study *study,
                           const bst_study_kind *kind) BST_MUST_CHECK;

#endif
