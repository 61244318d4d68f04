/* Materials of satellites with published optical properties. */
#ifndef BST_SATELLITE_MATERIAL_LIBRARY_H
#define BST_SATELLITE_MATERIAL_LIBRARY_H

#include "sim/astro/bodies.h"
#include "sim/satellite/brdf.h"

/* A surface of a satellite. */
typedef struct bst_material {
    char name[64];
    bst_brdf brdf;                       /* at 0.55 um */
    double scale;                        /* factor on the BRDF */
    double colour[BST_SUNLIGHT_COLOURS]; /* reflectance over that in V, at
                                            bst_sunlight_wavelength_m */
    double emissivity;                   /* hemispherical, thermal infrared */
} bst_material;

/* Names of the library, NULL-terminated; the first one is "none". */
extern const char *const bst_material_library_names[];

/* Values of a material of the library.
 *
 * Given:     index  into bst_material_library_names, not 0
 * Notes:     sources are in docs/reference/satellites.md and beside the values. */
const bst_material *bst_material_library(int index);

#endif
