/* Definitions of the tables of run.sqlite. recorder_rows.c fills the columns in this order. */
#include "sim/engine/recorder/recorder_internal.h"

#define INT(name, unit, doc) \
    { name, BST_COLUMN_INT, unit, doc }
#define REAL(name, unit, doc) \
    { name, BST_COLUMN_REAL, unit, doc }
#define TEXT(name, doc) \
    { name, BST_COLUMN_TEXT, "", doc }
#define SENSOR INT("sensor", "", "row of the table sensors")
#define EXPOSURE INT("exposure_id", "", "number of the exposure")
#define TICK INT("tick", "tick", "when it holds")
#define TIME REAL("time_s", "s", "tick over tick rate, since the epoch")
#define MID REAL("mid_s", "s", "middle of the exposure, since the epoch")
#define QUATERNION(name, doc)                                                     \
    REAL(name "_x", "", doc), REAL(name "_y", "", doc), REAL(name "_z", "", doc), \
        REAL(name "_w", "", doc)
#define VECTOR(name, tail, unit, doc)                                   \
    REAL(name "_x_" tail, unit, doc), REAL(name "_y_" tail, unit, doc), \
        REAL(name "_z_" tail, unit, doc)

/* State of a track and its covariance. */
#define STATE_COLUMNS                                                                             \
    REAL("ra_deg", "deg", "ICRS, geometric with light time"), REAL("dec_deg", "deg", "ICRS"),     \
        REAL("rate_east_arcsec_per_s", "arcsec/s", "rate along e1 (east)"),                       \
        REAL("rate_north_arcsec_per_s", "arcsec/s", "rate along e2 (north)"),                     \
        REAL("cov_d1_d1_rad2", "rad^2", "covariance of direction (d) and rate (r) along e1, e2"), \
        REAL("cov_d1_d2_rad2", "rad^2", "covariance"),                                            \
        REAL("cov_d2_d2_rad2", "rad^2", "covariance"),                                            \
        REAL("cov_d1_r1_rad2ps", "rad^2/s", "covariance"),                                        \
        REAL("cov_d1_r2_rad2ps", "rad^2/s", "covariance"),                                        \
        REAL("cov_d2_r1_rad2ps", "rad^2/s", "covariance"),                                        \
        REAL("cov_d2_r2_rad2ps", "rad^2/s", "covariance"),                                        \
        REAL("cov_r1_r1_rad2ps2", "rad^2/s^2", "covariance"),                                     \
        REAL("cov_r1_r2_rad2ps2", "rad^2/s^2", "covariance"),                                     \
        REAL("cov_r2_r2_rad2ps2", "rad^2/s^2", "covariance")

