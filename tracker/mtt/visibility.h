/* Visibility of an object predicted from its orbit. */
#ifndef BST_TRACKER_MTT_VISIBILITY_H
#define BST_TRACKER_MTT_VISIBILITY_H

#include "sim/astro/bodies.h"
#include "tracker/mtt/multitarget.h"

/* Observed brightness of an object so far. */
typedef struct bst_visibility_seen {
    double snr;      /* in full sunlight; 0: unknown */
    double glow;     /* bst_mtt_light's glow at that time; 0: unknown, assumed unchanged */
    bool was_bright; /* light.bright was true in an earlier frame */
} bst_visibility_seen;

/* Predicts visibility and brightness of an object.
 *
 * Brightness follows the visible share of the Sun's disc (bst_astro_sun_fraction), the phase angle
 * of a diffuse sphere (bst_astro_sphere_phase) and the range.
 *
 * Given:     object_m, observer_m, sun_m  geocentric positions at one time, GCRF, m
 *            threshold_snr                detection threshold
 * Returned:  BST_MTT_EARTH   the line of sight passes below the Earth's polar radius
 *            BST_MTT_DARK    in umbra even for an Earth 2 % smaller
 *            BST_MTT_SHADOW  SNR below 0.6 of the threshold
 *            BST_MTT_FAINT   possibly hidden for an Earth 2 % larger, or predicted less than 3
 *                            above the threshold
 *            BST_MTT_CLEAR   otherwise */
bst_mtt_sight bst_visibility_of(bst_vec3 object_m, bst_vec3 observer_m, bst_vec3 sun_m,
                                const bst_visibility_seen *seen, double threshold_snr,
                                bst_mtt_light *light);

#endif
