/* Radiation hits: groups of pixels that differ between two frames of one exposure. */
#ifndef BST_ANALYSIS_CHARACTERIZE_RADIATION_HITS_H
#define BST_ANALYSIS_CHARACTERIZE_RADIATION_HITS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "boresight/status.h"
#include "sim/analysis/characterize/clipped_moments.h"

/* A hit that does not touch the edge of the frame. */
typedef struct bst_radiation_hit {
    float charge_dn;
    int pixels; /* that it crosses */
} bst_radiation_hit;

/* Hits of the frames of a stack. */
typedef struct bst_radiation_hits {
    int frames;               /* that were searched */
    int width, height;        /* of a frame */
    int count;                /* without those that touch the last row or column */
    double threshold_dn;      /* of a pixel of a hit, of the last pair */
    bst_radiation_hit *items; /* [used] inside the frame */
    size_t used, room;
} bst_radiation_hits;

/* Two frames of one exposure. */
typedef struct bst_hit_pair {
    int width, height;
    const float *first, *second; /* [height][width] DN */
    const double *rows;          /* [height] mean difference of each row, second less first */
    const double *hot;           /* [blocks] level above which a pixel is hot */
    const double *level;         /* [blocks] mean of the others */
    const double *sigma;         /* [blocks] standard deviation of the difference */
    double gain_e_per_dn;        /* for the shot noise of hot pixels */
    int blocks_per_side;
    double seed, grow; /* least difference of a hit's brightest pixel and of its others, in sigma */
} bst_hit_pair;

/* Adds the hits of a pair. A hit has a pixel whose difference is `seed` standard deviations or
 * more, and all pixels around it of `grow` or more with the same sign. Pixels that are hot in both
 * frames have the shot noise of their charge, and do not begin a hit: others would be cut in two
 * there, or lose charge.
 *
 * Returned:  mask  [height][width] 1 in pixels of hits
 * Errors:    BST_ERR_MEMORY */
bst_status bst_radiation_hits_add(bst_ctx *ctx, const bst_hit_pair *pair, uint8_t *mask,
                                  bst_radiation_hits *hits) BST_MUST_CHECK;
/* Frees the list. */
void bst_radiation_hits_free(bst_radiation_hits *hits);

/* Law of the hits, as the detector has it. */
typedef struct bst_hit_law {
    bst_sensor_estimate depth_px;   /* thickness of the sensitive layer over the pixel's side */
    bst_sensor_estimate charge_dn;  /* most probable charge of a track of one pixel's length */
    bst_sensor_estimate straggling; /* width of the Moyal law over the most probable charge */
} bst_hit_law;

enum { BST_LEAST_HITS = 30 };

/* Fits the law to the numbers of pixels and the charges of hits by maximum likelihood.
 *
 * Returned:  NAN with fewer than BST_LEAST_HITS hits, or where the likelihood has no maximum
 * Notes:     Isotropic flux: the cosine mu to the normal has the density 2 mu. A track of the
 *            displacement (X, Y) px crosses 1 + |X| + |Y| pixels on average, each of the two
 *            numbers of crossings being a whole number next to |X|, |Y|. Its ends are lost where a
 *            pixel has less than the threshold. Errors from the curvature of the likelihood.
 * Reference: Moyal 1955, Philosophical Magazine 46, 263 */
bst_hit_law bst_radiation_hits_fit(const bst_radiation_hits *hits);

#endif
