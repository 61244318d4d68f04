/* The tables of a study, for the page that compares its runs. */
#ifndef BST_VIEW_STUDY_VIEW_H
#define BST_VIEW_STUDY_VIEW_H

#include "view/routes.h"

/* Runs that are listed, and columns of their table. */
enum { BST_VIEW_STUDY_RUNS = 5000, BST_VIEW_STUDY_COLUMNS = 400 };

/* True if a folder has the tables of a study. */
bool bst_view_is_study(const char *folder);

/* The runs of the study: {name, kind, total, columns: [{name, unit, doc, role}], runs: [{run,
 * folder, cells: [...]}]}. role: "parameter" (of a sweep or dispersion), "figure" (of merit) or "".
 * folder: the run's folder was kept, so it can be opened. total: runs of the study, of which the
 * first BST_VIEW_STUDY_RUNS are listed. Cells are numbers, texts or null.
 *
 * Returned:  x->json
 * Errors:    BST_ERR_NOT_FOUND: no study is shown; those of bst_run_reader_open_study;
 *            BST_ERR_FORMAT: damaged tables */
bst_status bst_view_route_study(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* POST {"number": 17}: opens the folder of a run of the study; {"run": its number here}.
 *
 * Returned:  x->json
 * Errors:    BST_ERR_NOT_FOUND: no study is shown, or the run's folder was not kept; those of
 *            bst_view_subject_open */
bst_status bst_view_route_study_open(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* The open runs and those of runs/ that can be opened: {"open": [{number, name}], "runs": [name]}.
 *
 * Returned:  x->json
 * Errors:    BST_ERR_MEMORY */
bst_status bst_view_route_runs(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
