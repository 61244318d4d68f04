/* What there is to see of an object, by its orbit. */
#ifndef BST_TRACKER_MTT_VISIBILITY_H
#define BST_TRACKER_MTT_VISIBILITY_H

#include "sim/astro/bodies.h"
#include "tracker/mtt/multitarget.h"

/* What is known of an object's light. */
typedef struct bst_visibility_seen {
    double snr;      /* in full light; 0: not known */
    double glow;     /* bst_mtt_light's, then; 0: not known, and taken for unchanged */
    bool was_bright; /* it has had light.bright */
} bst_visibility_seen;

/* Geocentric places of object, observer and Sun at one time (GCRF, m) and the SNR above which
 * detections are made. The light is foreseen to go with the share of the Sun's disc that the object
 * sees (bst_astro_sun_fraction), with the phase angle as that of a diffuse sphere
 * (bst_astro_sphere_phase) and with the range. BST_MTT_SHADOW: it makes less than 0.6 of the
 * threshold's SNR; BST_MTT_DARK: none of it would be there if the Earth were 2 % smaller;
 * BST_MTT_EARTH: the line of sight passes within the Earth's polar radius; BST_MTT_FAINT: it might
 * be either if the Earth were 2 % larger, or what was seen brighter is foreseen to have dimmed to
 * less than the threshold and 3. */
bst_mtt_sight bst_visibility_of(bst_vec3 object_m, bst_vec3 observer_m, bst_vec3 sun_m,
                                const bst_visibility_seen *seen, double threshold_snr,
                                bst_mtt_light *light);

#endif
