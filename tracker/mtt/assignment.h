/* Optimal measurement-to-track assignment: rows (tracks) to columns (detections) over sparse
 * candidates. A row may stay unassigned at its own cost. */
#ifndef BST_TRACKER_MTT_ASSIGNMENT_H
#define BST_TRACKER_MTT_ASSIGNMENT_H

#include "boresight/status.h"

typedef struct bst_assignment bst_assignment; /* work space */

/* Creates a work space for at most `rows` rows and `columns` columns.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_assignment_free */
bst_status bst_assignment_create(bst_ctx *ctx, int rows, int columns,
                                 bst_assignment **out) BST_MUST_CHECK;
/* Frees a work space; NULL is allowed. */
void bst_assignment_free(bst_assignment *work);

/* A sparse assignment problem. Row i has candidates first[i] .. first[i + 1] - 1 in edge_columns[]
 * and costs[] (finite; a column at most once per row). Leaving it unassigned costs miss[i]. */
typedef struct bst_assignment_problem {
    int rows, columns;
    const int *first, *edge_columns;
    const double *costs, *miss;
} bst_assignment_problem;

/* Minimises the total cost of an assignment by successive shortest augmenting paths with dual
 * variables. It does not allocate.
 *
 * Returned:  column_of_row  assigned column of each row, -1: none
 * Reference: Jonker and Volgenant 1987 */
void bst_assignment_solve(bst_assignment *work, const bst_assignment_problem *problem,
                          int *column_of_row);

#endif
