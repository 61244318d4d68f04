/* What there is to see of an object, by its orbit. */
#ifndef BST_TRACKER_SIGHT_H
#define BST_TRACKER_SIGHT_H

#include "sim/astro/bodies.h"
#include "tracker/multitarget.h"

/* Geocentric places of object, observer and Sun at one time (GCRF, m), the object's SNR in full
 * light (0: unknown) and that above which detections are made. *sunlight is the share of the Sun's
 * disc that the object sees (bst_sun_fraction). BST_MTT_SHADOW: its light, which falls with that
 * share, makes less than 0.6 of the threshold's SNR; BST_MTT_DARK: none of it would if the Earth
 * were 2 % smaller; BST_MTT_EARTH: the line of sight passes within the Earth's polar radius;
 * BST_MTT_FAINT: it might be either if the Earth were 2 % larger. */
bst_mtt_sight bst_sight_of(bst_vec3 object_m, bst_vec3 observer_m, bst_vec3 sun_m, double full_snr,
                           double threshold_snr, double *sunlight);

#endif
