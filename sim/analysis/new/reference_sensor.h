/* The sensor and the target of the scenarios that `boresight new` writes. */
#ifndef BST_ANALYSIS_NEW_REFERENCE_SENSOR_H
#define BST_ANALYSIS_NEW_REFERENCE_SENSOR_H

/* A small satellite's telescope: as in scenarios/neossat_geo_track.json, with a quieter read-out.
 */
#define BST_NEW_FLUX_V0 3.6e10
#define BST_NEW_THROUGHPUT 0.7
#define BST_NEW_QUANTUM_EFFICIENCY 0.7
#define BST_NEW_READ_NOISE_E 5.0
#define BST_NEW_DARK_E_PER_S 0.5
#define BST_NEW_SKY_MAG_ARCSEC2 22.0
#define BST_NEW_FULL_WELL_E 100000.0
#define BST_NEW_FWHM_PX 2.0
#define BST_NEW_PIXEL_UM 13.0
/* The target: a sphere. */
#define BST_NEW_AREA_M2 4.0
#define BST_NEW_ALBEDO 0.25

#endif
