/* Star counts: table of stars per square degree by galactic latitude, longitude and V. */
#ifndef BST_CATALOGUE_STAR_COUNTS_H
#define BST_CATALOGUE_STAR_COUNTS_H

#include "boresight/vec.h"

/* magnitudes of the table's nodes: V 6, 7, ... 26 */
enum { BST_COUNT_NODES = 21, BST_COUNT_FIRST_V = 6 };

/* Star counts in one direction: log10 of the stars per square degree brighter than V = 6, 7, ...
 * 26. Linear in V between nodes, extrapolated outside. */
typedef struct bst_star_counts {
    double log_n[BST_COUNT_NODES];
} bst_star_counts;

/* Converts an ICRS vector to galactic axes: x to the galactic centre, z to the north galactic pole
 * (ESA SP-1200, The Hipparcos and Tycho Catalogues, 1997, vol. 1, eq. 1.5.11). */
bst_vec3 bst_catalogue_galactic_from_icrs(bst_vec3 icrs);
/* ICRS coordinates of a vector given in galactic coordinates. */
bst_vec3 bst_catalogue_icrs_from_galactic(bst_vec3 galactic);

/* Star counts towards `icrs` (unit): bilinear in |b| and |l| between the table's nodes. From V 15
 * on the mean over longitude is the counts by latitude of Allen's Astrophysical Quantities
 * (data/star_counts_allen.csv); up to V 11 the level is Tycho-2's. Between these and over longitude
 * they follow the Galaxy model of Bahcall and Soneira, ApJS 44, 73 (1980), with a disc of dust; see
 * make_star_counts.py. */
void bst_star_counts_at(bst_vec3 icrs, bst_star_counts *out);

/* Stars per square degree brighter than v. */
double bst_star_counts_brighter(const bst_star_counts *counts, double v);

/* Light of the stars with v_from < V <= v_to, in units of one star of V = 0 per square degree:
 * integral of 10^(-0.4 V) dN. v_to may be INFINITY: the last slope continues (it must be below 0.4,
 * as everywhere in the table). */
double bst_star_counts_light(const bst_star_counts *counts, double v_from, double v_to);

#endif
