#include "imgproc/detect/plugin_detector.h"
#include "imgproc/imgproc.h"
#include "sim/optics/column_level.h"

static const bst_config_desc bad_pixel_table[] = {
    BST_INT(bst_imgproc_bad_pixel, x, "px", 0, 32767, NULL, "Column, 0 the first."),
    BST_INT(bst_imgproc_bad_pixel, y, "px", 0, 32767, NULL, "Row, 0 the first."),
    BST_CONFIG_END,
};

static const char *const attitudes[] = {"telemetry", "unknown", NULL};

const bst_config_desc bst_imgproc_config_table[] = {
    BST_INT(bst_imgproc_config, capacity, "", 1, 65536, "2048",
            "Detections kept per frame, the brightest first."),
    BST_INT(
        bst_imgproc_config, max_fits, "", 0, 65536, "2048",
        "Detections per frame that are located by maximum likelihood, the brightest first, beside "
        "those that are taken for objects; the others stand at the matched filter's greatest "
        "output. 0: all."),
    BST_FORMER("most_fits", "max_fits"),
    BST_REAL(bst_imgproc_config, false_splits, "", 0, 0.1, "0",
             "Share of single sources that may be reported as two by noise: pairs closer than the "
             "matched filter separates are then found by a likelihood ratio. 0: no such test. The "
             "PSF, with jitter_px, must be known."),
    BST_INT(bst_imgproc_config, mesh_px, "px", 8, 1024, "64",
            "Side of the meshes in which background and noise are estimated."),
    BST_REAL(bst_imgproc_config, false_alarms_per_frame, "", 1e-6, 1e4, "1",
             "Detections per frame that noise alone may cause, on average."),
    BST_REAL(bst_imgproc_config, jitter_px, "px", 0, 5, "0",
             "RMS per axis of the line-of-sight jitter that widens the onboard PSF."),
    BST_REAL(
        bst_imgproc_config, motion_bend_px, "px", 0, 5, "0",
        "RMS per axis by which an exposure's path bends beside what the telemetry shows, as of "
        "a servo that follows its encoder's noise: streaks are displaced together by it. "
        "Jitter adds 0.075 of jitter_px."),
    BST_REAL(bst_imgproc_config, streak_min_px, "px", 0.5, 100, "1.5",
             "Star streaks shorter than this are taken for points."),
    BST_REAL(bst_imgproc_config, streak_max_px, "px", 1, 128, "64",
             "Star streaks longer than this are not filtered for."),
    BST_BOOL(bst_imgproc_config, long_streaks, "false",
             "Find star streaks longer than streak_max_px, straight or curved, by a matched filter "
             "along the path that the telemetry of the pointing gives."),
    BST_REAL(bst_imgproc_config, streak_search_px, "px", 0, 128, "0",
             "Greatest length of streaks of unknown rate and direction that are searched for in "
             "frames in which stars are points; 0: no search."),
    BST_REAL(bst_imgproc_config, search_radius_px, "px", 2, 500, "60",
             "Greatest pointing error over which stars are identified."),
    BST_REAL(bst_imgproc_config, match_tolerance_px, "px", 0.5, 20, "3",
             "Greatest distance of one star from its place after the common shift."),
    BST_ENUM(bst_imgproc_config, attitude, attitudes, "\"telemetry\"",
             "Attitude at the start. telemetry: right within search_radius_px. unknown: wrong by "
             "any angle; the first frame with enough stars gives it (lost in space)."),
    BST_INT(bst_imgproc_config, lost_after_frames, "", 0, 1000000, "0",
            "After so many frames in a row without an identified star the attitude is unknown "
            "again; 0: never."),
    BST_REAL(bst_imgproc_config, lost_scale_tolerance, "", 0, 0.1, "0.05",
             "Largest relative error of the camera's pixel scale while the attitude is unknown."),
    BST_OBJECT(bst_imgproc_config, camera_calibration, bst_camera_calibrator_config_table, "{}",
               "Calibration of the camera's geometry in flight."),
    BST_BOOL(
        bst_imgproc_config, track_windows, "false",
        "Look only at windows round the predicted places of tracks and of bright stars while a "
        "target of interest is followed."),
    BST_INT(bst_imgproc_config, window_px, "px", 24, 4096, "48",
            "track_windows: side of a window; ten sigma of the prediction and the length of a "
            "star's streak come on top."),
    BST_INT(bst_imgproc_config, window_stars, "", 3, 64, "16",
            "track_windows: bright stars that are looked at, for the attitude."),
    BST_INT(bst_imgproc_config, full_frame_period, "", 1, 1000000, "60",
            "track_windows: of so many frames ..."),
    BST_FORMER("full_every", "full_frame_period"),
    BST_INT(
        bst_imgproc_config, full_frame_count, "", 0, 1000000, "6",
        "... the first so many are looked at as a whole, for all that no track predicts: enough "
        "in a row to confirm a track."),
    BST_FORMER("full_frames", "full_frame_count"),
    BST_OBJECT(bst_imgproc_config, stack, bst_stack_config_table, "{}",
               "Search for objects too faint for one frame in stacks of frames."),
    BST_OBJECT(bst_imgproc_config, extended, bst_extended_config_table, "{}",
               "Targets larger than the PSF: silhouette, centre of mass, range from the size."),
    BST_OBJECT(
        bst_imgproc_config, reference_pixels, bst_reference_pixels_config_table, "{}",
        "Level of the reference pixels (overscan) in the frame, taken off before detection."),
    BST_ENUM(bst_imgproc_config, column_correction, bst_column_level_words, "\"auto\"",
             "Whether each column's level over the others' is taken off, with the noise that it "
             "brings: the smear of a frame transfer under light, offsets of columns. auto: where "
             "the onboard camera has frame_transfer_s, or column_offset_rms_e above a fifth of its "
             "read noise."),
    BST_FORMER("column_level", "column_correction"),
    BST_OBJECT(bst_imgproc_config, bad_pixel_learning, bst_pixel_learner_config_table, "{}",
               "The bad-pixel map that is learned on board, besides bad_pixels and bad_pixel_file; "
               "not with a detector of one's own."),
    BST_INT(
        bst_imgproc_config, threads, "", 0, 32, "0",
        "Threads that share the passes over a frame and the fits; 0: one per processor. Results do "
        "not depend on it."),
    BST_LIST(bst_imgproc_config, bad_pixels, bst_imgproc_bad_pixel, bad_pixel_table, 0, 1000000,
             "[]", "Sensor pixels to leave out."),
    BST_PATH(
        bst_imgproc_config, dark_file, "\"\"",
        "FITS image of the sensor's size: each pixel's dark signal less the mean, e-/s; empty: "
        "uniform."),
    BST_PATH(bst_imgproc_config, flat_file, "\"\"",
             "FITS image of the sensor's size: each pixel's relative response; empty: uniform."),
    BST_PATH(bst_imgproc_config, bad_pixel_file, "\"\"",
             "FITS image of the sensor's size: what is not zero is left out; empty: none."),
    BST_OBJECT(bst_imgproc_config, detector, bst_plugin_detector_table, "{}",
               "A detector of one's own: what finds and measures sources in a frame."),
    BST_CONFIG_END,
};
