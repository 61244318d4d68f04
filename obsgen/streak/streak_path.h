/* Trails of sources that are longer than is filtered for, as runs of places. Internal to the
 * generator. */
#ifndef BST_OBSGEN_STREAK_STREAK_PATH_H
#define BST_OBSGEN_STREAK_STREAK_PATH_H

#include "obsgen/generator_internal.h"
#include "obsgen/streak/streak_light.h"

/* Nodes of a trail processed together. */
enum { BST_STREAK_BLOCK = 64, BST_STREAK_BLOCKS = BST_ROUTE_NODES / BST_STREAK_BLOCK };

/* A trail and its parts, each along one axis in one direction. */
typedef struct bst_streak_way {
    double x[BST_ROUTE_NODES], y[BST_ROUTE_NODES], time[BST_ROUTE_NODES], light[BST_ROUTE_NODES];
    int count, parts;
    /* first node of a part; the last node of a part is the first of the next */
    int first[BST_ROUTE_NODES + 1];
    bool by_row[BST_ROUTE_NODES];
    /* least and greatest x, least and greatest y of a block and its next node */
    double box[BST_STREAK_BLOCKS][4];
} bst_streak_way;

/* Limits: distance beyond the frame, px; SNR limits of bst_streak_light_end. */
typedef struct bst_streak_limits {
    int beyond;
    double seen, lit, dense;
} bst_streak_limits;

/* The stars' trail at the frame's centre, and the trail of a source in different motion. */
typedef struct bst_streak_ways {
    bst_streak_limits limits;
    bst_streak_way stars, own;
} bst_streak_ways;

/* Begins a frame with the stars' trail. */
void bst_streak_ways_begin(bst_streak_ways *ways, const bst_generator *generator,
                           const bst_streak_limits *limits);
/* Adds the runs of a source to the light. Errors: BST_ERR_MEMORY. */
bst_status bst_streak_ways_add(bst_ctx *ctx, bst_streak_ways *ways, bst_generator *generator,
                               int source, bst_streak_light *light) BST_MUST_CHECK;

#endif
