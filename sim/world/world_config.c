#include "sim/world/world_config.h"

#include <math.h>

#include "sim/astro/elements.h"

static const char *const orbit_sources[] = {"sgp4",      "relative",      "oem", "injected",
                                            "numerical", "constellation", NULL};
static const char *const walker_patterns[] = {"delta", "star", NULL};
static const char *const states_frames[] = {"gcrf", "teme", NULL};
static const char *const faint_kinds[] = {"none", "statistical", NULL};
static const char *const axes[] = {"x", "-x", "y", "-y", NULL};

static const bst_config_desc orbit_table[] = {
    BST_ENUM(
        bst_orbit_config, source, orbit_sources, "\"sgp4\"",
        "Where the orbit comes from: an element set, another object plus an offset, an ephemeris "
        "file, states given per frame, numerical integration from a state, or a place in one of "
        "the world's constellations."),
    BST_PATH(bst_orbit_config, elements_file, "\"\"",
             "sgp4: file of element sets (TLE, or OMM as JSON or CSV), relative to the scenario's "
             "folder."),
    BST_INT(bst_orbit_config, norad, "", 0, BST_NORAD_MAX, "0",
            "sgp4: catalogue number in that file."),
    BST_STRING(bst_orbit_config, tle_line1, "\"\"",
               "sgp4: first line of the element set itself, instead of elements_file and norad."),
    BST_STRING(bst_orbit_config, tle_line2, "\"\"", "sgp4: its second line."),
    BST_STRING(bst_orbit_config, reference, "\"\"",
               "relative: the object that the offset is added to."),
    BST_REAL(bst_orbit_config, at_s, "s", -1e9, 1e9, "0",
             "relative: time at which the offset holds."),
    BST_REALS(bst_orbit_config, offset_rtn_m, "m", -1e9, 1e9, "[0, 0, 0]",
              "relative: offset along radius, transverse and normal of the reference's orbit."),
    BST_REALS(bst_orbit_config, rate_rtn_mps, "m/s", -1e5, 1e5, "[0, 0, 0]",
              "relative: change of the offset."),
    BST_PATH(bst_orbit_config, oem_file, "\"\"",
             "oem: CCSDS OEM file (KVN), relative to the scenario's folder."),
    BST_STRING(bst_orbit_config, oem_object, "\"\"",
               "oem: OBJECT_NAME or OBJECT_ID in that file; empty: its only object."),
    BST_PATH(bst_orbit_config, states_file, "\"\"",
             "injected: CSV file of states at the start and end of each frame, relative to the "
             "scenario's folder; or a sensor's frame_updates_file (.json)."),
    BST_STRING(bst_orbit_config, states_object, "\"\"",
               "injected: the object in that file; empty: its only one."),
    BST_ENUM(bst_orbit_config, states_frame, states_frames, "\"gcrf\"",
             "injected: axes of the states, GCRF or true equator and mean equinox of date."),
    BST_STRING(bst_orbit_config, constellation, "\"\"",
               "constellation: the name of one of /world/constellations."),
    BST_REALS(bst_orbit_config, member, "", 1, 10000, "[1, 1]",
              "constellation: plane and slot of the satellite, from 1."),
    BST_OBJECT(bst_orbit_config, state, bst_initial_state_table, "{}",
               "numerical: what it starts from."),
    BST_OBJECT(bst_orbit_config, forces, bst_force_table, "{}", "numerical: what acts on it."),
    BST_OBJECT(bst_orbit_config, spacecraft, bst_orbit_spacecraft_table, "{}",
               "numerical: what drag and solar pressure act on."),
    BST_CONFIG_END,
};

static const bst_config_desc burn_table[] = {
    BST_REAL(bst_burn_config, time_s, "s", -1e9, 1e9, NULL, "Time of the burn after the epoch."),
    BST_REAL(bst_burn_config, duration_s, "s", 0, 1e9, "0",
             "How long it lasts from then on, thrust constant in axes that turn with the orbit; 0: "
             "an impulse. Above 0 for numerical orbits only."),
    BST_REALS(bst_burn_config, dv_rtn_mps, "m/s", -1e5, 1e5, NULL,
              "Change of velocity along radius, transverse and normal."),
    BST_CONFIG_END,
};

