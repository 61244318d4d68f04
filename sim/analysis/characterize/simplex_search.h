/* Minimum of a function of few parameters without derivatives. */
#ifndef BST_ANALYSIS_CHARACTERIZE_SIMPLEX_SEARCH_H
#define BST_ANALYSIS_CHARACTERIZE_SIMPLEX_SEARCH_H

enum { BST_SIMPLEX_PARAMETERS = 6 };

/* Finds a local minimum.
 *
 * Given:     cost   function of the parameters; not NAN
 *            count  number of parameters, 1 to BST_SIMPLEX_PARAMETERS
 *            x      start
 *            step   first step of each parameter
 *            turns  most evaluations; fewer if the costs differ by less than 1e-6 of the least
 * Returned:  cost of the minimum; x  its parameters
 * Reference: Nelder and Mead 1965, Computer Journal 7, 308 */
double bst_simplex_search(double (*cost)(const void *user, const double *x), const void *user,
                          int count, double *x, const double *step, int turns);

#endif
