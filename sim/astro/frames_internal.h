/* The slowly varying parts of the Earth's rotations, from which sky_clock.c interpolates. */
#ifndef BST_ASTRO_FRAMES_INTERNAL_H
#define BST_ASTRO_FRAMES_INTERNAL_H

#include "sim/astro/frames.h"

typedef struct bst_earth_parts {
    bst_mat3 cirs_from_gcrf; /* celestial intermediate pole and origin */
    bst_mat3 itrf_from_tirs; /* polar motion and TIO locator */
    double era_rad;          /* Earth rotation angle, [0, 2 pi) */
    double teme_turn_rad;    /* cirs_from_teme is a turn of the axes by this about z */
} bst_earth_parts;

/* At t, with the Earth orientation of `read_at`. */
bst_status bst_earth_parts_at(bst_ctx *ctx, const bst_eop *eop, bst_time t, bst_time read_at,
                              bst_earth_parts *out) BST_MUST_CHECK;
/* The instant nearest to t that the table covers, a second inside its ends. */
bst_status bst_eop_nearest(bst_ctx *ctx, const bst_eop *eop, bst_time t,
                           bst_time *out) BST_MUST_CHECK;
bst_earth_frames bst_earth_frames_from_parts(const bst_earth_parts *parts);
/* Linear between two instants at most an hour apart: 1e-10 rad. f: 0 at a, 1 at b. */
bst_earth_parts bst_earth_parts_between(const bst_earth_parts *a, const bst_earth_parts *b,
                                        double f);

#endif
