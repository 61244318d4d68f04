#include "boresight/background_config.h"

static const char *const models[] = {"uniform", "sky", NULL};

static const char *const map_units[] = {"electrons_per_s", "share", NULL};

static const bst_config_desc pst_table[] = {
    BST_REAL(bst_optics_pst_point, angle_deg, "deg", 0, 180, NULL,
             "Angle of the source from the boresight."),
    BST_REAL(bst_optics_pst_point, pst, "", 0, 1e6, NULL,
             "Irradiance on the detector over that at the entrance, normal to the source's light."),
    BST_CONFIG_END,
};

const bst_config_desc bst_background_config_table[] = {
    BST_ENUM(
        bst_background_config, model, models, "\"uniform\"",
        "\"uniform\": background_mag_arcsec2 all over the sensor. \"sky\": what is there, pixel "
        "by pixel, instead of it."),
    BST_BOOL(bst_background_config, zodiacal, "true",
             "sky: zodiacal light by ecliptic latitude and longitude from the Sun."),
    BST_BOOL(bst_background_config, starlight, "true",
             "sky: light of the stars that are not drawn, by place."),
    BST_REAL(bst_background_config, diffuse_galactic_fraction, "", 0, 10, "0",
             "sky: starlight scattered by dust, over the light of all stars of that place fainter "
             "than V 6."),
    BST_BOOL(bst_background_config, earth, "true",
             "The Earth's disc in the field, by day and by night, in both models; sky: and its "
             "stray light where there is a table. false: only what is behind it is hidden."),
    BST_BOOL(bst_background_config, moon, "true", "The same of the Moon, which hides nothing."),
    BST_BOOL(bst_background_config, sun, "true", "The same of the Sun, which hides nothing."),
    BST_REAL(bst_background_config, earth_albedo, "", 0, 1, "0.3",
             "Diffuse albedo of the Earth, a Lambertian ellipsoid in the light of Sun and Moon."),
    BST_REAL(bst_background_config, earth_night_mag_arcsec2, "mag", 10, 40, "22",
             "Brightness of the Earth's night side without moonlight, V per square arcsecond: "
             "airglow at its median (Leinert et al. 1998). It is on the day side too."),
    BST_REAL(bst_background_config, earth_temperature_k, "K", 0, 400, "255",
             "Temperature that the Earth emits with, day and night, in bands with a spectrum."),
    BST_REAL(bst_background_config, limb_scale_height_m, "m", 0, 1e5, "8000",
             "Height over which the light of the Earth's limb fades to 1/e above the surface; 0: a "
             "sharp limb."),
    BST_LIST(
        bst_background_config, pst, bst_optics_pst_point, pst_table, 0, 1000, "[]",
        "sky: point source transmittance by angle, for the stray light of Sun, Moon and Earth; "
        "log-linear between points, the first and last value beyond. Empty: none."),
    BST_PATH(bst_background_config, pst_file, "\"\"",
             "The same from a CSV file with the columns angle_deg,pst."),
    BST_REAL(bst_background_config, pixel_pitch_um, "um", 0, 1000, "0",
             "Pixel pitch, for stray light; 0: that of the block optics."),
    BST_FORMER("pixel_um", "pixel_pitch_um"),
    BST_REAL(bst_background_config, stray_e_per_s, "e/s", 0, 1e9, "0",
             "Light per pixel added all over the sensor, in both models."),
    BST_REALS(bst_background_config, gradient_e_per_s, "e/s", -1e9, 1e9, "[0, 0]",
              "Change of it from the sensor's centre to its right and its bottom edge (last row)."),
    BST_REALS(
        bst_background_config, curvature_e_per_s, "e/s", -1e9, 1e9, "[0, 0, 0]",
        "Factors of u^2, u v and v^2, u and v from -1 to 1 across columns and rows. The sum is "
        "never below 0."),
    BST_PATH(bst_background_config, stray_map_file, "\"\"",
             "FITS image with stray light over the sensor, of its size or a whole part of it per "
             "axis (then linear between the middles of the map's pixels)."),
    BST_ENUM(bst_background_config, stray_map, map_units, "\"electrons_per_s\"",
             "\"electrons_per_s\": the map's numbers are electrons per second and sensor pixel, "
             "added in both models. \"share\": they are factors on the stray light of Sun, Moon "
             "and Earth by pst, which is even without a map; with model sky."),
    BST_REAL(bst_background_config, stray_map_scale, "", 0, 1e9, "1",
             "Factor on the map's numbers."),
    BST_CONFIG_END,
};
