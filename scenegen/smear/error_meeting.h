/* Predicted error of a frame of few sources, by where their images meet.
 *
 * The error budget takes all sources within one box for overlapping, as long and wide as their
 * motion: streaks side by side and arcs about one centre are within it and share no pixel. With few
 * sources the distance of each two paths is known from their nodes. */
#ifndef BST_SCENEGEN_SMEAR_ERROR_MEETING_H
#define BST_SCENEGEN_SMEAR_ERROR_MEETING_H

#include "scenegen/kernels/scene_shared.h"
#include "scenegen/smear/error_budget.h"

/* Paths of a budget's sources: nodes in the frame's table (bst_smear_table). */
typedef struct bst_error_meeting_paths {
    const bst_kernel_source_record *sources; /* in the order in which they were added */
    const float *table;
    int binning;
    bool gaussian; /* the PSF, whose errors fall faster than those of others */
} bst_error_meeting_paths;

/* Predicted error in any pixel: at most that of the budget, which it is with many sources. */
double bst_error_meeting_sigma(bst_error_budget *budget, const bst_error_meeting_paths *paths);

#endif
