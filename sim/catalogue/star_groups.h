/* Groups of sky cells, by which a query skips most of the sky. */
#ifndef BST_CATALOGUE_STAR_GROUPS_H
#define BST_CATALOGUE_STAR_GROUPS_H

#include "sim/catalogue/star_index.h"

enum { BST_STAR_GROUP = 32 };

/* Cap that contains all cells of a group, or all groups of a region, and its brightest star. */
typedef struct bst_star_group {
    double centre[3], radius, pm_max_radpyr; /* radius below 0: no stars */
    int32_t brightest;                       /* V of a record, 1e-5 mag */
} bst_star_group;

/* Cells with consecutive numbers are neighbours of similar brightness: a query skips those
 * elsewhere and those of faint stars region by region, then group by group. */
typedef struct bst_star_groups {
    bst_star_group *groups;  /* one per BST_STAR_GROUP cells */
    bst_star_group *regions; /* one per BST_STAR_GROUP groups; behind the groups in memory */
    int32_t *brightest;      /* of each cell, as in its group; behind the regions in memory */
} bst_star_groups;

/* Makes the groups of a catalogue; free them with bst_star_groups_free. BST_ERR_MEMORY. */
bst_status bst_star_groups_make(bst_ctx *ctx, const bst_star_view *view,
                                bst_star_groups *out) BST_MUST_CHECK;

/* Frees the groups' memory. */
void bst_star_groups_free(bst_star_groups *groups);

#endif