static const bst_io_column run_columns[] = {
    TEXT("program", "what made the run"),
    TEXT("epoch_utc", "UTC of tick 0"),
    INT("tick_rate_hz", "Hz", "ticks per second"),
};
static const bst_io_column sensor_columns[] = {
    SENSOR,
    TEXT("observer", "name of the observer"),
    TEXT("name", "name of the sensor"),
    TEXT("target", "what is looked for"),
    TEXT("file", "FITS file of its frames"),
    INT("width_px", "px", "columns"),
    INT("height_px", "px", "rows"),
    REAL("pixel_scale_arcsec", "arcsec/px", "at the boresight"),
};
static const bst_io_column frame_columns[] = {
    SENSOR,
    EXPOSURE,
    INT("start_tick", "tick", "start of the exposure"),
    INT("end_tick", "tick", "end of the exposure"),
    REAL("start_s", "s", "start of the exposure, since the epoch"),
    REAL("exposure_s", "s", "length of the exposure"),
    TEXT("start_utc", "start of the exposure"),
    INT("x0_px", "px", "corner of the window on the sensor"),
    INT("y0_px", "px", "corner of the window on the sensor"),
    INT("width_px", "px", "of the window on the sensor"),
    INT("height_px", "px", "of the window on the sensor"),
    INT("binning", "", "sensor pixels per pixel and axis"),
    INT("bits", "bit", "of the converter"),
    INT("fits_index", "", "extension (from 1) or plane (from 0) of the file; NULL: not kept"),
    REAL("crpix1", "px", "FITS pixel of the boresight, whole sensor"),
    REAL("crpix2", "px", "FITS pixel of the boresight, whole sensor"),
    REAL("crval1_deg", "deg", "ICRS right ascension there, aberration absorbed"),
    REAL("crval2_deg", "deg", "ICRS declination there, aberration absorbed"),
    REAL("cd1_1_deg", "deg/px", "TAN matrix"),
    REAL("cd1_2_deg", "deg/px", "TAN matrix"),
    REAL("cd2_1_deg", "deg/px", "TAN matrix"),
    REAL("cd2_2_deg", "deg/px", "TAN matrix"),
    REAL("wcs_residual_px", "px", "largest misfit of the WCS"),
};
static const bst_io_column exposure_columns[] = {
    SENSOR,
    EXPOSURE,
    INT("start_tick", "tick", "start of the exposure"),
    INT("end_tick", "tick", "end of the exposure"),
    MID,
    INT("dropped", "", "1: the frame was lost on its way"),
    QUATERNION("q_cam_from_gcrf_mid", "true attitude at mid exposure"),
    QUATERNION("q_cam_from_gcrf_mean", "true attitude, mean of the exposure"),
    REAL("boresight_ra_deg", "deg", "apparent direction of the mean boresight"),
    REAL("boresight_dec_deg", "deg", "apparent direction of the mean boresight"),
    REAL("boresight_x_px", "px", "boresight on the sensor"),
    REAL("boresight_y_px", "px", "boresight on the sensor"),
    VECTOR("observer_gcrf", "m", "m", "true place of the observer at mid exposure, geocentric"),
    VECTOR("observer_gcrf", "mps", "m/s", "true velocity of the observer, geocentric"),
    VECTOR("velocity_bary", "mps", "m/s", "velocity relative to the barycentre"),
    VECTOR("sun", "m", "m", "observer to Sun"),
    REAL("background_e", "e-/px", "expected sky electrons"),
    REAL("dark_e", "e-/px", "expected dark electrons"),
    REAL("earth_fraction", "", "of the window's area that the Earth's disc covers"),
    REAL("moon_fraction", "", "the same of the Moon"),
    REAL("sun_fraction", "", "the same of the Sun"),
    REAL("pixel_scale_arcsec", "arcsec/px", "at the boresight, in this exposure"),
    INT("sources", "", "sources with a truth item"),
    INT("lost", "", "sources that found no room"),
    INT("hits", "", "radiation hits on the sensor"),
    REAL("hits_e", "e-", "their charge"),
    REAL("error_sigma", "", "largest rendering error expected in any pixel, in its noise"),
    INT("nodes", "", "points that the sources' tracks became"),
    INT("one_track", "", "1: the stars shared one track"),
};
static const bst_io_column truth_columns[] = {
    SENSOR,
    EXPOSURE,
    REAL("mid_s", "s",
         "middle of the exposure, with a rolling shutter of the source's own row, since the epoch"),
    INT("item", "",
        "number of the source in its exposure, from 1: its pixels in segmentation.fits"),
    TEXT("kind", "star, object, star_ghost or object_ghost"),
    INT("id", "",
        "star: identity in the catalogue, from 2147483648 on statistical; object: index in the "
        "scenario"),
    INT("norad", "", "object: catalogue number, else 0"),
    INT("in_field", "", "1: the chief ray's mean place is on the window"),
    INT("occulted", "", "1: behind the Earth, a star also behind a satellite with a shape"),
    INT("saturated", "", "1: it fills pixels"),
    REAL("x_start_px", "px", "column of the chief ray at the start of the exposure"),
    REAL("y_start_px", "px", "row at the start"),
    REAL("x_mid_px", "px", "column at the middle"),
    REAL("y_mid_px", "px", "row at the middle"),
    REAL("x_end_px", "px", "column at the end"),
    REAL("y_end_px", "px", "row at the end"),
    REAL("x_chief_px", "px", "column of the chief ray, mean over the exposure: as the WCS has it"),
    REAL("y_chief_px", "px", "row of the chief ray, mean over the exposure"),
    REAL("x_centroid_px", "px", "column of the centroid of its light, the PSF's aberrations in it"),
    REAL("y_centroid_px", "px", "row of the centroid of its light"),
    REAL("ra_deg", "deg", "ICRS; star: catalogue place; object: geometric with light time"),
    REAL("dec_deg", "deg", "ICRS"),
    REAL("v_mag", "mag", "Johnson V; NULL: sends no light"),
    REAL("electrons", "e-", "detected in the exposure, whole PSF"),
    REAL("snr", "", "sqrt(sum s^2 / sigma^2), sigma without its own light"),
    REAL("sunlit_fraction", "", "object: of the Sun's disc"),
    REAL("phase_deg", "deg", "object: Sun - object - observer"),
    REAL("range_m", "m", "object: from the observer"),
};
static const bst_io_column object_columns[] = {
    INT("id", "", "index in the scenario: id in truth"),
    TEXT("name", "name"),
    INT("norad", "", "catalogue number, 0: none"),
    REAL("area_m2", "m^2", "cross-section of the sphere"),
    REAL("albedo", "", "of the sphere"),
};
static const bst_io_column los_truth_columns[] = {
    SENSOR,
    TICK,
    TIME,
    QUATERNION("q_cam_from_gcrf", "true attitude of the camera"),
    REAL("ra_deg", "deg", "apparent direction of the boresight"),
    REAL("dec_deg", "deg", "apparent direction of the boresight"),
};
static const bst_io_column detection_frame_columns[] = {
    SENSOR,
    EXPOSURE,
    INT("start_tick", "tick", "start of the exposure"),
    INT("end_tick", "tick", "end of the exposure"),
    MID,
    INT("written_tick", "tick", "when image processing was done"),
    QUATERNION("q_cam_from_gcrf", "onboard attitude used to identify stars"),
    QUATERNION("q_telemetry_from_gcrf", "telemetry's attitude alone"),
    REAL("background_e", "e-/px", "median background"),
    REAL("noise_e", "e-/px", "median noise"),
    REAL("threshold_snr", "", "detection threshold"),
    REAL("shared_xx_px2", "px^2", "covariance of a displacement that all streaks of stars share"),
    REAL("shared_xy_px2", "px^2", "the same"),
    REAL("shared_yy_px2", "px^2", "the same"),
    REAL("zero_point_mag", "mag", "V of one electron per second"),
    REAL("zero_point_sigma_mag", "mag", "its standard deviation; 0: of no stars"),
    INT("zero_point_stars", "", "stars that it comes from; 0: the camera's own figures"),
    INT("stars_identified", "", "stars identified"),
    INT("windows", "", "windows of the frame that were looked at; 0: all of it"),
    INT("detections", "", "detections kept"),
    INT("lost", "", "detections that found no room"),
    INT("bad_pixels", "", "pixels of the sensor that are learned to be bad"),
};
static const bst_io_column detection_columns[] = {
    SENSOR,
    EXPOSURE,
    MID,
    INT("item", "", "number of the detection in its frame"),
    TEXT("label", "unknown, star, object, artefact, hot_pixel or hit"),
    INT("star_id", "", "identity in the star catalogue, 0 when none"),
    REAL("x_px", "px", "column on the whole sensor, mid exposure"),
    REAL("y_px", "px", "row"),
    REAL("cov_xx_px2", "px^2", "covariance"),
    REAL("cov_xy_px2", "px^2", "covariance"),
    REAL("cov_yy_px2", "px^2", "covariance"),
    REAL("flux_e", "e-", "electrons"),
    REAL("flux_sigma_e", "e-", "its standard deviation"),
    REAL("snr", "", "signal to noise"),
    REAL("length_px", "px", "extent along the long axis"),
    REAL("width_px", "px", "extent across"),
    REAL("angle_deg", "deg", "long axis, from +x towards +y"),
    REAL("v_mag", "mag", "from the frame's zero point"),
    REAL("v_mag_sigma", "mag", "noise of the light and of the zero point; NULL: no light"),
    INT("saturated", "", "1: holds full pixels"),
    INT("edge", "", "1: touches the window's edge"),
    INT("streak", "", "1: longer than the PSF"),
    INT("blend", "", "1: several sources"),
    REAL("label_probability", "", "that the label is right; 0: unknown"),
    INT("stack", "", "1: seen in the sum of several frames, of which this is the last"),
    REAL("rate_x_pxps", "px/s", "stack: rate against the stars"),
    REAL("rate_y_pxps", "px/s", "stack: rate against the stars"),
    REAL("rate_sigma_pxps", "px/s", "standard deviation of each"),
    INT("bloom", "", "1: charge overflowed along its columns; placed by its wings"),
};
static const bst_io_column track_frame_columns[] = {
    SENSOR,
    EXPOSURE,
    TICK,
    TIME,
    INT("written_tick", "tick", "when the tracker was done"),
    INT("target_id", "", "track of interest, 0 when none"),
    INT("tracks", "", "tracks kept"),
    INT("lost", "", "tracks that found no room"),
    INT("at_rest", "",
        "tracks not reported: at rest among the stars, such as stars missing in the catalogue"),
    INT("attitude_valid", "", "1: attitude found from stars"),
    INT("attitude_stars", "", "stars used"),
    QUATERNION("attitude_q_cam_from_gcrf", "attitude from stars"),
    REAL("attitude_error_x_arcsec", "arcsec", "telemetry's error about camera x"),
    REAL("attitude_error_y_arcsec", "arcsec", "about camera y"),
    REAL("attitude_error_z_arcsec", "arcsec", "about the boresight"),
    REAL("attitude_sigma_x_arcsec", "arcsec", "standard deviation about camera x"),
    REAL("attitude_sigma_y_arcsec", "arcsec", "about camera y"),
    REAL("attitude_sigma_z_arcsec", "arcsec", "about the boresight"),
    REAL("attitude_correlation_xy", "", "correlation of the errors about camera x and y"),
    REAL("attitude_correlation_xz", "", "about camera x and the boresight"),
    REAL("attitude_correlation_yz", "", "about camera y and the boresight"),
    REAL("attitude_rms_px", "px", "residuals of the stars"),
    REAL("attitude_shared", "",
         "share of the variance about camera x and y that successive frames have in common"),
    REAL("clock_offset_s", "s", "onboard clock less true time, learnt from objects' places"),
    REAL("clock_sigma_s", "s", "standard deviation of it; both empty: not estimated"),
};
static const bst_io_column track_columns[] = {
    SENSOR,
    EXPOSURE,
    TICK,
    TIME,
    INT("track_id", "", "never reused"),
    TEXT("status", "tentative, confirmed or coasting"),
    INT("target_of_interest", "", "1: the target"),
    STATE_COLUMNS,
    REAL("v_mag", "mag", "brightness"),
    REAL("snr", "", "of the latest detection"),
    REAL("score", "", "log-likelihood ratio of an object against chance pairings"),
    INT("hits", "", "detections so far"),
    INT("misses_in_row", "", "frames without a detection"),
    INT("first_tick", "tick", "first detection"),
    INT("last_update_tick", "tick", "latest detection"),
    REAL("x_px", "px", "latest detection, whole sensor"),
    REAL("y_px", "px", "latest detection, whole sensor"),
    INT("uncorrelated", "", "1: confirmed, and neither the target nor what the cue expects"),
};
static const bst_io_column identity_columns[] = {
    SENSOR,
    EXPOSURE,
    TICK,
    TIME,
    INT("track_id", "", "as in tracks"),
    INT("object", "", "index in the scenario: id in truth; -1: none of the catalogue"),
    TEXT("name", "its name; NULL: none"),
    INT("norad", "", "its catalogue number, 0: none"),
    REAL("probability", "", "that the track is of this object; those below 0.001 are left out"),
};
static const bst_io_column smoothed_columns[] = {
    SENSOR,
    EXPOSURE,
    TICK,
    TIME,
    INT("track_id", "", "as in tracks"),
    TEXT("status", "in that frame: tentative, confirmed or coasting"),
    INT("target_of_interest", "", "1: the target in that frame"),
    INT("later_frames", "", "frames after it that contribute"),
    STATE_COLUMNS,
};
static const bst_io_column los_command_columns[] = {
    SENSOR,
    INT("written_tick", "tick", "when the command was written"),
    TICK,
    TIME,
    REAL("ra_deg", "deg", "apparent direction commanded at tick"),
    REAL("dec_deg", "deg", "apparent direction commanded at tick"),
    VECTOR("rate_gcrf", "radps", "rad/s", "rate of the direction"),
    VECTOR("accel_gcrf", "radps2", "rad/s^2", "its acceleration"),
};
static const bst_io_column sensor_command_columns[] = {
    SENSOR,
    TICK,
    TIME,
    REAL("exposure_s", "s", "0 or less: keep"),
    REAL("period_s", "s", "0 or less: keep"),
    INT("x0_px", "px", "window"),
    INT("y0_px", "px", "window"),
    INT("width_px", "px", "window; 0: whole sensor"),
    INT("height_px", "px", "window"),
    INT("binning", "", "0: keep"),
};
static const bst_io_column pointing_columns[] = {
    SENSOR,
    TICK,
    TIME,
    QUATERNION("q_cam_from_gcrf", "measured attitude of the camera"),
    REAL("axis_outer_deg", "deg", "encoder"),
    REAL("axis_inner_deg", "deg", "encoder"),
    QUATERNION("q_body_from_gcrf", "body attitude as the spacecraft believes it"),
    INT("settled", "", "1: the servo has settled"),
    INT("limited", "", "1: an axis is at a limit"),
};
#define AXIS(n)                                                            \
    REAL("axis" n "_deg", "deg", "encoder of the axis, with whole turns"), \
        REAL("axis" n "_rate_degps", "deg/s", "rate of the axis"),         \
        INT("axis" n "_flags", "", "1: stuck, 2: at a limit, 4: at a stop")
