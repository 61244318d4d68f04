/* What the files of the smear quadrature share. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H
#define BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H

#include <stdbool.h>

#include "scenegen/smear/smear_quadrature.h"

/* A path that becomes nodes, and what is asked of them. */
typedef struct bst_smear_maker {
    const bst_smear_path_point *path;
    int count;
    double total;    /* duration */
    double variance; /* of the PSF, px^2 */
    double tolerance;
    bool widen;
    bst_smear_node_list *list;
    double widest;     /* px^2 */
    double wide_field; /* as in bst_smear_node_aim */
    double curvature;
    double pixel_part[3];
    double image_share; /* variance of the image per variance of the path, mean over the field */
    double most;        /* spread of the next group, px^2 */
    double limit;       /* of it */
} bst_smear_maker;

/* A group's moments about its mean: along the axis to the sixth order, and what lies across. */
typedef struct bst_smear_moments {
    double mean[3], axis[3];
    double covariance[3][3];
    double along[7]; /* E[x^k] */
    double bend[3];  /* E[y x^2], y the part across the axis */
    double drift;    /* E[x y^2] */
    double mixed;    /* E[x^2 y^2] */
    double lean[3];  /* E[y y^2] */
    double across;   /* E[y^2] */
} bst_smear_moments;

/* Weighted nodes in place of a group, and their error. */
typedef struct bst_smear_rule {
    int nodes;       /* 1 to 3 along the axis */
    double widening; /* px^2 */
    double pair[3];  /* half the distance of the pair that each node is split into */
    double node[3], weight[3];
    double bend[3];  /* shift across the axis per unit of `curve` */
    double curve[3]; /* second orthogonal polynomial at the nodes */
    double error;    /* all of it */
    double missed;   /* of it, what the quadrature misses of the last moment */
    double fixed;    /* of it, the wrong widening of images that move by less than the path */
} bst_smear_rule;

/* Direction of the largest eigenvalue of a symmetric matrix that is not negative. A tie gives some
 * direction between. */
void bst_smear_nodes_main_axis(double a[3][3], double axis[3]);

/* Fills a rule of n nodes, widened or split into pairs, and its error: what it misses of the image,
 * over the peak. Infinite where there is no such rule, or where its error is more than `limit`. */
void bst_smear_try_rule(const bst_smear_maker *m, const bst_smear_moments *g, int n, bool widen,
                        bool split, double limit, bst_smear_rule *r);

/* Replaces *best by the rule with the fewest nodes that is good enough, else the best of those of
 * three, and of those whose error is not beyond `limit`. */
void bst_smear_choose_rule(const bst_smear_maker *m, const bst_smear_moments *g, double limit,
                           bst_smear_rule *best);

#endif
