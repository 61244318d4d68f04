/* Declarations shared by the files of the smear quadrature. */
#ifndef BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H
#define BST_SCENEGEN_SMEAR_SMEAR_QUADRATURE_INTERNAL_H

#include <stdbool.h>

#include "scenegen/smear/smear_quadrature.h"

/* Moments of a group about its mean: along the axis to sixth order, and across. */
typedef struct bst_smear_moments {
    double mean[3], axis[3];
    double covariance[3][3];
    double along[7];  /* E[x^k] */
    double bend[3];   /* E[y x^2], y across the axis */
    double twist[3];  /* E[y x^3] */
    double drift;     /* E[x y^2] */
    double mixed;     /* E[x^2 y^2] */
    double lean[3];   /* E[y y^2] */
    double across;    /* E[y^2] */
    double furthest2; /* largest x^2 + y^2 of the points that the moments are from */
} bst_smear_moments;

/* Quadrature rule of a group: weighted nodes and error. */
typedef struct bst_smear_rule {
    int nodes;       /* 1 to 3 along the axis */
    double widening; /* px^2 */
    double pair[3];  /* half distance of the pair into which each node is split */
    double node[3], weight[3];
    double bend[3];  /* shift across the axis per unit of `curve` */
    double curve[3]; /* second orthogonal polynomial at the nodes */
    double error;    /* total */
    double missed;   /* part: missed highest moment */
    double kernel;   /* px^2: variance of the Peano kernel of the missed moment */
    double fixed;    /* part: wrong widening of images that move by less than the path */
} bst_smear_rule;

/* The group whose nodes were appended last. */
typedef struct bst_smear_last_group {
    double mean[3], axis[3];
    double length, speed; /* along its axis, px and px over its share of the exposure; 0: none */
    bool rests;           /* the path was at rest: one node without an error */
    double beside;        /* its predicted error beside others, over that alone; 0: none */
    int first, end;       /* its nodes in the list: the first, and the one after the last */
    bst_smear_rule rule;
    double velocity[3]; /* at its end, px over the path's time */
} bst_smear_last_group;

/* A path to be replaced by nodes, with its requirements. */
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
    double binned_variance, further_variance, pixel_part[3];
    const double (*direction_part)[3]; /* this and the next six as in bst_smear_node_aim */
    const double (*smooth_part)[BST_SMOOTH_STEPS][2];
    const double (*row_ripple)[BST_ROW_STEPS];
    const double (*light_part)[BST_LIGHT_STEPS];
    double most_per_px;
    bool turns;
    double unlike_rad;
    double image_share; /* image variance per path variance, mean over the field */
    double most;        /* spread of the next group, px^2 */
    double limit;       /* of `most` */
    bst_smear_last_group last;
} bst_smear_maker;

/* A node group: the path from time `from` (in segment `first`) to `to`. */
typedef struct bst_smear_group {
    int first;
    double from, to;
} bst_smear_group;

/* Spread of a group: trace of its covariance, px^2. */
static inline double bst_smear_spread(const bst_smear_moments *t) {
    return t->covariance[0][0] + t->covariance[1][1] + t->covariance[2][2];
}

/* Exact mean and covariance of a group; the other moments are 0. */
void bst_smear_second_moments(const bst_smear_maker *m, const bst_smear_group *g,
                              bst_smear_moments *out);
/* Sets the principal axis and the higher moments about it. */
void bst_smear_high_moments(const bst_smear_maker *m, const bst_smear_group *g,
                            bst_smear_moments *out);
/* E[x^7] and E[x^8] of a group along its axis. */
void bst_smear_kernel_moments(const bst_smear_maker *m, const bst_smear_group *g,
                              const bst_smear_moments *t, double high[2]);
/* Finds the path point where a group's speed changes most, if part of its way is a long and faint
 * tail. Errors of a group's quadrature lie along its whole way (Peano kernel), also far from its
 * light, where there is less noise than at its peak: an interval of a composite rule must not
 * contain a jump of the integrand.
 *
 * Returned:  segment that begins there; -1: there is no such tail */
int bst_smear_find_speed_change(const bst_smear_maker *m, const bst_smear_group *g,
                                const bst_smear_moments *t);

/* Direction of the largest eigenvalue of a symmetric positive semidefinite matrix; an intermediate
 * one for equal eigenvalues. */
void bst_smear_nodes_main_axis(double a[3][3], double axis[3]);

/* Sets a rule of n nodes, widened or split into pairs, and its error: of the image, relative to the
 * peak. INFINITY if there is no such rule or its error exceeds `limit`. */
void bst_smear_try_rule(const bst_smear_maker *m, const bst_smear_moments *g, int n, bool widen,
                        bool split, double limit, bst_smear_rule *r);

/* Peano kernels of a smaller variance, over that of the PSF, change an error by less than a tenth:
 * they are left out. */
#define BST_LEAST_KERNEL 0.02

/* Sets the variance of a rule's Peano kernel.
 *
 * Given:     high  E[x^7] and E[x^8] of the group */
void bst_smear_set_kernel(const bst_smear_moments *g, const double high[2], bst_smear_rule *r);

/* Largest variance of that kernel, px^2. */
double bst_smear_most_kernel(const bst_smear_rule *r);

/* Parts of a rule's errors that the PSF's derivatives along the group's axis leave of the bound,
 * which takes those of the direction in which the PSF is narrowest. */
typedef struct bst_smear_direction_parts {
    double second, higher, missed;      /* of left-out covariance, of higher moments, of `missed` */
    bool in_range[BST_NODE_DIRECTIONS]; /* directions in which the image may move */
} bst_smear_direction_parts;

/* Parts of the missed moment's error that remain if the image moves by 2^((k - BST_NODE_SCALES + 2)
 * / 2) of the path: below 1 for groups as long as the PSF is wide.
 *
 * Given:     along  directions in which the image may move
 * Returned:  part   in any direction
 *            one    of a group alone in those directions, at most `part` */
void bst_smear_missed_parts(const bst_smear_maker *m, const bst_smear_direction_parts *along,
                            const bst_smear_rule *r, double part[BST_NODE_SCALES],
                            double one[BST_NODE_SCALES]);

/* Parts of the errors of a rule of `nodes` nodes for a group with this axis: 1 without the PSF's
 * derivatives. */
bst_smear_direction_parts bst_smear_find_direction_parts(const bst_smear_maker *m,
                                                         const double axis[3], int nodes);
/* The part of `missed` in a row of such groups, if the image moves by `scale` of the path; 0 if it
 * is not known. even: it is beside groups of like speed; *pattern: which of the row's it has. */
double bst_smear_row_part(const bst_smear_maker *m, const bst_smear_direction_parts *parts,
                          const bst_smear_rule *r, double scale, bool even, int *pattern);

/* Replaces *best by the rule with the fewest nodes that meets the tolerance, otherwise by the best
 * of three nodes. Rules with an error beyond `limit` are ignored. */
void bst_smear_choose_rule(const bst_smear_maker *m, const bst_smear_moments *g, double limit,
                           bst_smear_rule *best);

#endif
