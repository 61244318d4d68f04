/* Walker constellations: satellites on equal orbits in planes at equal angles in node. */
#ifndef BST_WORLD_ORBIT_CONSTELLATION_H
#define BST_WORLD_ORBIT_CONSTELLATION_H

#include "sim/astro/elements.h"
#include "sim/world/world_config.h"

/* Checks a constellation: number of satellites a multiple of the planes, phasing below the number
 * of planes, perigee above the atmosphere. BST_ERR_CONFIG names the keys, without the path. */
bst_status bst_constellation_check(bst_ctx *ctx,
                                   const bst_constellation_config *config) BST_MUST_CHECK;

/* Mean elements for SGP4 (true equator and mean equinox of date) of one satellite at the
 * constellation's at_s; `epoch`: the scenario's epoch. Plane and slot count from 1. In the notation
 * i: t/p/f: nodes 360/p degrees apart (star: 180/p), t/p satellites per plane, equally spaced in
 * mean anomaly, and a phase of f 360/t degrees from one plane to the next towards the east. The
 * mean motion follows from the semi-major axis by Kepler's third law. Source: Walker, Satellite
 * constellations, J. British Interplanetary Society 37 (1984) 559. */
bst_elements bst_constellation_elements(const bst_constellation_config *config, bst_time epoch,
                                        int plane, int slot);

/* Name of a member of a constellation: "NAME PLANE-SLOT". */
void bst_constellation_name(const bst_constellation_config *config, int plane, int slot,
                            char name[64]);

#endif