static const bst_io_column mount_columns[] = {
    SENSOR,
    TICK,
    TIME,
    INT("axes", "", "axes of the mount; 0: ideal"),
    AXIS("0"),
    AXIS("1"),
    AXIS("2"),
    VECTOR("body_rate", "degps", "deg/s", "measured rate of the body, body axes"),
    INT("wheels_saturated", "", "1: the spacecraft's wheels are"),
};
static const bst_io_column nav_columns[] = {
    SENSOR,
    TICK,
    TIME,
    VECTOR("position_gcrf", "m", "m", "the observer as the spacecraft believes it, geocentric"),
    VECTOR("velocity_gcrf", "mps", "m/s", "geocentric"),
};
static const bst_io_column control_columns[] = {
    SENSOR,
    TICK,
    TIME,
    TEXT("mode", "control mode"),
    INT("target_id", "", "track that is followed, 0 when none"),
    INT("search_step", "", "step of the search pattern"),
    REAL("aim_error_x_px", "px", "target from the boresight, as control believes"),
    REAL("aim_error_y_px", "px", "target from the boresight, as control believes"),
};
static const bst_io_column event_columns[] = {
    TICK,
    TIME,
    TEXT("source", "who reports it"),
    TEXT("kind", "fixed word"),
    TEXT("text", "what happened"),
};

