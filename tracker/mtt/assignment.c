#include "tracker/mtt/assignment.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

struct bst_assignment {
    int max_rows, max_columns;
    double *row_dual;
    double *column_dual;
    /* path cost of a detection column from the track row being assigned; INFINITY: not reached */
    double *distance;
    int *row_of_column; /* assigned row; -1: free */
    int *from_row;      /* preceding row on the column's shortest path */
    bool *settled;      /* the column's distance is final */
    int *touched;       /* columns reached in this search */
};

bst_status bst_assignment_create(bst_ctx *ctx, int rows, int columns, bst_assignment **out) {
    *out = NULL;
    if (rows < 0 || columns < 0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "assignment: negative size %d x %d", rows, columns);
    }
    bst_assignment *w = calloc(1, sizeof *w);
    if (!w) {
        return bst_fail(ctx, BST_ERR_MEMORY, "assignment: out of memory");
    }
    size_t nr = (size_t)rows + 1, nc = (size_t)columns + 1;
    w->max_rows = rows;
    w->max_columns = columns;
    w->row_dual = calloc(nr, sizeof *w->row_dual);
    w->column_dual = calloc(nc, sizeof *w->column_dual);
    w->distance = calloc(nc, sizeof *w->distance);
    w->row_of_column = calloc(nc, sizeof *w->row_of_column);
    w->from_row = calloc(nc, sizeof *w->from_row);
    w->settled = calloc(nc, sizeof *w->settled);
    w->touched = calloc(nc, sizeof *w->touched);
    if (!w->row_dual || !w->column_dual || !w->distance || !w->row_of_column || !w->from_row ||
        !w->settled || !w->touched) {
        bst_assignment_free(w);
        return bst_fail(ctx, BST_ERR_MEMORY, "assignment: out of memory for %d x %d", rows,
                        columns);
    }
    *out = w;
    return BST_OK;
}

void bst_assignment_free(bst_assignment *w) {
    if (!w) {
        return;
    }
    free(w->row_dual);
    free(w->column_dual);
    free(w->distance);
    free(w->row_of_column);
    free(w->from_row);
    free(w->settled);
    free(w->touched);
    free(w);
}

/* Assigns track row `root`: shortest augmenting path to a free detection column, or to a row that
 * becomes unassigned. */
static void augment_from_row(bst_assignment *w, int root, const bst_assignment_problem *p,
                             int *column_of_row) {
    const int *first = p->first, *columns = p->edge_columns;
    const double *costs = p->costs, *miss = p->miss;
    int touched = 0, row = root, end_row = -1, end_column = -1;
    double row_distance = 0.0, best_miss = INFINITY;
    for (;;) {
        double leave = row_distance + miss[row] - w->row_dual[row];
        if (leave < best_miss) {
            best_miss = leave;
            end_row = row;
        }
        for (int e = first[row]; e < first[row + 1]; e++) {
            int c = columns[e];
            double d = row_distance + costs[e] - w->row_dual[row] - w->column_dual[c];
            if (isinf(w->distance[c])) {
                w->touched[touched++] = c;
            }
            if (!w->settled[c] && d < w->distance[c]) {
                w->distance[c] = d;
                w->from_row[c] = row;
            }
        }
        int next = -1;
        double nearest = best_miss;
        for (int t = 0; t < touched; t++) {
            int c = w->touched[t];
            if (!w->settled[c] && w->distance[c] < nearest) {
                nearest = w->distance[c];
                next = c;
            }
        }
        if (next < 0) {
            break;
        }
        w->settled[next] = true;
        if (w->row_of_column[next] < 0) {
            end_column = next;
            break;
        }
        row = w->row_of_column[next];
        row_distance = w->distance[next];
    }
    double total = end_column >= 0 ? w->distance[end_column] : best_miss;
    w->row_dual[root] += total;
    for (int t = 0; t < touched; t++) {
        int c = w->touched[t];
        if (w->settled[c] && w->distance[c] <= total) {
            w->column_dual[c] -= total - w->distance[c];
            if (w->row_of_column[c] >= 0) {
                w->row_dual[w->row_of_column[c]] += total - w->distance[c];
            }
        }
    }
    int c = end_column;
    if (c < 0) {
        c = column_of_row[end_row];
        column_of_row[end_row] = -1;
    }
    while (c >= 0) {
        row = w->from_row[c];
        int previous = column_of_row[row];
        column_of_row[row] = c;
        w->row_of_column[c] = row;
        c = row == root ? -1 : previous;
    }
    for (int t = 0; t < touched; t++) {
        w->distance[w->touched[t]] = INFINITY;
        w->settled[w->touched[t]] = false;
    }
}

void bst_assignment_solve(bst_assignment *w, const bst_assignment_problem *p, int *column_of_row) {
    for (int c = 0; c < p->columns; c++) {
        w->column_dual[c] = 0.0;
        w->distance[c] = INFINITY;
        w->row_of_column[c] = -1;
        w->settled[c] = false;
    }
    for (int i = 0; i < p->rows; i++) {
        /* the smallest reduced cost of a new row must not be negative */
        double least = p->miss[i];
        for (int e = p->first[i]; e < p->first[i + 1]; e++) {
            least = fmin(least, p->costs[e] - w->column_dual[p->edge_columns[e]]);
        }
        w->row_dual[i] = least;
        column_of_row[i] = -1;
        augment_from_row(w, i, p, column_of_row);
    }
}
