/* Interface of study kinds: functions that execute runs. sim/studies itself depends on no
 * subsystem. */
#ifndef BST_STUDIES_KIND_H
#define BST_STUDIES_KIND_H

#include <stdio.h>

#include "sim/studies/study.h"

typedef enum bst_study_metric_kind {
    BST_METRIC_VALUE, /* a number; NAN: none */
    BST_METRIC_FLAG,  /* 1 or 0; over runs it is a rate */
    BST_METRIC_KEY, /* of a series: rows with equal keys are combined over the runs of a setting */
    BST_METRIC_TRIALS, /* of a series: summed over runs */
    BST_METRIC_HITS,   /* of a series: successes among the previous trials; together a rate */
} bst_study_metric_kind;

typedef struct bst_study_metric {
    const char *name, *unit, *doc;
    int kind; /* bst_study_metric_kind */
} bst_study_metric;

/* maximum; each kind asserts its own numbers */
enum { BST_STUDY_METRICS = 48, BST_SERIES_COLUMNS = 40 };

struct bst_results;

/* A run ready for execution. */
typedef struct bst_study_run {
    const bst_study *study;
    bst_study_place place;
    bst_json *scenario;
    const struct cJSON *settings; /* settings of the kind */
    const char *folder;           /* folder for files of the run: "STUDY/runs/000017"; NULL: none */
    const char *out;              /* the study's folder */
    double most_s;                /* > 0: trial run, which may end after this time */
} bst_study_run;

/* Result of a run. */
typedef struct bst_study_result {
    double metrics[BST_STUDY_METRICS];
    double *series; /* [rows][series_count of the kind]; freed by the caller of run */
    int rows;
    double cpu_s;  /* processor time of the run on all threads; set by the caller of run */
    double left_s; /* of a run ended by most_s: estimated remaining time */
} bst_study_result;

/* Resources of a worker. */
typedef struct bst_study_worker_place {
    int threads;        /* number of its own cores */
    const char *device; /* OpenCL device, as for bst_device_open; "": default. Valid for the
                           worker's life */
} bst_study_worker_place;

typedef struct bst_study_kind {
    const char *name; /* name in the study file */
    const bst_study_metric *metrics;
    int metric_count;
    const char *series_name; /* such as "curve"; NULL: none */
    const bst_study_metric *series;
    int series_count;
    void *user;
    /* Checks the documents of a run without starting it. `deep`: also opens the files that they
     * name. */
    bst_status (*check)(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep);
    /* Creates the state that a worker keeps between runs. */
    bst_status (*open)(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                       void **worker);
    void (*close)(void *worker);
    /* Executes a run. BST_ERR_INTERRUPTED: stop requested. BST_ERR_IO, BST_ERR_MEMORY and
     * BST_ERR_DEVICE: it could not be executed on this machine; other errors are results of the
     * run. */
    bst_status (*run)(bst_ctx *ctx, void *worker, const bst_study_run *run, bst_study_result *out);
    /* Writes the scenario with all defaults to `scenario`, and the command to execute it to
     * `command`. */
    bst_status (*emit)(bst_ctx *ctx, void *user, const bst_study_run *run, FILE *scenario,
                       FILE *command);
    /* Checks that the files of a run in the study's folder agree with its row (metrics). NULL: runs
     * leave no files. */
    bool (*intact)(void *user, const bst_study_run *run, const double *metrics);
    /* Called after the last run, before the tables are published: writes additional files. NULL:
     * none. */
    bst_status (*finish)(bst_ctx *ctx, void *user, const struct bst_results *results,
                         const char *out);
    /* True if the user requested a stop. */
    bool (*stop_requested)(void *user);
} bst_study_kind;

/* Index of a metric by name; -1: none. */
int bst_kind_metric(const bst_study_kind *kind, const char *name);

/* Checks a study before anything runs: names of metrics, each value at the ends of ranges and in
 * lists, and the runs themselves (all, or a thousand). `kind`: that of the study. The message
 * begins with the varied parameter. */
bst_status bst_study_check(bst_ctx *ctx, const bst_study *study,
                           const bst_study_kind *kind) BST_MUST_CHECK;

#endif