static const bst_io_column task_columns[] = {
    SENSOR,
    INT("tick", "tick", "when it was given"),
    TIME,
    INT("task_id", "", "by sensor"),
    INT("object", "", "index in the scenario: id in truth; -1: the sensor's own cue"),
    TEXT("name", "name of the object"),
    INT("norad", "", "catalogue number, 0: none"),
    REAL("v_mag", "mag", "expected brightness"),
    REAL("snr", "", "expected signal to noise of a frame"),
    TEXT("before", "how the task before ended: none, done, not_found or lost"),
};

static const bst_io_column shape_columns[] = {
    SENSOR,
    EXPOSURE,
    MID,
    INT("item", "", "number of the source in its exposure: item in truth"),
    INT("id", "", "object: index in the scenario"),
    REAL("x_px", "px", "column of the centre of mass, the origin of the body, mid exposure"),
    REAL("y_px", "px", "row"),
    REAL("x_light_px", "px", "column of the centroid of light"),
    REAL("y_light_px", "px", "row"),
    REAL("x0_px", "px",
         "box around all parts that the Earth does not hide, lit or not, without the PSF; NULL: "
         "behind the camera, or none"),
    REAL("y0_px", "px", "lowest row"),
    REAL("x1_px", "px", "highest column"),
    REAL("y1_px", "px", "highest row"),
    REAL("size_px", "px", "largest extent of these parts"),
    REAL("visible", "", "share of the light that the Earth's limb leaves, 0 to 1"),
    QUATERNION("q_body_from_gcrf", "attitude of the body at mid exposure"),
    REAL("phase_deg", "deg", "Sun - object - observer"),
    REAL("range_m", "m", "from the observer"),
};
static const bst_io_column extended_columns[] = {
    SENSOR,
    EXPOSURE,
    MID,
    INT("item", "", "number of the detection in its frame: item in detections"),
    REAL("x_px", "px", "column of the estimated centre of mass, mid exposure"),
    REAL("y_px", "px", "row"),
    REAL("x_light_px", "px", "column of the centroid of light"),
    REAL("y_light_px", "px", "row"),
    REAL("x0_px", "px", "box"),
    REAL("y0_px", "px", "lowest row"),
    REAL("x1_px", "px", "highest column"),
    REAL("y1_px", "px", "highest row"),
    REAL("size_px", "px", "largest extent of the outline"),
    REAL("size_sigma_px", "px", "its standard deviation"),
    REAL("area_px2", "px^2", "of the silhouette, dark holes filled"),
    REAL("saturated_share", "", "share of the area that is saturated"),
    REAL("phase_deg", "deg", "Sun - target - observer, by the onboard Sun"),
    REAL("range_m", "m", "from the known size or model; NULL: unknown"),
    REAL("range_sigma_m", "m", "its standard deviation"),
};

