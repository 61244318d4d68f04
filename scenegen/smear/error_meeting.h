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

/* Work space of a renderer. */
typedef struct bst_error_meeting bst_error_meeting;

/* Predicted error in any pixel: at most that of the budget, which it is with many sources.
 *
 * Given:     *space  NULL before the first call; it grows with the frames
 * Ownership: free *space with bst_error_meeting_free */
double bst_error_meeting_sigma(bst_error_meeting **space, bst_error_budget *budget,
                               const bst_error_meeting_paths *paths);
void bst_error_meeting_free(bst_error_meeting *space); /* NULL allowed */

#endif
