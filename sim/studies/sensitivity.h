/* Sensitivity analysis of a study: ranked effects of the axes for designs one_at_a_time and
 * morris. */
#ifndef BST_STUDIES_SENSITIVITY_H
#define BST_STUDIES_SENSITIVITY_H

#include "sim/studies/results.h"

/* Effect of one axis on one metric, over its whole range. */
typedef struct bst_sensitivity {
    int axis;
    int64_t count; /* number of elementary effects */
    double effect; /* morris: mean of their magnitudes (mu*, Campolongo, Cariboni and Saltelli 2007,
                      Environ. Model. Softw. 22, 1509); one_at_a_time: largest minus smallest mean
                      of the settings, including the unchanged one */
    double error;  /* standard error of `effect`; NAN for fewer than two */
    double mean_effect; /* morris: their mean (mu, Morris 1991); one_at_a_time: mean at the last
                           value minus mean at the first */
    double spread;      /* morris: their standard deviation (sigma): curvature or interaction */
} bst_sensitivity;

/* Speed figures, used in place of a metric. */
enum { BST_SPEED_WALL = -1, BST_SPEED_CPU = -2 };

/* Computes the effects of the axes of a factor (one_at_a_time or morris) on a metric:
 * out[factor->axis_count], largest first, those without effect last. `metric`: of the kind, or
 * speed. A setting's value is the mean of its runs, for speed the minimum. If other sweeps are
 * combined with the design, the effects of all combinations are pooled. */
void bst_sensitivity_of(const bst_results *results, int factor, int metric, bst_sensitivity *out);

#endif