static const bst_io_column region_columns[] = {
    SENSOR,
    EXPOSURE,
    MID,
    INT("window", "",
        "number of the window in its frame, from 0; windows that touched are one, with a row for "
        "each reason"),
    INT("x0_px", "px", "first column of the window on the whole sensor"),
    INT("y0_px", "px", "first row"),
    INT("width_px", "px", "of the window, in pixels of the sensor"),
    INT("height_px", "px", "of the window, in pixels of the sensor"),
    TEXT("reason", "target, track or star: what was expected there"),
    INT("track_id", "", "as in tracks; 0: a star"),
    INT("star_id", "", "identity in the star catalogue, 0: a track"),
    REAL("x_px", "px", "column where it was expected, mid exposure, whole sensor"),
    REAL("y_px", "px", "row where it was expected"),
};
static const bst_io_column wheel_columns[] = {
    SENSOR,
    TICK,
    TIME,
    INT("wheel", "", "index in the configuration, from 0"),
    REAL("speed_rpm", "rpm", "relative to the body"),
    REAL("speed_limit_rpm", "rpm", "in both directions"),
    REAL("motor_nm", "N m", "commanded torque of the motor on the wheel"),
    REAL("motor_limit_nm", "N m", "in both directions; 0: the wheel has failed"),
};

