/* Star identification of generated detections. */
#ifndef BST_OBSGEN_IDENTIFY_H
#define BST_OBSGEN_IDENTIFY_H

#include "obsgen/generator.h"
#include "sim/catalogue/stars.h"

typedef struct bst_identify_options {
    const bst_stars *catalogue, *world_catalogue; /* onboard and true; may be the same */
    double julian_year, world_julian_year;
    double search_radius_px, match_tolerance_px;
    double probability; /* probability that an identifiable star is identified */
    double v_limit;     /* limiting magnitude of the expected stars */
    bool locked; /* the tracker has estimated the pointing error: the small radius is tried first */
    double shift_px; /* distance of the stars from their expected positions */
    bst_rng_key key;
} bst_identify_options;

/* Labels the detections that image processing would identify as catalogue stars. The stars must lie
 * within the search radius. Enough of them must agree that chance explains it in less than 1 of 100
 * frames (Poisson, at the density of consistent pairs). A detection of something else next to an
 * undetected star of its brightness is taken for that star.
 *
 * Returned:  *identified  number of identified stars */
bst_status bst_obsgen_identify(bst_ctx *ctx, const bst_identify_options *options,
                               const bst_generator_frame *frame,
                               const bst_obsgen_generated *generated, bst_detection *items,
                               int count, int *identified) BST_MUST_CHECK;

#endif
