#include "sim/world/scene/brightness_config.h"

static const char *const heat_balances[] = {"none", "steady", "transient", NULL};
static const char *const models[] = {"sphere", "standard_magnitude", "light_curve", "shape", NULL};

const bst_config_desc bst_brightness_config_table[] = {
    BST_ENUM(bst_brightness_config, model, models, "\"sphere\"",
             "Where reflected light comes from: a sphere of area_m2 and albedo, a standard "
             "magnitude, a table, or the object's shape (for listed objects)."),
    BST_REAL(bst_brightness_config, specular_fraction, "", 0, 1, "0",
             "Part of the reflected light that comes as from a mirror ball, the same at all phase "
             "angles; the rest is diffuse (Lambertian)."),
    BST_REAL(bst_brightness_config, standard_v_mag, "mag", -20, 40, "5",
             "standard_magnitude: V at a range of 1000 km, a phase angle of 90 degrees and 1 au "
             "from the Sun."),
    BST_PATH(bst_brightness_config, light_curve_file, "\"\"",
             "light_curve: CSV file of two columns, time_s (after the epoch) or phase_deg, and "
             "v_mag_1000km (V at a range of 1000 km and 1 au from the Sun) or factor (on the "
             "sphere's light)."),
    BST_REAL(bst_brightness_config, light_curve_period_s, "s", 0, 1e9, "0",
             "light_curve by time: the table repeats after this time; 0: it is held at its ends."),
    BST_BOOL(bst_brightness_config, earthshine, "false",
             "Whether sunlight that the Earth reflects lights the object, too."),
    BST_REAL(bst_brightness_config, earth_albedo, "", 0, 1, "0.3",
             "earthshine: diffuse albedo of the Earth."),
    BST_REAL(bst_brightness_config, emissivity, "", 0, 1, "0.8",
             "Emissivity in the thermal infrared; there it also reflects what it does not emit."),
    BST_REAL(bst_brightness_config, temperature_k, "K", 0, 5000, "290",
             "Temperature of the object in sunlight."),
    BST_REAL(bst_brightness_config, shadow_temperature_k, "K", 0, 5000, "230",
             "Temperature of the object in the Earth's shadow; in penumbra fourth powers are mixed "
             "by the part of the Sun that is seen."),
    BST_ENUM(bst_brightness_config, heat_balance, heat_balances, "\"none\"",
             "Temperatures of a shape. none: temperature_k and shadow_temperature_k; steady: each "
             "facet emits what it absorbs of sunlight, the Earth's reflected light and infrared; "
             "transient: with the heat capacity of its material."),
    BST_REAL(bst_brightness_config, earth_infrared_w_per_m2, "W/m2", 0, 1000, "237",
             "steady, transient: exitance of the Earth in the thermal infrared."),
    BST_BOOL(bst_brightness_config, interreflection, "false",
             "shape: whether sunlight that one part reflects lights others; one bounce, all of it "
             "diffuse; at most 1000 facets."),
    BST_BOOL(bst_brightness_config, resolved, "true",
             "Whether the object is drawn as the disc of a sphere of area_m2, with its terminator, "
             "where that is larger than 0.02 px."),
    BST_CONFIG_END,
};
