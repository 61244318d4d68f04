/* Are a filter's covariances true? Chi-square statistics of an ensemble of runs against their
 * bounds. */
#ifndef BST_EVAL_CONSISTENCY_H
#define BST_EVAL_CONSISTENCY_H

/* Probability that a chi-square variable with `dof` > 0 degrees of freedom is at most x: the
 * regularised incomplete gamma function P(dof/2, x/2), by series or continued fraction (Abramowitz
 * and Stegun 6.5.29, 6.5.31); relative error about 1e-14. */
double bst_eval_chi2_cdf(double x, double dof);

/* The x with bst_eval_chi2_cdf(x, dof) = probability, 0 < probability < 1; NAN beyond. */
double bst_eval_chi2_quantile(double probability, double dof);

typedef struct bst_consistency {
    int runs, steps;
    int steps_judged;     /* with a value in at least one run */
    double mean_over_dof; /* of all values; 1 when the covariances are true */
    double inside;       /* share of the judged steps whose mean over the runs lies within bounds */
    double below, above; /* shares on either side */
} bst_consistency;

/* Judges runs x steps values (values[run * steps + step]; NAN where a run has none at a step), each
 * chi-square with `dof` degrees of freedom when the filter is consistent: NEES with the state's
 * dimension, NIS with the measurement's. The mean over the n runs of a step is compared with the
 * two-sided `confidence` bounds of chi-square with n dof degrees of freedom over n (Bar-Shalom, Li
 * and Kirubarajan 2001, section 5.4). */
void bst_consistency_check(const double *values, int runs, int steps, int dof, double confidence,
                           bst_consistency *out);

#endif
