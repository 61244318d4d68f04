/* Which generated detections the onboard side knows as stars. */
#ifndef BST_OBSGEN_IDENTIFY_H
#define BST_OBSGEN_IDENTIFY_H

#include "obsgen/generator.h"
#include "sim/catalogue/stars.h"

typedef struct bst_identify_options {
    const bst_stars *catalogue, *world_catalogue; /* onboard and true; may be the same */
    double julian_year, world_julian_year;
    double search_radius_px, match_tolerance_px;
    double probability; /* that a star that could be identified is */
    double v_limit;     /* of the stars that are expected */
    bool locked;        /* the tracker knows the pointing's error: a small radius first */
    double shift_px;    /* of the stars from where they are expected */
    bst_rng_key key;
} bst_identify_options;

/* Labels the detections that are stars of the onboard catalogue, as far as image processing would
 * find its way: the stars must not lie further off than the search reaches, and enough of them must
 * agree that chance does not explain it (in less than 1 of 100 frames, Poisson, at the density of
 * consistent pairs). A detection of something else next to an undetected star of its brightness is
 * taken for that star. Returns how many in *identified. */
bst_status bst_obsgen_identify(bst_ctx *ctx, const bst_identify_options *options,
                               const bst_generator_frame *frame,
                               const bst_obsgen_generated *generated, bst_detection *items,
                               int count, int *identified) BST_MUST_CHECK;

/* Labels the rest: cut by the frame's edge: artefact; what is no star, where stars were found or
 * streak, object, unless it moved as stars do. Every label is told as certain. */
void bst_obsgen_label(bst_detection *items, int count, bool found_stars, double streak_px);

#endif
