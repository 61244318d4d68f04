/* Zernike polynomials in Noll's order and normalisation (Noll 1976, J. Opt. Soc. Am. 66, 207). */
#ifndef BST_OPTICS_ZERNIKE_H
#define BST_OPTICS_ZERNIKE_H

#include "boresight/psf_config.h"

/* Highest radial degree, that of term 37. */
enum { BST_ZERNIKE_DEGREE = 8 };

/* A polynomial in x and y; [p][q]: coefficient of x^p y^q. */
typedef struct bst_zernike_polynomial {
    double c[BST_ZERNIKE_DEGREE + 1][BST_ZERNIKE_DEGREE + 1];
} bst_zernike_polynomial;

/* Radial degree and azimuthal order of Noll's term j, 1 to 37; m negative for the sine. */
void bst_zernike_noll(int j, int *n, int *m);

/* Adds `amount` times term j, of unit mean square over the unit disc, to the polynomial. */
void bst_zernike_add(bst_zernike_polynomial *sum, int j, double amount);

/* Value of a polynomial at (x, y). */
double bst_zernike_at(const bst_zernike_polynomial *polynomial, double x, double y);

#endif
