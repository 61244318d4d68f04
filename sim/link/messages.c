/* Field tables of all link messages. */
#include <math.h>
#include <string.h>

#include "sim/link/payloads.h"
#include "sim/link/wire.h"

_Static_assert(sizeof(int) == 4, "windows are four int32");

#define FIELD_(s, m, type_, count_, check_, min_, max_, unit_, doc_) \
    { #m, type_, count_, check_, min_, max_, offsetof(s, m), unit_, doc_ }
#define ANY(s, m, unit, doc) FIELD_(s, m, BST_WIRE_F64, 1, BST_WIRE_ANY, 0, 0, unit, doc)
#define REAL(s, m, unit, doc) FIELD_(s, m, BST_WIRE_F64, 1, BST_WIRE_FINITE, 0, 0, unit, doc)
#define REALS(s, m, n, unit, doc) FIELD_(s, m, BST_WIRE_F64, n, BST_WIRE_FINITE, 0, 0, unit, doc)
#define BOUNDED(s, m, min, max, unit, doc) \
    FIELD_(s, m, BST_WIRE_F64, 1, BST_WIRE_RANGE, min, max, unit, doc)
#define BOUNDED3(s, m, min, max, unit, doc) \
    FIELD_(s, m, BST_WIRE_F64, 3, BST_WIRE_RANGE, min, max, unit, doc)
#define VECTOR(s, m, unit, doc) REALS(s, m, 3, unit, doc)
#define DIRECTION(s, m, doc) FIELD_(s, m, BST_WIRE_F64, 3, BST_WIRE_UNIT, 0, 0, "", doc)
#define ATTITUDE(s, m, doc) FIELD_(s, m, BST_WIRE_F64, 4, BST_WIRE_UNIT, 0, 0, "", doc)
#define MAYBE_ATTITUDE(s, m, doc) \
    FIELD_(s, m, BST_WIRE_F64, 4, BST_WIRE_UNIT_OR_ZERO, 0, 0, "", doc)
#define TICK(s, m, doc) FIELD_(s, m, BST_WIRE_I64, 1, BST_WIRE_RANGE, -9e15, 9e15, "tick", doc)
#define NUMBER(s, m, min, doc) FIELD_(s, m, BST_WIRE_I64, 1, BST_WIRE_RANGE, min, 9e15, "", doc)
#define INT(s, m, min, max, unit, doc) \
    FIELD_(s, m, BST_WIRE_I32, 1, BST_WIRE_RANGE, min, max, unit, doc)
#define BITS(s, m, doc) FIELD_(s, m, BST_WIRE_U32, 1, BST_WIRE_ANY, 0, 0, "", doc)
#define BOOLEAN(s, m, doc) FIELD_(s, m, BST_WIRE_BOOL, 1, BST_WIRE_ANY, 0, 0, "", doc)
#define COUNT(s, doc) FIELD_(s, count, BST_WIRE_I32, 1, BST_WIRE_COUNT, 0, 0, "", doc)
#define TEXT(s, m, doc) \
    FIELD_(s, m, BST_WIRE_TEXT, (int)sizeof(((s *)0)->m), BST_WIRE_ANY, 0, 0, "ASCII", doc)
#define WINDOW(s, m)                                                           \
    INT(s, m.x0, 0, 65535, "px", "Window: first column, full-sensor pixels."), \
        INT(s, m.y0, 0, 65535, "px", "First row."),                            \
        INT(s, m.width, 0, 65536, "px", "Columns; 0: the full sensor."),       \
        INT(s, m.height, 0, 65536, "px", "Rows.")
#define END \
    { 0 }

#define MANY 2147483647.0

static const bst_wire_field hello[] = {
    TEXT(bst_link_hello, name, "Who comes, for messages."),
    TEXT(bst_link_hello, serves,
         "Parts that it plays: `observer/sensor/module`, or `module` of any sensor; several with "
         "commas between; `*`: all."),
    BOOLEAN(bst_link_hello, shared_memory,
            "It is on the same machine and takes frames by shared memory where they are offered."),
    END};

static const bst_wire_field welcome[] = {
    TEXT(bst_link_welcome, scenario, "Name of the scenario."),
    TEXT(bst_link_welcome, epoch_utc, "Instant of tick 0."),
    NUMBER(bst_link_welcome, tick_rate_hz, 1, "Ticks per second."),
    TICK(bst_link_welcome, duration_ticks, "Length of the run."),
    REAL(bst_link_welcome, timeout_s, "s", "For which the simulation waits in each step."),
    TEXT(bst_link_welcome, shared_memory,
         "Name of the object that frames lie in (a file of /dev/shm); empty: they come by the "
         "socket."),
    NUMBER(bst_link_welcome, slot_bytes, 0, "Bytes of each of its slots, a multiple of 8."),
    INT(bst_link_welcome, slots, 0, 64, "", "Its slots."),
    COUNT(bst_link_welcome, "Parts that this peer plays now."),
    END};

static const bst_wire_field welcome_parts[] = {
    TEXT(bst_link_part, instance, "`observer/sensor/module`: the header's `instance`."),
    TEXT(bst_link_part, role, "`imgproc`, `tracker`, `control`, `gimbal`."),
    INT(bst_link_part, width_px, 0, 65536, "px", "Columns of the sensor."),
    INT(bst_link_part, height_px, 0, 65536, "px", "Rows."),
    INT(bst_link_part, bits, 0, 16, "", "Of a pixel's number."),
    REAL(bst_link_part, pixel_scale_rad, "rad", "Angle of a pixel at the boresight."),
    REALS(bst_link_part, boresight_px, 2, "px", "x, y of the boresight on the focal plane."),
    REAL(bst_link_part, psf_fwhm_px, "px", "Width of a star's image."),
    REAL(bst_link_part, gain_e_per_dn, "e/DN", "Electrons per digital number."),
    REAL(bst_link_part, offset_dn, "DN", "Added before conversion."),
    REAL(bst_link_part, read_noise_e, "e", "Standard deviation."),
    REAL(bst_link_part, dark_e_per_s, "e/s", "Dark current of a pixel."),
    REAL(bst_link_part, full_well_e, "e", "Most electrons of a pixel."),
    REAL(bst_link_part, flux_v0_e_per_s, "e/s", "Of a star of V = 0."),
    REAL(bst_link_part, exposure_s, "s", "Exposure as the scenario has it."),
    REAL(bst_link_part, period_s, "s", "From one exposure's start to the next one's."),
    TICK(bst_link_part, period_ticks, "Of the part's own steps; 0: on its inputs alone."),
    END};

static const bst_wire_field step[] = {
    INT(bst_link_step, inputs, 0, MANY, "", "Messages that belonged to it."),
    INT(bst_link_step, attempt, 0, MANY, "",
        "How often it has been sent before: again after each `hello` in its course."),
    END};

static const bst_wire_field done[] = {
    INT(bst_link_done, outputs, 0, MANY, "", "Messages that belonged to it."),
    BOUNDED(bst_link_done, busy_s, 0, 1e9, "s", "Wall time of the peer's work; 0: unknown."), END};

static const bst_wire_field error[] = {
    FIELD_(bst_link_error, sequence, BST_WIRE_I64, 1, BST_WIRE_RANGE, -1, 9e15, "",
           "Of the message that was not taken; -1: it could not be read."),
    TEXT(bst_link_error, fault, "Its counter, below."),
    TEXT(bst_link_error, text, "What was wrong, and what is allowed."), END};

static const bst_wire_field health[] = {
    INT(bst_link_health, state, 0, 2, "",
        "0 well, 1 degraded, 2 failed: the simulation ends the run."),
    TEXT(bst_link_health, text, "In words, for the log."), END};

static const bst_wire_field end[] = {
    INT(bst_link_end, reason, 0, 3, "", "0 complete, 1 interrupted, 2 failed, 3 the peer leaves."),
    TEXT(bst_link_end, text, "In words, for the log."), END};

static const bst_wire_field frame[] = {
    NUMBER(bst_link_frame, exposure_id, 0, "0, 1, 2, ..."),
    TICK(bst_link_frame, start_tick, "Start of the exposure."),
    TICK(bst_link_frame, end_tick, "Its end."),
    WINDOW(bst_link_frame, window),
    INT(bst_link_frame, binning, 1, 64, "", "Pixels of the sensor along a side of one here."),
    INT(bst_link_frame, bits, 1, 16, "", "Of a pixel's number."),
    INT(bst_link_frame, width, 1, 65536, "px", "Columns of the image: window over binning."),
    INT(bst_link_frame, height, 1, 65536, "px", "Its rows."),
    END};

static const bst_wire_field truth[] = {
    NUMBER(bst_truth, exposure_id, 0, "Exposure."),
    TICK(bst_truth, start_tick, "Its start."),
    TICK(bst_truth, end_tick, "Its end."),
    BOOLEAN(bst_truth, dropped, "The frame was lost on its way."),
    COUNT(bst_truth, "Items."),
    INT(bst_truth, lost, 0, MANY, "", "Sources that found no room."),
    INT(bst_truth, hits, 0, MANY, "", "Radiation hits."),
    ATTITUDE(bst_truth, q_cam_from_gcrf_mid, "True attitude, mid-exposure."),
    ATTITUDE(bst_truth, q_cam_from_gcrf_mean, "Averaged over the exposure."),
    VECTOR(bst_truth, observer_gcrf_m, "m", "Place of the observer, mid-exposure."),
    VECTOR(bst_truth, observer_gcrf_mps, "m/s", "Its velocity."),
    ANY(bst_truth, boresight_x_px, "px", "Where the boresight meets the focal plane."),
    ANY(bst_truth, boresight_y_px, "px", "The same."),
    ANY(bst_truth, background_e, "e", "Expected per pixel, sky."),
    ANY(bst_truth, dark_e, "e", "Expected per pixel, dark current."),
    END};

static const bst_wire_field truth_items[] = {
    INT(bst_truth_item, kind, 0, 3, "", "0 star, 1 object, 2 ghost of a star, 3 of an object."),
    BITS(bst_truth_item, id,
         "Star: identity in the catalogue or statistical (bit 31); object: its index."),
    INT(bst_truth_item, norad, -MANY, MANY, "", "Object: catalogue number, else 0."),
    BITS(bst_truth_item, flags, "1 in the field, 2 occulted, 4 saturated."),
    ANY(bst_truth_item, x_start_px, "px",
        "Chief ray at the exposure's start, NaN behind the camera."),
    ANY(bst_truth_item, y_start_px, "px", "The same."),
    ANY(bst_truth_item, x_mid_px, "px", "In its middle."),
    ANY(bst_truth_item, y_mid_px, "px", "The same."),
    ANY(bst_truth_item, x_end_px, "px", "At its end."),
    ANY(bst_truth_item, y_end_px, "px", "The same."),
    ANY(bst_truth_item, x_chief_px, "px", "Chief ray, mean over the exposure."),
    ANY(bst_truth_item, y_chief_px, "px", "The same."),
    ANY(bst_truth_item, x_centroid_px, "px", "Centroid of the light, the PSF's aberrations in it."),
    ANY(bst_truth_item, y_centroid_px, "px", "The same."),
    ANY(bst_truth_item, ra_rad, "rad", "Right ascension (ICRS)."),
    ANY(bst_truth_item, dec_rad, "rad", "Declination."),
    ANY(bst_truth_item, v_mag, "mag", "V."),
    ANY(bst_truth_item, electrons, "e", "In the exposure, whole PSF."),
    ANY(bst_truth_item, snr, "", "Of the best filter."),
    ANY(bst_truth_item, range_m, "m", "Object: distance, mid-exposure."),
    END};

static const bst_wire_field pointing_telemetry[] = {
    NUMBER(bst_link_pointing_telemetry, first, 0, "Number of the first sample here, from 0."),
    INT(bst_link_pointing_telemetry, capacity, 0, 16777216, "",
        "How many samples back the modules on board can look."),
    COUNT(bst_link_pointing_telemetry, "Samples that are new since the message before."),
    ATTITUDE(bst_link_pointing_telemetry, q_body_from_gcrf, "Of the body, as it is believed."),
    BOOLEAN(bst_link_pointing_telemetry, settled, "The servo is within its settling tolerance."),
    BOOLEAN(bst_link_pointing_telemetry, limited, "An axis is at a limit."),
    END};

static const bst_wire_field pointing_samples[] = {
    TICK(bst_pointing_sample, tick, "When."),
    ATTITUDE(bst_pointing_sample, q_cam_from_gcrf, "Measured: attitude estimate and encoders."),
    REALS(bst_pointing_sample, axis_rad, 2, "rad", "Encoder readings, outer and inner axis."), END};

static const bst_wire_field nav_telemetry[] = {
    TICK(bst_nav_telemetry, tick, "Of validity."),
    VECTOR(bst_nav_telemetry, position_gcrf_m, "m", "Geocentric."),
    VECTOR(bst_nav_telemetry, velocity_gcrf_mps, "m/s", "Geocentric."),
    VECTOR(bst_nav_telemetry, velocity_bary_mps, "m/s", "To the barycentre, for aberration."),
    VECTOR(bst_nav_telemetry, sun_m, "m", "Observer to Sun."),
    VECTOR(bst_nav_telemetry, moon_m, "m", "Observer to Moon."),
    END};

#define AXIS(k)                                                                           \
    REALS(bst_mount_status, axis[k].axis_body, 3, "",                                     \
          "What axis " #k " turns about at angles of zero."),                             \
        REAL(bst_mount_status, axis[k].angle_rad, "rad", "Encoder, with whole turns."),   \
        REAL(bst_mount_status, axis[k].rate_radps, "rad/s", "Its rate."),                 \
        REAL(bst_mount_status, axis[k].rate_limit_radps, "rad/s", "Limit; 0: none."),     \
        REAL(bst_mount_status, axis[k].accel_limit_radps2, "rad/s2", "Limit; 0: none."),  \
        REAL(bst_mount_status, axis[k].min_rad, "rad", "Travel; both 0: without end."),   \
        REAL(bst_mount_status, axis[k].max_rad, "rad", "The same."),                      \
        BOOLEAN(bst_mount_status, axis[k].redundant, "Not needed to reach a direction."), \
        BITS(bst_mount_status, axis[k].flags, "1 stuck, 2 saturated, 4 at a stop.")

static const bst_wire_field mount_status[] = {
    TICK(bst_mount_status, tick, "Of validity."),
    INT(bst_mount_status, axes, 0, BST_MOUNT_AXES, "", "0: follows any command at once."),
    BOOLEAN(bst_mount_status, wheels_saturated, "Of the body."),
    ATTITUDE(bst_mount_status, q_body_from_cam_at_zero, "With all angles zero."),
    ATTITUDE(bst_mount_status, q_body_from_gcrf, "Measured."),
    VECTOR(bst_mount_status, rate_body_radps, "rad/s", "Of the body, in its axes."),
    AXIS(0),
    AXIS(1),
    AXIS(2),
    REALS(bst_mount_status, roll.axis_body, 3, "", "What the body turns about; 0: it does not."),
    REAL(bst_mount_status, roll.angle_rad, "rad", "Its angle."),
    REAL(bst_mount_status, roll.rate_radps, "rad/s", "Its rate."),
    REAL(bst_mount_status, roll.rate_limit_radps, "rad/s", "Limit."),
    REAL(bst_mount_status, roll.accel_limit_radps2, "rad/s2", "Limit."),
    END};

static const bst_wire_field detections[] = {
    NUMBER(bst_detections, exposure_id, 0, "Of the frame that was looked at."),
    TICK(bst_detections, start_tick, "Start of its exposure."),
    TICK(bst_detections, end_tick, "Its end."),
    MAYBE_ATTITUDE(bst_detections, q_cam_from_gcrf,
                   "Used to identify stars, mid-exposure; all 0: not known."),
    MAYBE_ATTITUDE(bst_detections, q_telemetry_from_gcrf, "Of the telemetry alone."),
    REAL(bst_detections, background_e, "e", "Median per pixel."),
    REAL(bst_detections, noise_e, "e", "Median per pixel."),
    REAL(bst_detections, threshold_snr, "", "What was looked for."),
    BOUNDED(bst_detections, shared_xx, 0, 1e12, "px2",
            "Covariance of a displacement that all streaks of stars share."),
    BOUNDED(bst_detections, shared_xy, -1e12, 1e12, "px2", "The same."),
    BOUNDED(bst_detections, shared_yy, 0, 1e12, "px2", "The same."),
    ANY(bst_detections, zero_point_mag, "mag", "V of one electron per second."),
    ANY(bst_detections, zero_point_sigma_mag, "mag", "1 sigma of it."),
    INT(bst_detections, zero_point_stars, 0, MANY, "", "Stars that gave it."),
    INT(bst_detections, stars_identified, 0, MANY, "", "Of the items, those with a star_id."),
    INT(bst_detections, windows, 0, MANY, "", "Of the frame that were looked at; 0: all of it."),
    COUNT(bst_detections, "Items."),
    INT(bst_detections, lost, 0, MANY, "", "Detections that found no room."),
    INT(bst_detections, bad_pixels, 0, MANY, "", "Of the sensor, that are learned to be bad."),
    INT(bst_detections, calibration.frames, 0, MANY, "",
        "Of which the camera's geometry was learned; 0: none, and what follows is 0."),
    BOUNDED(bst_detections, calibration.scale, 0, 10, "", "True pixel scale over the onboard one."),
    REAL(bst_detections, calibration.rotation_rad, "rad", "Added to the focal plane's rotation."),
    REAL(bst_detections, calibration.k1, "", "Added to the radial distortion."),
    REAL(bst_detections, calibration.p1, "", "Added to the tangential distortion."),
    REAL(bst_detections, calibration.p2, "", "The same."),
    REALS(bst_detections, calibration.covariance, 25, "", "Of the five, row by row."),
    END};

static const bst_wire_field detection_items[] = {
    REAL(bst_detection, x_px, "px", "Centroid, full-sensor pixels, mid-exposure."),
    REAL(bst_detection, y_px, "px", "The same."),
    BOUNDED(bst_detection, cov_xx, 0, 1e12, "px2", "Its covariance."),
    BOUNDED(bst_detection, cov_xy, -1e12, 1e12, "px2", "The same."),
    BOUNDED(bst_detection, cov_yy, 0, 1e12, "px2", "The same."),
    REAL(bst_detection, flux_e, "e", "Electrons in the exposure."),
    REAL(bst_detection, flux_sigma_e, "e", "1 sigma of it."),
    REAL(bst_detection, snr, "", "Signal to noise."),
    REAL(bst_detection, length_px, "px", "Extent along."),
    REAL(bst_detection, width_px, "px", "Extent across."),
    REAL(bst_detection, angle_rad, "rad", "Of the long axis, from +x towards +y."),
    ANY(bst_detection, v_mag, "mag", "V."),
    ANY(bst_detection, v_mag_sigma, "mag", "1 sigma of it; infinite without light."),
    BITS(bst_detection, flags,
         "1 saturated, 2 edge, 4 streak, 8 blend, 16 stack, 32 bloom, 64 extended, "
         "128 other path."),
    BITS(bst_detection, star_id, "Identity in the star catalogue, 0 when none."),
    INT(bst_detection, label, 0, 5, "",
        "0 unknown, 1 star, 2 object, 3 artefact, 4 hot pixel, 5 radiation hit."),
    BOUNDED(bst_detection, label_probability, 0, 1, "", "That the label is right."),
    REAL(bst_detection, rate_x_pxps, "px/s", "Against the stars; only of a stack."),
    REAL(bst_detection, rate_y_pxps, "px/s", "The same."),
    REAL(bst_detection, rate_sigma_pxps, "px/s", "1 sigma of each."),
    REAL(bst_detection, extent.light_x_px, "px",
         "Of an extended target: centroid of light; this and what follows is 0 without the flag."),
    REAL(bst_detection, extent.light_y_px, "px", "The same."),
    REAL(bst_detection, extent.x0_px, "px", "Box: lowest column."),
    REAL(bst_detection, extent.y0_px, "px", "Lowest row."),
    REAL(bst_detection, extent.x1_px, "px", "Highest column."),
    REAL(bst_detection, extent.y1_px, "px", "Highest row."),
    BOUNDED(bst_detection, extent.size_px, 0, 1e9, "px", "Largest extent of the outline."),
    BOUNDED(bst_detection, extent.size_sigma_px, 0, 1e9, "px", "1 sigma of it."),
    BOUNDED(bst_detection, extent.area_px2, 0, 1e12, "px2", "Of the silhouette, holes filled."),
    BOUNDED(bst_detection, extent.phase_rad, 0, 3.1416, "rad",
            "Sun - target - observer, by the onboard Sun."),
    BOUNDED(bst_detection, extent.saturated_share, 0, 1, "", "Of the area, that is saturated."),
    BOUNDED(bst_detection, extent.range_m, 0, 1e15, "m",
            "From the known size or model; 0: not known."),
    BOUNDED(bst_detection, extent.range_sigma_m, 0, 1e15, "m", "1 sigma of it."),
    END};

static const bst_wire_field predictions[] = {
    TICK(bst_predictions, tick, "Of validity."),
    BOOLEAN(bst_predictions, attitude_valid, "The two vectors below hold."),
    COUNT(bst_predictions, "Items."),
    INT(bst_predictions, lost, 0, MANY, "", "Tracks that found no room."),
    VECTOR(bst_predictions, attitude_error_cam_rad, "rad",
           "Telemetry's error, a rotation vector in camera axes."),
    VECTOR(bst_predictions, attitude_error_rate_cam_radps, "rad/s", "Its rate."),
    END};

static const bst_wire_field prediction_items[] = {
    NUMBER(bst_prediction, track_id, 0, "Track."),
    DIRECTION(bst_prediction, direction_gcrf, "Geometric, at the record's tick."),
    VECTOR(bst_prediction, rate_gcrf_radps, "rad/s", "Its rate."),
    BOUNDED(bst_prediction, sigma_rad, 0, 1e3, "rad", "1 sigma per axis."),
    BOOLEAN(bst_prediction, target_of_interest, "It is what is looked for."),
    END};

#define FIX(m) attitude.m
static const bst_wire_field tracks[] = {
    NUMBER(bst_tracks, exposure_id, 0, "Of the frame."),
    TICK(bst_tracks, tick, "Of validity: mid-exposure."),
    BOOLEAN(bst_tracks, FIX(valid), "Stars gave an attitude."),
    INT(bst_tracks, FIX(stars), 0, MANY, "", "How many."),
    TICK(bst_tracks, FIX(tick), "Mid-exposure."),
    MAYBE_ATTITUDE(bst_tracks, FIX(q_cam_from_gcrf), "From stars."),
    VECTOR(bst_tracks, FIX(error_cam_rad), "rad", "Telemetry's error, camera axes."),
    REALS(bst_tracks, FIX(sigma_rad), 3, "rad", "1 sigma about camera x, y, z."),
    BOUNDED3(bst_tracks, FIX(correlation), -1, 1, "",
             "Of the errors about x and y, x and z, y and z."),
    REAL(bst_tracks, FIX(rms_px), "px", "Of the stars' residuals."),
    BOUNDED(bst_tracks, FIX(shared), 0, 1, "", "Variance that successive frames share, of all."),
    NUMBER(bst_tracks, target_id, 0, "Track of interest, 0 when none."),
    REAL(bst_tracks, clock_offset_s, "s", "Onboard clock less true time, as learnt from objects."),
    BOUNDED(bst_tracks, clock_sigma_s, 0, 1e6, "s", "Its standard deviation; 0: not estimated."),
    INT(bst_tracks, at_rest, 0, MANY, "",
        "Number of stationary tracks, which are not among the items."),
    COUNT(bst_tracks, "Items."),
    INT(bst_tracks, lost, 0, MANY, "", "Tracks that found no room."),
    END};

static const bst_wire_field track_items[] = {
    NUMBER(bst_track, id, 1, "1, 2, ...: never used again."),
    INT(bst_track, status, 0, 2, "", "0 tentative, 1 confirmed, 2 coasting."),
    BOOLEAN(bst_track, target_of_interest, "It is what is looked for."),
    DIRECTION(bst_track, direction_gcrf, "Geometric."),
    VECTOR(bst_track, rate_gcrf_radps, "rad/s", "Its rate, perpendicular to it."),
    REALS(bst_track, covariance, 16, "rad2, rad2/s, rad2/s2",
          "Rows of (d1, d2, r1, r2) along e1 = unit(z x d), e2 = d x e1."),
    ANY(bst_track, v_mag, "mag", "V."),
    ANY(bst_track, snr, "", "Of the latest detection."),
    ANY(bst_track, score, "", "Log-likelihood ratio against chance."),
    INT(bst_track, hits, 0, MANY, "", "Detections so far."),
    INT(bst_track, misses_in_row, 0, MANY, "", "Frames without one, the latest ones."),
    TICK(bst_track, first_tick, "First detection."),
    TICK(bst_track, last_update_tick, "Latest detection."),
    ANY(bst_track, x_px, "px", "Of the latest detection."),
    ANY(bst_track, y_px, "px", "The same."),
    BOOLEAN(bst_track, uncorrelated, "Confirmed, and nothing that was expected."),
    INT(bst_track, hidden, 0, 4, "",
        "0 not, 1 in shadow, 2 behind the Earth, 3 awaited, 4 too dim."),
    END};

static const bst_wire_field track_identities[] = {
    NUMBER(bst_track_identities, exposure_id, 0, "Of the frame."),
    TICK(bst_track_identities, tick, "Mid-exposure."), COUNT(bst_track_identities, "Items."),
    INT(bst_track_identities, lost, 0, MANY, "", "Further items, for which there was no room."),
    END};

static const bst_wire_field identity_items[] = {
    NUMBER(bst_track_identity, track_id, 1, "As in `tracks`."),
    INT(bst_track_identity, object, -1, MANY, "",
        "Index in the catalogue; -1: none of its objects."),
    BOUNDED(bst_track_identity, probability, 0, 1, "", "That the track is this object."), END};

static const bst_wire_field tracks_smoothed[] = {
    NUMBER(bst_tracks_smoothed, exposure_id, 0, "Of the earlier frame."),
    TICK(bst_tracks_smoothed, tick, "Of validity: its mid-exposure."),
    COUNT(bst_tracks_smoothed, "Items."),
    INT(bst_tracks_smoothed, lost, 0, MANY, "", "Further tracks, for which there was no room."),
    END};

static const bst_wire_field smoothed_items[] = {
    NUMBER(bst_track_smoothed, id, 1, "As in `tracks`."),
    INT(bst_track_smoothed, status, 0, 2, "",
        "In that frame: 0 tentative, 1 confirmed, 2 coasting."),
    BOOLEAN(bst_track_smoothed, target_of_interest, "In that frame."),
    INT(bst_track_smoothed, later_frames, 0, MANY, "", "Later frames that contribute."),
    DIRECTION(bst_track_smoothed, direction_gcrf, "Geometric."),
    VECTOR(bst_track_smoothed, rate_gcrf_radps, "rad/s", "Its rate, perpendicular to it."),
    REALS(bst_track_smoothed, covariance, 16, "rad2, rad2/s, rad2/s2", "As in `tracks`."),
    END};

static const bst_wire_field los_command[] = {
    TICK(bst_los_command, tick, "Of reference."),
    DIRECTION(bst_los_command, direction_gcrf, "Where the boresight shall be: apparent."),
    VECTOR(bst_los_command, rate_gcrf_radps, "rad/s", "Its rate."),
    VECTOR(bst_los_command, accel_gcrf_radps2, "rad/s2", "Its acceleration."),
    BOOLEAN(bst_los_command, near_given, "The angles below tell which of those alike are meant."),
    REALS(bst_los_command, near_rad, 3, "rad", "Those next to these, by axis, at `tick`."),
    REALS(bst_los_command, near_radps, 3, "rad/s", "Their rates."),
    BOOLEAN(bst_los_command, roll_given, "The body is to go to the angle below."),
    REAL(bst_los_command, roll_rad, "rad", "Of `roll` in `mount_status`."),
    END};

static const bst_wire_field sensor_command[] = {
    BOUNDED(bst_sensor_command, exposure_s, -1, 1e6, "s", "0 or less: keep."),
    BOUNDED(bst_sensor_command, period_s, -1, 1e6, "s", "0 or less: keep."),
    WINDOW(bst_sensor_command, window),
    INT(bst_sensor_command, binning, 0, 64, "", "0: keep."),
    BOUNDED(bst_sensor_command, pixel_scale_arcsec, -1, 600, "arcsec/px",
            "Field of view; 0 or less: keep."),
    END};

static const bst_wire_field control_status[] = {
    TICK(bst_control_status, tick, "Of validity."),
    INT(bst_control_status, mode, 0, BST_MODE_COUNT - 1, "",
        "0 idle, 1 slew, 2 search, 3 acquire, 4 track, 5 reacquire, 6 stare, 7 rate, 8 coast, 9 "
        "fixed, 10 scan, 11 lost."),
    NUMBER(bst_control_status, target_id, 0, "Track, 0 when none."),
    INT(bst_control_status, search_step, -MANY, MANY, "", "Of the search pattern."),
    FIELD_(bst_control_status, aim_error_px, BST_WIRE_F64, 2, BST_WIRE_ANY, 0, 0, "px",
           "As control believes: target from boresight, x and y."),
    END};

static const bst_wire_field target_states[] = {COUNT(bst_link_target_states, "States."), END};

static const bst_wire_field target_state_items[] = {
    TEXT(bst_link_target_state, object, "Its name in the scenario; its `external_states` is true."),
    TICK(bst_link_target_state, tick, "From when on: not before the step's, in order."),
    VECTOR(bst_link_target_state, position_gcrf_m, "m", "Geocentric."),
    VECTOR(bst_link_target_state, velocity_gcrf_mps, "m/s", "Geocentric."), END};

static const bst_wire_field target_attitudes[] = {COUNT(bst_link_target_attitudes, "Attitudes."),
                                                  END};

static const bst_wire_field target_attitude_items[] = {
    TEXT(bst_link_target_attitude, object,
         "Its name in the scenario; it has a shape, and its `external_states` is true."),
    TICK(bst_link_target_attitude, tick, "From when on: not before the step's, in order."),
    ATTITUDE(bst_link_target_attitude, q_body_from_gcrf, "Attitude of its shape then."),
    VECTOR(bst_link_target_attitude, rate_body_radps, "rad/s", "Angular velocity, body frame."),
    END};

static const bst_wire_field pointing[] = {
    COUNT(bst_link_pointing, "Attitudes: 2 for start and end, more for a history."), END};

static const bst_wire_field pointing_items[] = {
    TICK(bst_los_sample, tick, "When."),
    ATTITUDE(bst_los_sample, q_cam_from_gcrf, "True attitude of the camera."), END};

enum {
    SIM = BST_WIRE_FROM_SIM,
    PEER = BST_WIRE_FROM_PEER,
    BOTH = BST_WIRE_FROM_SIM | BST_WIRE_FROM_PEER,
};

#define RECORD(name_, from_, struct_, table_, doc_) \
    { name_, from_, false, table_, NULL, sizeof(struct_), 0, 0, doc_ }
#define ITEMS(name_, from_, struct_, list_, table_, item_, item_table_, max_, doc_)              \
    {                                                                                            \
        name_, from_, false, table_, item_table_, offsetof(struct_, list_), sizeof(item_), max_, \
            doc_                                                                                 \
    }

static const bst_wire_message messages[BST_LINK_TYPES] = {
    [BST_LINK_HELLO] = RECORD("hello", PEER, bst_link_hello, hello,
                              "A peer comes, or comes back. The first message of each of its "
                              "connections; the simulation answers with `welcome`."),
    [BST_LINK_WELCOME] =
        ITEMS("welcome", SIM, bst_link_welcome, parts, welcome, bst_link_part, welcome_parts, 1024,
              "The run, and the parts that the peer plays in it."),
    [BST_LINK_STEP] = RECORD("step", SIM, bst_link_step, step,
                             "All inputs of a step have been sent. The peer answers with its "
                             "outputs, if there are any, and then with `done`."),
    [BST_LINK_DONE] = RECORD("done", PEER, bst_link_done, done,
                             "All outputs of the step that the header names have been sent."),
    [BST_LINK_ERROR] = RECORD("error", SIM, bst_link_error, error,
                              "A message of the peer was rejected; the simulation waits for a "
                              "valid one."),
    [BST_LINK_HEALTH] = RECORD("health", PEER, bst_link_health, health,
                               "State of the peer, at any time. During a long step it restarts the "
                               "time-out."),
    [BST_LINK_END] = RECORD("end", BOTH, bst_link_end, end, "The run is over, or the peer leaves."),
    [BST_LINK_FRAME] = {"frame", SIM, true, frame, NULL, sizeof(bst_link_frame), 0, 0,
                        "A frame: metadata, and the pixels as a second part."},
    [BST_LINK_TRUTH] =
        ITEMS("truth", SIM, bst_truth, items, truth, bst_truth_item, truth_items, 1 << 20,
              "The true scene of the frame that follows, where `send_truth` asks "
              "for it."),
    [BST_LINK_POINTING_TELEMETRY] = ITEMS(
        "pointing_telemetry", SIM, bst_link_pointing_telemetry, items, pointing_telemetry,
        bst_pointing_sample, pointing_samples, 1 << 20, "What encoders and attitude sensors say."),
    [BST_LINK_NAV_TELEMETRY] = RECORD("nav_telemetry", SIM, bst_nav_telemetry, nav_telemetry,
                                      "What the spacecraft knows of its own orbit."),
    [BST_LINK_MOUNT_STATUS] =
        RECORD("mount_status", SIM, bst_mount_status, mount_status,
               "Geometry, limits and state of the mount as they are known on board."),
    [BST_LINK_DETECTIONS] =
        ITEMS("detections", BOTH, bst_detections, items, detections, bst_detection, detection_items,
              65536, "What was found in a frame."),
    [BST_LINK_PREDICTIONS] =
        ITEMS("predictions", BOTH, bst_predictions, items, predictions, bst_prediction,
              prediction_items, 65536, "The tracker's help for image processing of later frames."),
    [BST_LINK_TRACKS] = ITEMS("tracks", BOTH, bst_tracks, items, tracks, bst_track, track_items,
                              16384, "The tracker's state after a frame."),
    [BST_LINK_TRACK_IDENTITIES] =
        ITEMS("track_identities", PEER, bst_track_identities, items, track_identities,
              bst_track_identity, identity_items, 16384,
              "Probabilities of tracks over the objects of the onboard catalogue."),
    [BST_LINK_TRACKS_SMOOTHED] = ITEMS(
        "tracks_smoothed", PEER, bst_tracks_smoothed, items, tracks_smoothed, bst_track_smoothed,
        smoothed_items, 16384, "States of tracks in an earlier frame, given the later frames too."),
    [BST_LINK_LOS_COMMAND] = RECORD("los_command", BOTH, bst_los_command, los_command,
                                    "Where the boresight shall be, as the onboard attitude "
                                    "knowledge sees it."),
    [BST_LINK_SENSOR_COMMAND] =
        RECORD("sensor_command", PEER, bst_sensor_command, sensor_command,
               "Exposure, period, window and binning from the next exposure on."),
    [BST_LINK_CONTROL_STATUS] = RECORD("control_status", PEER, bst_control_status, control_status,
                                       "Mode and target, for the record and the summary."),
    [BST_LINK_POINTING] = ITEMS(
        "pointing", PEER, bst_link_pointing, items, pointing, bst_los_sample, pointing_items, 65536,
        "The camera's true attitude, from a peer that moves it: the ticks ascend, and reach the "
        "part's next step."),
    [BST_LINK_TARGET_STATES] =
        ITEMS("target_states", PEER, bst_link_target_states, items, target_states,
              bst_link_target_state, target_state_items, 4096,
              "States of steered objects: from its tick on an object moves by two-body motion from "
              "there, until its next state."),
    [BST_LINK_TARGET_ATTITUDES] =
        ITEMS("target_attitudes", PEER, bst_link_target_attitudes, items, target_attitudes,
              bst_link_target_attitude, target_attitude_items, 4096,
              "Attitudes of steered objects with a shape: from its tick on a shape turns at the "
              "given rate, until its next attitude."),
};

const bst_wire_message *bst_wire_message_of(bst_link_type type) {
    return (unsigned)type < BST_LINK_TYPES ? &messages[type] : NULL;
}

bst_link_type bst_wire_type_of(const char *name) {
    int type = 0;
    while (type < BST_LINK_TYPES && strcmp(messages[type].name, name) != 0) {
        type++;
    }
    return (bst_link_type)type;
}