const bst_config_desc bst_object_config_table[] = {
    BST_STRING(bst_object_config, name, NULL, "Name, unique in the scenario."),
    BST_OBJECT(bst_object_config, orbit, orbit_table, NULL, "The object's orbit."),
    BST_REAL(bst_object_config, area_m2, "m2", 0, 1e6, "4",
             "Cross-section of the sphere that stands for it."),
    BST_REAL(bst_object_config, albedo, "", 0, 1, "0.25", "Albedo of the sphere; 0 makes it dark."),
    BST_OBJECT(bst_object_config, brightness, bst_brightness_config_table, "{}",
               "How its light follows from where it is; left out: a diffuse sphere."),
    BST_OBJECT(bst_object_config, shape, bst_satellite_config_table, "{}",
               "Its shape, for brightness of the model shape; left out: a sphere."),
    BST_LIST(bst_object_config, attitude, bst_attitude_config, bst_attitude_config_table, 0, 64,
             "[]", "Phases of the attitude of its shape, in the order of time; left out: nadir."),
    BST_LIST(bst_object_config, burns, bst_burn_config, burn_table, 0, 64, "[]",
             "Burns in the order of time. The cue does not know of them."),
    BST_BOOL(bst_object_config, external_states, "false",
             "Its states may come while the run goes, from the peer of an external gimbal; the cue "
             "does not know of them."),
    BST_FORMER("steered", "external_states"),
    BST_BOOL(bst_object_config, occults, "false",
             "Whether it hides other objects behind it and casts its shadow on them."),
    BST_CONFIG_END,
};

static const bst_config_desc catalogue_table[] = {
    BST_PATH(
        bst_catalogue_config, elements_file, NULL,
        "File of element sets, relative to the scenario's folder: each satellite in it becomes "
        "an object, but for those that the list of objects has by number."),
    BST_REAL(bst_catalogue_config, area_m2, "m2", 0, 1e6, "4",
             "Cross-section of the sphere that stands for each."),
    BST_REAL(bst_catalogue_config, albedo, "", 0, 1, "0.25", "Albedo of the sphere."),
    BST_OBJECT(bst_catalogue_config, brightness, bst_brightness_config_table, "{}",
               "How the light of each follows from where it is."),
    BST_CONFIG_END,
};

static const bst_config_desc constellation_table[] = {
    BST_STRING(bst_constellation_config, name, NULL,
               "Name; the satellites' are NAME PLANE-SLOT, as in \"NAME 2-5\"."),
    BST_ENUM(bst_constellation_config, pattern, walker_patterns, "\"delta\"",
             "Ascending nodes over 360 degrees (delta) or 180 degrees (star)."),
    BST_INT(bst_constellation_config, satellites, "", 1, 20000, NULL,
            "Number of satellites, t of i: t/p/f."),
    BST_INT(bst_constellation_config, planes, "", 1, 10000, NULL,
            "Number of planes, p; it divides t."),
    BST_INT(bst_constellation_config, phasing, "", 0, 9999, "0",
            "Phase from a plane to the next one to the east in units of 360 degrees / t: f, below "
            "p."),
    BST_REAL(bst_constellation_config, inclination_deg, "deg", 0, 179.9, NULL,
             "Inclination, i, against the true equator of date."),
    BST_REAL(bst_constellation_config, semi_major_axis_m, "m", 6.4e6, 1e9, NULL,
             "Semi-major axis; the mean motion follows by Kepler's third law."),
    BST_REAL(bst_constellation_config, eccentricity, "", 0, 0.9, "0", "Eccentricity."),
    BST_REAL(bst_constellation_config, raan_deg, "deg", -360, 360, "0",
             "Right ascension of the first plane's ascending node."),
    BST_REAL(bst_constellation_config, arg_perigee_deg, "deg", -360, 360, "0",
             "Argument of perigee of all orbits."),
    BST_REAL(bst_constellation_config, mean_anomaly_deg, "deg", -360, 360, "0",
             "Mean anomaly of satellite 1-1 at at_s."),
    BST_REAL(bst_constellation_config, at_s, "s", -1e9, 1e9, "0",
             "Time of the elements after the epoch; SGP4 carries them on without drag."),
    BST_REAL(bst_constellation_config, area_m2, "m2", 0, 1e6, "4",
             "Cross-section of the sphere that stands for each."),
    BST_REAL(bst_constellation_config, albedo, "", 0, 1, "0.25", "Albedo of the sphere."),
    BST_OBJECT(bst_constellation_config, brightness, bst_brightness_config_table, "{}",
               "How the light of each follows from where it is."),
    BST_CONFIG_END,
};

