/* Which axes matter: ranked tables of the designs one_at_a_time and morris. */
#ifndef BST_STUDIES_SENSITIVITY_H
#define BST_STUDIES_SENSITIVITY_H

#include "sim/studies/results.h"

/* What one axis does to one figure, over its whole range. */
typedef struct bst_sensitivity {
    int axis;
    int64_t count;      /* effects that it was worked out from */
    double effect;      /* morris: mean of their magnitudes (mu*, Campolongo, Cariboni and Saltelli
                           2007, Environ. Model. Softw. 22, 1509); one_at_a_time: greatest less least
                           mean of the settings, that without a change among them */
    double error;       /* standard error of `effect`; NAN for fewer than two */
    double mean_effect; /* morris: their mean (mu, Morris 1991); one_at_a_time: last value's less
                           first value's */
    double spread;      /* morris: their standard deviation (sigma): curvature or interaction */
} bst_sensitivity;

/* Figures of speed, in place of a metric. */
enum { BST_SPEED_WALL = -1, BST_SPEED_CPU = -2 };

/* Of a figure over the axes of a factor of one of the two designs: out[factor->axis_count], the
 * greatest effect first, those without any last. `metric`: of the kind, or one of speed. A
 * setting's value is the mean of its runs that have one, of speed the least; where other sweeps
 * combine with the design, effects of all their combinations are taken together. */
void bst_sensitivity_of(const bst_results *results, int factor, int metric, bst_sensitivity *out);

#endif