static const bst_io_column part_columns[] = {
    INT("number", "", "value of its pixels in parts.fits, from 1"),
    INT("id", "", "object: index in the scenario"),
    TEXT("object", "name of the object"),
    TEXT("part", "name of the part in the shape"),
};

static const bst_io_column calibration_columns[] = {
    SENSOR,
    EXPOSURE,
    MID,
    INT("frames", "", "frames that were measured so far"),
    REAL("scale", "", "true pixel scale over the onboard one"),
    REAL("rotation_rad", "rad", "added to the onboard rotation of the focal plane"),
    REAL("k1", "", "added to the onboard radial distortion"),
    REAL("p1", "", "added to the onboard tangential distortion"),
    REAL("p2", "", "added to the onboard tangential distortion"),
    REAL("cov_scale_scale", "", "covariance"),
    REAL("cov_scale_rotation", "rad", "covariance"),
    REAL("cov_scale_k1", "", "covariance"),
    REAL("cov_scale_p1", "", "covariance"),
    REAL("cov_scale_p2", "", "covariance"),
    REAL("cov_rotation_rotation", "rad^2", "covariance"),
    REAL("cov_rotation_k1", "rad", "covariance"),
    REAL("cov_rotation_p1", "rad", "covariance"),
    REAL("cov_rotation_p2", "rad", "covariance"),
    REAL("cov_k1_k1", "", "covariance"),
    REAL("cov_k1_p1", "", "covariance"),
    REAL("cov_k1_p2", "", "covariance"),
    REAL("cov_p1_p1", "", "covariance"),
    REAL("cov_p1_p2", "", "covariance"),
    REAL("cov_p2_p2", "", "covariance"),
};