static const char *const catalogue_words[] = {"default", "embedded", NULL};
static const char *const builtin_word[] = {"builtin", NULL};

const bst_config_desc bst_world_config_table[] = {
    BST_PATH_OR(
        bst_world_config, star_catalogue, catalogue_words, "\"default\"",
        "\"default\" (the user's full catalogue, else the embedded one), \"embedded\", or a file, "
        "relative to the scenario's folder."),
    BST_ENUM(bst_world_config, faint_stars, faint_kinds, "\"none\"",
             "Stars beyond the catalogue's limit: none, or drawn by place from a table of star "
             "counts. The onboard side does not know them."),
    BST_REAL(bst_world_config, faint_limit_v_mag, "mag", 6, 21, "16",
             "Statistical stars are drawn one by one down to this V (and the renderer's "
             "star_limit_v_mag); "
             "those fainter add to the background."),
    BST_SEED(bst_world_config, faint_seed, "\"0x5ca1ab1edeadbeef\"",
             "Seed of the statistical sky: the same sky in all runs."),
    BST_PATH_OR(bst_world_config, earth_orientation, builtin_word, "\"builtin\"",
                "\"builtin\" or a file in the IERS EOP C04 format."),
    BST_BOOL(bst_world_config, shadow_atmosphere, "true",
             "Sunlight on objects at the edge of the Earth's shadow is refracted, weakened and "
             "reddened by the air; false: an Earth without air. The column sunlit_fraction is the "
             "geometric one in both cases."),
    BST_LIST(bst_world_config, objects, bst_object_config, bst_object_config_table, 0, 100000, "[]",
             "The space objects."),
    BST_LIST(bst_world_config, catalogues, bst_catalogue_config, catalogue_table, 0, 16, "[]",
             "Files of element sets whose satellites are there as well."),
    BST_LIST(bst_world_config, constellations, bst_constellation_config, constellation_table, 0, 64,
             "[]", "Walker constellations whose satellites are there as well."),
    BST_CONFIG_END,
};

static const bst_config_desc exposure_table[] = {
    BST_REAL(bst_exposure_config, exposure_s, "s", 0, 3600, "0.5", "Exposure time."),
    BST_REAL(bst_exposure_config, period_s, "s", 1e-3, 1e5, "1",
             "Time from one exposure's start to the next."),
    BST_REAL(bst_exposure_config, first_s, "s", 0, 1e9, "0", "Start of the first exposure."),
    BST_REAL(bst_exposure_config, dropped_fraction, "", 0, 1, "0",
             "Fraction of the frames that are lost between sensor and processing, at random."),
    BST_REAL(bst_exposure_config, dropped_burst_frames, "", 0, 1e6, "0",
             "Mean number of frames that are lost in a row (Gilbert's two-state channel): 1 or "
             "more; 0: each frame is lost or not by itself."),
    BST_INT(
        bst_exposure_config, binning, "px", 1, 8, "1",
        "Sensor pixels per side of a frame's pixel, added before they are read; control may ask "
        "for another."),
    BST_REALS(bst_exposure_config, window_px, "px", 0, 65536, "[0, 0, 0, 0]",
              "Part of the sensor that is read: first column, first row, width, height in whole "
              "sensor pixels; width 0: all of it. Control may ask for another."),
    BST_CONFIG_END,
};

bst_status bst_exposure_window(bst_ctx *ctx, const bst_exposure_config *config, int64_t width_px,
                               int64_t height_px, bst_window *out) {
    const double *w = config->window_px;
    *out = (bst_window){0, 0, (int)width_px, (int)height_px};
    if (w[2] == 0.0) {
        return BST_OK;
    }
    bool whole = true;
    for (int k = 0; k < 4; k++) {
        whole = whole && w[k] == floor(w[k]);
    }
    if (!whole || w[3] < 1.0 || w[0] + w[2] > (double)width_px || w[1] + w[3] > (double)height_px ||
        fmin(w[2], w[3]) < (double)config->binning) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "window_px: [%g, %g, %g, %g] is no window of the sensor (allowed: "
                        "whole numbers x0, y0, width, height within %lld x %lld pixels, at least "
                        "the binning of %lld wide and high)",
                        w[0], w[1], w[2], w[3], (long long)width_px, (long long)height_px,
                        (long long)config->binning);
    }
    *out = (bst_window){(int)w[0], (int)w[1], (int)w[2], (int)w[3]};
    return BST_OK;
}

static const char *const region_kinds[] = {"none", "arc", "geostationary", NULL};

