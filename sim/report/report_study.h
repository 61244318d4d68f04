/* A study as boresight report shows it. */
#ifndef BST_REPORT_REPORT_STUDY_H
#define BST_REPORT_REPORT_STUDY_H

#include "sim/report/report.h"

enum { BST_STUDY_LEVELS = 64, BST_STUDY_WORD = 64 };

/* Something that was varied. Values that are no numbers are told by their number in `words`. */
typedef struct bst_report_study_axis_view {
    char name[BST_STUDY_WORD], path[256], design[32];
    bool swept; /* else a dispersion or a population */
    bool population;
    bool is_text;     /* values are numbers of `words` */
    bool logarithmic; /* drawn so: positive numbers over more than a decade, evenly in logarithms */
    char (*words)[BST_STUDY_WORD];
    int word_count;
    double *of_setting; /* [settings]; NULL for a dispersion */
    double *of_run;     /* [runs] */
    double *levels;  /* its distinct values over the settings, rising; at most BST_STUDY_LEVELS */
    int level_count; /* BST_STUDY_LEVELS + 1: more than that */
} bst_report_study_axis_view;

/* A figure of a run. */
typedef struct bst_report_study_metric_view {
    char name[BST_STUDY_WORD], unit[32], doc[256];
    bool rate;                 /* 1 or 0 in each run */
    bool varies;               /* runs differ in it */
    double *of_run;            /* [runs]; NAN: none */
    double *mean, *low, *high; /* [settings], with its 95 % interval (NAN: of one run) */
} bst_report_study_metric_view;

typedef struct bst_report_study_view {
    bst_run_reader *tables;
    char name[128], kind[32], seed[32], version[32], digest[32];
    int64_t expected_runs, failed, replicates;
    int64_t settings, runs; /* rows of the tables */
    int64_t read;           /* of the runs so far */
    int64_t *setting_of_run, *run_numbers;
    bool *done; /* [runs] */
    bst_report_study_axis_view *axes;
    int axis_count;
    bst_report_study_metric_view *metrics;
    int metric_count;
    bst_report_study_metric_view
        wall, /* wall time of the runs: not among the metrics, as it is no result */
        cpu;  /* their processor time; tables of an earlier version have none: no values */
} bst_report_study_view;

/* Reads the tables of a study. BST_ERR_FORMAT when they are not a study's, or damaged. Free with
 * bst_report_study_view_free, also after an error. */
bst_status bst_report_study_view_read(bst_ctx *ctx, bst_run_reader *tables,
                                      bst_report_study_view *out) BST_MUST_CHECK;
/* Frees the arrays of a view; the struct itself belongs to the caller. */
void bst_report_study_view_free(bst_report_study_view *view);

/* Text of an axis' value. */
const char *bst_report_study_word(const bst_report_study_axis_view *axis, double value,
                                  char text[32]);

/* Up to `room` metrics that say most, of those in which runs differ: their numbers. */
int bst_report_study_key_metrics(const bst_report_study_view *view, int *metrics, int room);
/* The metric's name as tables have it, with the unit where that does not end it: "loss_db_pd50,
 * dB", "pointing_rms_px". */
const char *bst_report_study_label(const bst_report_study_metric_view *metric, char text[128]);

/* ---- charts (report_study_plots.c, report_study_curves.c) ---- */

/* Metrics against each axis that was swept. */
void bst_report_study_plot_axes(FILE *out, const bst_report_study_view *view);
/* Histograms of metrics over the runs. */
void bst_report_study_plot_histograms(FILE *out, const bst_report_study_view *view);
/* Curves of a series, such as detection against SNR, of each setting; nothing without one. */
bst_status bst_report_study_plot_curves(bst_ctx *ctx, FILE *out,
                                        const bst_report_study_view *view) BST_MUST_CHECK;
/* Ranked effects of the axes, of designs one_at_a_time and morris; nothing without them. */
bst_status bst_report_study_plot_sensitivity(bst_ctx *ctx, FILE *out,
                                             const bst_report_study_view *view) BST_MUST_CHECK;

/* The whole page of a study. `folder` is its name. */
bst_status bst_report_study(bst_ctx *ctx, bst_run_reader *tables, FILE *out) BST_MUST_CHECK;

#endif
