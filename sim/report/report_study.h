/* A study as `boresight report` shows it: axes, metrics, settings and charts. */
#ifndef BST_REPORT_REPORT_STUDY_H
#define BST_REPORT_REPORT_STUDY_H

#include "sim/report/report.h"

enum { BST_STUDY_LEVELS = 64, BST_STUDY_WORD = 64 };

/* A varied parameter. Values that are no numbers are indices into `words`. */
typedef struct bst_report_study_axis_view {
    char name[BST_STUDY_WORD], path[256], design[32];
    bool swept; /* else a dispersion or a population */
    bool population;
    bool is_text;     /* values are indices into `words` */
    bool logarithmic; /* logarithmic axis: positive values over more than a decade, evenly spaced in
                         logarithm */
    char (*words)[BST_STUDY_WORD];
    int word_count;
    double *of_setting; /* [settings]; NULL for a dispersion */
    double *of_run;     /* [runs] */
    double *levels;     /* distinct values over the settings, ascending; at most BST_STUDY_LEVELS */
    int level_count;    /* BST_STUDY_LEVELS + 1: more */
} bst_report_study_axis_view;

/* A metric of the runs. */
typedef struct bst_report_study_metric_view {
    char name[BST_STUDY_WORD], unit[32], doc[256];
    bool rate;                 /* 1 or 0 in each run */
    bool varies;               /* not equal in all runs */
    double *of_run;            /* [runs]; NAN: none */
    double *mean, *low, *high; /* [settings] with 95 % interval (NAN for one run) */
} bst_report_study_metric_view;

typedef struct bst_report_study_view {
    bst_run_reader *tables;
    char name[128], kind[32], seed[32], version[32], digest[32];
    int64_t expected_runs, failed, replicates;
    int64_t settings, runs; /* number of table rows */
    int64_t read;           /* rows read so far */
    int64_t *setting_of_run, *run_numbers;
    bool *done; /* [runs] */
    bst_report_study_axis_view *axes;
    int axis_count;
    bst_report_study_metric_view *metrics;
    int metric_count;
    bst_report_study_metric_view wall, /* wall time of the runs; not a metric, as it is no result */
        cpu; /* processor time of the runs; absent in tables of earlier versions */
} bst_report_study_view;

/* Reads the tables of a study. BST_ERR_FORMAT: no study, or damaged. Free with
 * bst_report_study_view_free, also after an error. */
bst_status bst_report_study_view_read(bst_ctx *ctx, bst_run_reader *tables,
                                      bst_report_study_view *out) BST_MUST_CHECK;
/* Frees the arrays of a view; the struct itself belongs to the caller. */
void bst_report_study_view_free(bst_report_study_view *view);

/* Text of a value of an axis. */
const char *bst_report_study_word(const bst_report_study_axis_view *axis, double value,
                                  char text[32]);

/* Selects up to `room` of the most significant metrics that vary between runs; returns their
 * number. */
int bst_report_study_key_metrics(const bst_report_study_view *view, int *metrics, int room);
/* Label of a metric: its column name, with the unit if the name does not end with it:
 * "loss_db_pd50, dB", "pointing_rms_px". */
const char *bst_report_study_label(const bst_report_study_metric_view *metric, char text[128]);

/* ---- charts (report_study_plots.c, report_study_curves.c) ---- */

/* Draws metrics against each swept axis. */
void bst_report_study_plot_axes(FILE *out, const bst_report_study_view *view);
/* Draws histograms of metrics over the runs. */
void bst_report_study_plot_histograms(FILE *out, const bst_report_study_view *view);
/* Draws the curves of a series, such as detection against SNR, for each setting; nothing without a
 * series. */
bst_status bst_report_study_plot_curves(bst_ctx *ctx, FILE *out,
                                        const bst_report_study_view *view) BST_MUST_CHECK;
/* Draws the ranked effects of the axes for designs one_at_a_time and morris; nothing for others. */
bst_status bst_report_study_plot_sensitivity(bst_ctx *ctx, FILE *out,
                                             const bst_report_study_view *view) BST_MUST_CHECK;

/* Writes the HTML page of a study. */
bst_status bst_report_study(bst_ctx *ctx, bst_run_reader *tables, FILE *out) BST_MUST_CHECK;

#endif
