/* Optimal assignment of rows (tracks) to columns (detections) over sparse candidates, where every
 * row may also stay unassigned at a price of its own. */
#ifndef BST_TRACKER_MTT_ASSIGNMENT_H
#define BST_TRACKER_MTT_ASSIGNMENT_H

#include "boresight/status.h"

typedef struct bst_assignment bst_assignment; /* work space */

/* Work space for at most `rows` rows and `columns` columns. The caller frees it. */
bst_status bst_assignment_create(bst_ctx *ctx, int rows, int columns,
                                 bst_assignment **out) BST_MUST_CHECK;
/* Frees a work space; NULL is allowed. */
void bst_assignment_free(bst_assignment *work);

/* Row i has candidates first[i] .. first[i + 1] - 1 with edge_columns[] and costs[] (any finite
 * numbers; a column at most once per row); staying unassigned costs miss[i]. */
typedef struct bst_assignment_problem {
    int rows, columns;
    const int *first, *edge_columns;
    const double *costs, *miss;
} bst_assignment_problem;

/* Minimises the sum of costs. Writes the column of each row, or -1, to column_of_row. Within the
 * work space's size; no allocation.
 * Successive shortest augmenting paths with dual variables (Jonker and Volgenant 1987). */
void bst_assignment_solve(bst_assignment *work, const bst_assignment_problem *problem,
                          int *column_of_row);

#endif