typedef struct table_spec {
    const char *name, *doc;
    const bst_io_column *columns;
    int count;
} table_spec;

#define SPEC(name, columns, doc) \
    { name, doc, columns, (int)(sizeof columns / sizeof *columns) }

static const table_spec specs[BST_TABLE_COUNT] = {
    [BST_TABLE_RUN] = SPEC("run", run_columns, "The run."),
    [BST_TABLE_SENSORS] = SPEC("sensors", sensor_columns, "The recorded sensors."),
    [BST_TABLE_FRAMES] = SPEC("frames", frame_columns, "Frames as delivered, with their WCS."),
    [BST_TABLE_EXPOSURES] =
        SPEC("exposures", exposure_columns, "True state of the sensor in each exposure."),
    [BST_TABLE_TRUTH] = SPEC("truth", truth_columns, "True sources in each exposure."),
    [BST_TABLE_OBJECTS] =
        SPEC("objects", object_columns, "The objects that came to be in truth, once each."),
    [BST_TABLE_LOS_TRUTH] =
        SPEC("los_truth", los_truth_columns, "True line of sight, at the telemetry's rate."),
    [BST_TABLE_DETECTION_FRAMES] =
        SPEC("detection_frames", detection_frame_columns, "Image processing of each frame."),
    [BST_TABLE_DETECTIONS] = SPEC("detections", detection_columns, "Detections."),
    [BST_TABLE_TRACK_FRAMES] = SPEC("track_frames", track_frame_columns,
                                    "The tracker after each frame, with the attitude from stars."),
    [BST_TABLE_TRACKS] = SPEC("tracks", track_columns, "Tracks after each frame."),
    [BST_TABLE_LOS_COMMANDS] = SPEC("los_commands", los_command_columns, "Commands to the gimbal."),
    [BST_TABLE_SENSOR_COMMANDS] =
        SPEC("sensor_commands", sensor_command_columns, "Commands to the sensor."),
    [BST_TABLE_POINTING] = SPEC("pointing", pointing_columns, "Pointing telemetry."),
    [BST_TABLE_MOUNT] = SPEC("mount", mount_columns, "The mount's axes, from the body outwards."),
    [BST_TABLE_NAV] = SPEC("nav", nav_columns, "Navigation telemetry."),
    [BST_TABLE_CONTROL] =
        SPEC("control", control_columns, "Control, at the telemetry's rate and at each change."),
    [BST_TABLE_EVENTS] = SPEC("events", event_columns, "Events."),
    [BST_TABLE_TASKS] = SPEC("tasks", task_columns, "What the sensors were given to look for."),
    [BST_TABLE_SHAPES] =
        SPEC("shapes", shape_columns, "True outline and attitude of objects with a shape."),
    [BST_TABLE_EXTENDED] =
        SPEC("extended_targets", extended_columns, "Detections larger than the PSF."),
    [BST_TABLE_CAMERA_CALIBRATION] =
        SPEC("camera_calibration", calibration_columns,
             "Geometry of the camera as image processing has learned it from stars."),
    [BST_TABLE_TRACK_IDENTITIES] =
        SPEC("track_identities", identity_columns,
             "Probabilities of confirmed tracks over the objects of the onboard catalogue."),
    [BST_TABLE_TRACKS_SMOOTHED] =
        SPEC("tracks_smoothed", smoothed_columns,
             "Tracks of each frame given later frames too (tracker, smoothing_lag_frames)."),
    [BST_TABLE_REGIONS_OF_INTEREST] =
        SPEC("regions_of_interest", region_columns,
             "Windows of a frame that image processing searched; none: the whole frame."),
    [BST_TABLE_WHEELS] = SPEC("wheels", wheel_columns, "Reaction wheels of the spacecraft."),
    [BST_TABLE_PARTS] = SPEC("parts", part_columns, "Parts of the objects with a shape."),
};