static const bst_config_desc region_table[] = {
    BST_ENUM(bst_region_config, kind, region_kinds, "\"none\"",
             "none: the cue is a place. arc: along a great circle among the stars. geostationary: "
             "over a range of longitudes, at the radius of the geostationary belt."),
    BST_REALS(bst_region_config, arc_radec_deg, "deg", -360, 360, "[0, 0, 0, 0]",
              "arc: right ascension and declination (ICRS) of one end, and of the other."),
    BST_REALS(bst_region_config, longitude_deg, "deg", -360, 720, "[0, 0]",
              "geostationary: east longitudes from and to."),
    BST_REAL(bst_region_config, half_width_deg, "deg", 0, 45, "2",
             "How far the region reaches to either side; geostationary: geocentric latitude."),
    BST_CONFIG_END,
};

static const bst_config_desc cue_table[] = {
    BST_STRING(bst_cue_config, object, "\"\"",
               "Object whose catalogued orbit (burns left out) is the cue."),
    BST_REALS(bst_cue_config, direction_radec_deg, "deg", -360, 360, "[0, 0]",
              "Right ascension and declination (ICRS), used when no object is named."),
    BST_REAL(bst_cue_config, offset_deg, "deg", 0, 90, "0",
             "Error of the cue: a constant rotation of its direction."),
    BST_ENUM(bst_cue_config, offset_axis, axes, "\"x\"",
             "Image axis along which the cue is wrong."),
    BST_REAL(bst_cue_config, offset_angle_deg, "deg", -360, 360, "0",
             "Angle by which that direction is turned from image x towards image y."),
    BST_OBJECT(bst_cue_config, region, region_table, "{}",
               "Where to look for a target of which no place is known; it moves as the "
               "geostationary belt does there, to rate_sigma_arcsec_per_s. The object named only "
               "serves the summary, then."),
    BST_REAL(bst_cue_config, sigma_deg, "deg", 1e-6, 90, "0.5",
             "What the onboard side takes the cue's error to be, 1 sigma per axis."),
    BST_REAL(bst_cue_config, rate_sigma_arcsec_per_s, "arcsec/s", 1e-6, 1e5, "0.5",
             "The same of the cue's rate."),
    BST_REAL(bst_cue_config, v_mag, "mag", -30, 40, "13",
             "Brightness that the onboard side expects."),
    BST_REAL(bst_cue_config, v_mag_sigma, "mag", 0.01, 100, "1", "1 sigma of that; 100: unknown."),
    BST_CONFIG_END,
};

static const bst_config_desc star_errors_table[] = {
    BST_REAL(bst_star_errors_config, missing_fraction, "", 0, 1, "0",
             "Fraction of the stars that are missing on board."),
    BST_FORMER("dropped_fraction", "missing_fraction"),
    BST_REAL(bst_star_errors_config, position_error_fraction, "", 0, 1, "0",
             "Fraction of the stars whose onboard place is wrong."),
    BST_FORMER("displaced_fraction", "position_error_fraction"),
    BST_REAL(bst_star_errors_config, position_error_sigma_arcsec, "arcsec", 0, 3600, "0",
             "By how much: 1 sigma per axis, Gaussian."),
    BST_FORMER("displaced_sigma_arcsec", "position_error_sigma_arcsec"),
    BST_SEED(bst_star_errors_config, seed, "\"0x0\"",
             "Draws which ones; the same seed changes the same stars in the same way."),
    BST_CONFIG_END,
};

static const bst_config_desc camera_errors_table[] = {
    BST_REAL(bst_camera_errors_config, scale_error_ppm, "ppm", -1e5, 1e5, "0",
             "Onboard pixel scale over the true one, minus 1."),
    BST_REAL(bst_camera_errors_config, rotation_error_deg, "deg", -180, 180, "0",
             "Onboard rotation of the focal plane minus the true one."),
    BST_BOOL(bst_camera_errors_config, override_distortion, "false",
             "Whether the onboard side has distortion coefficients of its own; false: it knows the "
             "camera's."),
    BST_FORMER("own_distortion", "override_distortion"),
    BST_OBJECT(bst_camera_errors_config, distortion, bst_distortion_config, "{}",
               "override_distortion: the coefficients on board."),
    BST_REAL(
        bst_camera_errors_config, throughput_error, "", -0.9, 9, "0",
        "Onboard throughput over the true one, minus 1: what the camera's own zero point is wrong "
        "by."),
    BST_REAL(bst_camera_errors_config, psf_fwhm_px, "px", 0, 16, "0",
             "The PSF on board is a Gaussian of this width; 0: it is the camera's own PSF."),
    BST_PATH(
        bst_camera_errors_config, psf_file, "\"\"",
        "FITS image of the PSF on board, relative to the scenario's folder, before integration "
        "over the pixel; instead of psf_fwhm_px."),
    BST_REAL(bst_camera_errors_config, psf_oversampling, "", 0, 1000, "0",
             "psf_file: samples per detector pixel and axis; 0: its keyword OVERSAMP."),
    BST_CONFIG_END,
};

