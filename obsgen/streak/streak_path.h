/* Where sources go that are longer than is filtered for: runs of places along their ways. Inside of
 * the generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_PATH_H
#define BST_OBSGEN_STREAK_STREAK_PATH_H

#include "obsgen/generator_internal.h"
#include "obsgen/streak/streak_light.h"

/* Nodes of a way that are looked at together. */
enum { BST_STREAK_BLOCK = 64, BST_STREAK_BLOCKS = BST_ROUTE_NODES / BST_STREAK_BLOCK };

/* A way, its parts that run more along one axis and one way each, and where it goes. */
typedef struct bst_streak_way {
    double x[BST_ROUTE_NODES], y[BST_ROUTE_NODES], time[BST_ROUTE_NODES], light[BST_ROUTE_NODES];
    int count, parts;
    int first[BST_ROUTE_NODES + 1]; /* of a part; the last of it is the first of the next */
    bool by_row[BST_ROUTE_NODES];
    /* least and greatest x, least and greatest y of a block and one more */
    double box[BST_STREAK_BLOCKS][4];
} bst_streak_way;

/* What is followed: so far beyond the frame, px; of runs, see bst_streak_light_end. */
typedef struct bst_streak_limits {
    int beyond;
    double seen, lit, dense;
} bst_streak_limits;

/* The stars' way in the middle of the frame, and one of a source that moves otherwise. */
typedef struct bst_streak_ways {
    bst_streak_limits limits;
    bst_streak_way stars, own;
} bst_streak_ways;

/* Begins a frame with the stars' way. */
void bst_streak_ways_begin(bst_streak_ways *ways, const bst_generator *generator,
                           const bst_streak_limits *limits);
/* Adds the runs of a source to the light. BST_ERR_MEMORY. */
bst_status bst_streak_ways_add(bst_ctx *ctx, bst_streak_ways *ways, bst_generator *generator,
                               int source, bst_streak_light *light) BST_MUST_CHECK;

#endif
