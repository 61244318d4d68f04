/* Orbits of unknown objects from arcs of directions that belong together. */
#ifndef BST_TRACKER_ORBIT_ORBIT_LINK_H
#define BST_TRACKER_ORBIT_ORBIT_LINK_H

#include "boresight/archive.h"
#include "tracker/orbit/orbit_initial.h"

/* Most arcs and orbits that wait for a further arc, and most directions of one. */
enum { BST_OD_LINK_ORBITS = 64, BST_OD_LINK_DIRECTIONS = 48 };

/* An arc of which no other is known (arcs 1), or the orbit of several. */
typedef struct bst_od_linked {
    int32_t arcs, count;
    bst_od_observation directions[BST_OD_LINK_DIRECTIONS]; /* [count], in order of time */
    bst_od_state state;                                    /* of two arcs or more */
    double chi2;                                           /* of the latest fit; dof: 2 count - 6 */
    int64_t id;                                            /* 1, 2, ... by first arc */
    int64_t sensor;                                        /* of the first arc */
} bst_od_linked;

typedef struct bst_od_linker {
    int count;
    int64_t made; /* ids given */
    bst_od_linked items[BST_OD_LINK_ORBITS];
} bst_od_linker;

/* Adds an arc to the orbit that it fits, or links it with an earlier arc to a new orbit; else it
 * waits. Of several the one with the least chi-square less twice its directions is taken. An arc
 * fits if batch least squares over all directions (bst_od_determine for two arcs, bst_od_fit from
 * the orbit for more) leaves a chi-square within five standard deviations of its expectation. When
 * there is no room, the oldest arc that waits is given up, and without one the oldest orbit. Two
 * arcs of one sensor at the same time are of two objects. Fits that do not converge in 25
 * iterations, and pairs of which the first four initial orbits fail, count as not fitting.
 *
 * Given:     motion      SGP4 or forces; central motion alone fits no arcs that are hours apart
 *            sensor      that the arc is of
 *            directions  at least 3, in order of time
 *            count       to half of BST_OD_LINK_DIRECTIONS
 *            within_s    longest time from the end of an arc to the begin of the next
 * Returned:  index of the item that has the arc now
 * Notes:     arcs some revolutions apart are linked only if the first ones determine the orbit well
 *            enough (bst_od_initial). Older directions of an orbit are thinned out. */
int bst_od_link_arc(bst_od_linker *linker, const bst_od_motion *motion, int64_t sensor,
                    const bst_od_observation *directions, int count, double within_s);

/* Removes an item; the last one takes its index. */
void bst_od_linker_drop(bst_od_linker *linker, int index);

/* Saves or restores the arcs and orbits. Errors: BST_ERR_FORMAT: a number or a time of them
 * is impossible (above BST_OD_LONGEST_S) */
bst_status bst_od_linker_archive(bst_od_linker *linker, bst_archive *archive) BST_MUST_CHECK;

#endif