static const bst_config_desc orbit_error_table[] = {
    BST_REALS(bst_orbit_error_config, position_rtn_m, "m", -1e8, 1e8, "[0, 0, 0]",
              "Believed minus true position along radius, transverse and normal."),
    BST_REALS(bst_orbit_error_config, velocity_rtn_mps, "m/s", -1e5, 1e5, "[0, 0, 0]",
              "Believed minus true velocity; it does not move the believed position."),
    BST_REAL(bst_orbit_error_config, along_track_drift_mps, "m/s", -1e5, 1e5, "0",
             "Growth of the transverse position error from the epoch on."),
    BST_FORMER("along_track_mps", "along_track_drift_mps"),
    BST_CONFIG_END,
};

static const bst_config_desc knowledge_table[] = {
    BST_PATH_OR(bst_knowledge_config, star_catalogue, catalogue_words, "\"\"",
                "Onboard star catalogue; empty: the world's own."),
    BST_OBJECT(bst_knowledge_config, stars, star_errors_table, "{}",
               "Errors of the onboard star catalogue."),
    BST_OBJECT(bst_knowledge_config, camera, camera_errors_table, "{}",
               "What is known of the camera otherwise than it is."),
    BST_REAL(bst_knowledge_config, clock_offset_s, "s", -1e6, 1e6, "0",
             "Onboard time minus true time: orbits and bodies are evaluated that much later."),
    BST_OBJECT(bst_knowledge_config, orbit, orbit_error_table, "{}",
               "Error of the onboard knowledge of the observer's own orbit."),
    BST_CONFIG_END,
};

static const char *const observation_sources[] = {"image", "generator", NULL};

const bst_config_desc bst_sensor_config_table[] = {
    BST_STRING(bst_sensor_config, name, "\"camera\"", "Name, unique on its observer."),
    BST_PATH(
        bst_sensor_config, frame_updates_file, "\"\"",
        "JSON file that drives the sensor frame by frame (docs/reference/file_formats.md, \"Frame "
        "updates\"), relative to the scenario's folder; empty: none."),
    BST_OBJECT(bst_sensor_config, camera, bst_camera_config, NULL, "Optics and detector."),
    BST_REALS(
        bst_sensor_config, x_axis_gcrf, "", -1, 1, "[0, 0, 1]",
        "Direction (GCRF) that the image's x axis lies closest to when the gimbal is at zero."),
    BST_OBJECT(bst_sensor_config, exposure, exposure_table, "{}", "Exposure clock."),
    BST_OBJECT(bst_sensor_config, cue, cue_table, "{}", "Where the target is believed to be."),
    BST_OBJECT(bst_sensor_config, knowledge, knowledge_table, "{}",
               "What the onboard side knows otherwise than it is."),
    BST_ENUM(bst_sensor_config, observation_source, observation_sources, "\"image\"",
             "Where detections come from: a rendered image that is processed (image), or the "
             "statistics of both without an image (generator): then the module obsgen replaces "
             "scenegen and imgproc and uses their settings."),
    {.key = "modules",
     .type = BST_CONFIG_RAW,
     .doc = "The modules of this sensor by role: {\"gimbal\": {\"type\": ...}, ...}."},
    BST_CONFIG_END,
};

const bst_config_desc bst_observer_config_table[] = {
    BST_STRING(bst_observer_config, name, NULL, "Name, unique in the scenario."),
    BST_OBJECT(bst_observer_config, orbit, orbit_table, NULL, "The observer's orbit."),
    BST_LIST(bst_observer_config, burns, bst_burn_config, burn_table, 0, 64, "[]",
             "Burns in the order of time."),
    BST_LIST(bst_observer_config, sensors, bst_sensor_config, bst_sensor_config_table, 1, 16, NULL,
             "Its sensors."),
    BST_CONFIG_END,
};
