/* Filter consistency: NEES and NIS of an ensemble of runs against chi-square bounds. */
#ifndef BST_EVAL_CONSISTENCY_H
#define BST_EVAL_CONSISTENCY_H

/* Chi-square distribution function with `dof` > 0 degrees of freedom at x: the regularised
 * incomplete gamma function P(dof/2, x/2), by series or continued fraction (Abramowitz and Stegun
 * 6.5.29, 6.5.31); relative error about 1e-14. */
double bst_eval_chi2_cdf(double x, double dof);

/* Chi-square quantile: x with bst_eval_chi2_cdf(x, dof) = probability, 0 < probability < 1; else
 * NAN. */
double bst_eval_chi2_quantile(double probability, double dof);

typedef struct bst_consistency {
    int runs, steps;
    int steps_judged;     /* with a value in at least one run */
    double mean_over_dof; /* 1 if the covariances are correct */
    double inside;        /* fraction of steps whose mean over the runs is within the bounds */
    double below, above;  /* fractions outside on either side */
} bst_consistency;

/* Tests runs x steps values (values[run * steps + step]; NAN: no value), each chi-square with `dof`
 * degrees of freedom if the filter is consistent: NEES with the dimension of the state, NIS with
 * that of the measurement. The mean over the n runs of a step is compared with two-sided
 * `confidence` bounds of chi-square with n dof degrees of freedom, divided by n (Bar-Shalom, Li and
 * Kirubarajan 2001, section 5.4). */
void bst_consistency_check(const double *values, int runs, int steps, int dof, double confidence,
                           bst_consistency *out);

#endif