/* True if an object of the world has a shape. */
static bool has_shapes(const bst_recorder *recorder) {
    int count = recorder->world ? bst_world_object_count(recorder->world) : 0;
    for (int i = 0; i < count; i++) {
        if (bst_world_object(recorder->world, i)->shape) {
            return true;
        }
    }
    return false;
}

static bool wanted(const bst_recorder *recorder, bst_recorder_table table) {
    const bst_recorder_config *config = &recorder->config;
    switch (table) {
        case BST_TABLE_EXPOSURES:
        case BST_TABLE_TRUTH:
        case BST_TABLE_OBJECTS:
            return config->truth;
        case BST_TABLE_LOS_TRUTH:
            return config->truth && config->telemetry_hz > 0.0;
        case BST_TABLE_DETECTION_FRAMES:
        case BST_TABLE_DETECTIONS:
        case BST_TABLE_CAMERA_CALIBRATION:
            return config->detections;
        case BST_TABLE_TRACK_FRAMES:
        case BST_TABLE_TRACKS:
        case BST_TABLE_TRACKS_SMOOTHED:
        case BST_TABLE_TRACK_IDENTITIES:
            return config->tracks;
        case BST_TABLE_LOS_COMMANDS:
        case BST_TABLE_SENSOR_COMMANDS:
            return config->commands;
        case BST_TABLE_POINTING:
        case BST_TABLE_MOUNT:
        case BST_TABLE_NAV:
        case BST_TABLE_CONTROL:
            return config->telemetry_hz > 0.0;
        case BST_TABLE_EVENTS:
        case BST_TABLE_TASKS:
            return config->events;
        case BST_TABLE_REGIONS_OF_INTEREST:
            return config->detections && recorder->has_regions;
        case BST_TABLE_WHEELS:
            return config->telemetry_hz > 0.0 && recorder->has_wheels;
        case BST_TABLE_SHAPES:
            return config->truth && has_shapes(recorder);
        case BST_TABLE_EXTENDED:
            return config->detections && has_shapes(recorder);
        case BST_TABLE_PARTS:
            return config->planes & UINT32_C(1) << BST_PLANE_PARTS;
        default:
            return true;
    }
}

bst_status bst_recorder_make_tables(bst_ctx *ctx, bst_recorder *recorder) {
    for (int i = 0; i < BST_TABLE_COUNT; i++) {
        /* a run that goes on keeps the tables that it had: a change of the scenario may need fewer
         */
        if (wanted(recorder, (bst_recorder_table)i) ||
            (bst_run_is_reopened(recorder->run) &&
             bst_run_has_table(recorder->run, specs[i].name))) {
            BST_TRY(bst_io_table_create(ctx, recorder->run, specs[i].name, specs[i].doc,
                                        specs[i].columns, specs[i].count, &recorder->tables[i]));
        }
    }
    return BST_OK;
}
