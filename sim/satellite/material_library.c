#include "sim/satellite/material_library.h"

#include <assert.h>

const char *const bst_material_library_names[] = {"none",
                                                  "white_paint",
                                                  "black_paint",
                                                  "mli_gold",
                                                  "mli_silver",
                                                  "solar_cell",
                                                  "panel_back",
                                                  "bare_aluminium",
                                                  "optical_solar_reflector",
                                                  "starlink_chassis",
                                                  "starlink_solar_array",
                                                  NULL};

/* Reflectances are 1 minus the solar absorptances at the beginning of life in Gilmore (ed.),
 * Spacecraft Thermal Control Handbook, vol. 1 (2002), appendix A, which gives the emissivities too.
 * Widths of lobes are estimates unless a source stands beside them. */
static const bst_material library[] = {
    /* Z-93: absorptance 0.17 to 0.20 */
    {"white_paint", {.model = BST_BRDF_LAMBERT, .diffuse = 0.81}, 1.0, {0.85, 1, 1.02, 1}, 0.92},
    /* Aeroglaze Z306: absorptance 0.95 */
    {"black_paint", {.model = BST_BRDF_LAMBERT, .diffuse = 0.05}, 1.0, {1, 1, 1, 1}, 0.89},
    /* aluminised Kapton, 1 mil: absorptance 0.38; the absorption edge of Kapton makes it yellow;
     * wrinkles tilt it by some ten degrees */
    {"mli_gold",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.55, .diffuse = 0.1, .roughness = 0.25},
     1.0,
     {0.15, 1, 1.35, 1.4},
     0.67},
    /* aluminised Teflon, 2 mil: absorptance 0.14, emittance 0.60 */
    {"mli_silver",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.8, .diffuse = 0.1, .roughness = 0.25},
     1.0,
     {1.02, 1, 0.99, 1},
     0.6},
    /* triple-junction cell under cover glass: absorptance 0.92; front of the glass 4 % */
    {"solar_cell",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.04, .diffuse = 0.05, .roughness = 0.03},
     1.0,
     {1.3, 1, 0.9, 1.3},
     0.85},
    /* carbon fibre face sheet: absorptance 0.9 */
    {"panel_back",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.04, .diffuse = 0.07, .roughness = 0.35},
     1.0,
     {1, 1, 1, 1},
     0.85},
    /* 6061 as rolled: absorptance 0.2 */
    {"bare_aluminium",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.75, .diffuse = 0.1, .roughness = 0.2},
     1.0,
     {1, 1, 1, 0.98},
     0.06},
    /* silvered quartz mirror: absorptance 0.07; flat within some arc minutes */
    {"optical_solar_reflector",
     {.model = BST_BRDF_COOK_TORRANCE, .specular = 0.93, .roughness = 0.003},
     1.0,
     {0.98, 1, 1.01, 1.02},
     0.8},
    /* measured at 532 nm; fits of Fankhauser, Tyson and Askari, AJ 166, 59 (2023), data repository
     */
    {"starlink_chassis",
     {.model = BST_BRDF_BINOMIAL,
      .b = {3.34, -98.085},
      .c = {-999.999, 867.538, 1000., 1000., -731.248, 618.552, -294.054, 269.248, -144.853,
            75.196},
      .base = 3.0,
      .first_power = -5,
      .terms = 10},
     1.0,
     {1, 1, 1, 1},
     0.8},
    {"starlink_solar_array",
     {.model = BST_BRDF_BINOMIAL,
      .b = {0.534, -20.409},
      .c = {-527.765, 1000., -676.579, 430.596, -175.806, 57.879},
      .base = 3.0,
      .first_power = -3,
      .terms = 6},
     1.0,
     {1, 1, 1, 1},
     0.85},
};

const bst_material *bst_material_library(int index) {
    assert(index >= 1 && index <= (int)(sizeof library / sizeof library[0]));
    return &library[index - 1];
}
