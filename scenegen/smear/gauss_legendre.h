/* Gauss-Legendre quadrature on [0, 1] with one to four points. */
#ifndef BST_SCENEGEN_SMEAR_GAUSS_LEGENDRE_H
#define BST_SCENEGEN_SMEAR_GAUSS_LEGENDRE_H

enum { BST_SMEAR_GAUSS_MOST = 4 };

/* Places and weights by number of points less one (Abramowitz and Stegun, table 25.4): n points are
 * exact for the order 2 n - 1. */
static const double bst_smear_gauss_place[BST_SMEAR_GAUSS_MOST][BST_SMEAR_GAUSS_MOST] = {
    {0.5},
    {0.2113248654051871, 0.7886751345948129},
    {0.1127016653792583, 0.5, 0.8872983346207417},
    {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629}};
static const double bst_smear_gauss_weight[BST_SMEAR_GAUSS_MOST][BST_SMEAR_GAUSS_MOST] = {
    {1.0},
    {0.5, 0.5},
    {0.2777777777777778, 0.4444444444444444, 0.2777777777777778},
    {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693}};

#endif
