/* Types that recorder.c (channels, frames) and recorder_rows.c (tables) share. */
#ifndef BST_ENGINE_RECORDER_RECORDER_INTERNAL_H
#define BST_ENGINE_RECORDER_RECORDER_INTERNAL_H

#include "sim/engine/recorder/recorder.h"
#include "sim/io/fits_frames.h"
#include "sim/world/world.h"

typedef enum bst_recorder_table {
    BST_TABLE_RUN,
    BST_TABLE_SENSORS,
    BST_TABLE_FRAMES,
    BST_TABLE_EXPOSURES,
    BST_TABLE_TRUTH,
    BST_TABLE_OBJECTS,
    BST_TABLE_LOS_TRUTH,
    BST_TABLE_DETECTION_FRAMES,
    BST_TABLE_DETECTIONS,
    BST_TABLE_TRACK_FRAMES,
    BST_TABLE_TRACKS,
    BST_TABLE_LOS_COMMANDS,
    BST_TABLE_SENSOR_COMMANDS,
    BST_TABLE_POINTING,
    BST_TABLE_MOUNT,
    BST_TABLE_NAV,
    BST_TABLE_CONTROL,
    BST_TABLE_EVENTS,
    BST_TABLE_TASKS,
    BST_TABLE_SHAPES,
    BST_TABLE_EXTENDED,
    BST_TABLE_PARTS,
    BST_TABLE_CAMERA_CALIBRATION,
    BST_TABLE_TRACKS_SMOOTHED,
    BST_TABLE_TRACK_IDENTITIES,
    BST_TABLE_REGIONS_OF_INTEREST,
    BST_TABLE_WHEELS,
    BST_TABLE_COUNT
} bst_recorder_table;

/* Values of the truth that the FITS header of its frame needs. */
typedef struct bst_recorder_truth_head {
    bool valid;
    int64_t exposure_id;
    bst_quat q_cam_from_gcrf_mean;
    bst_vec3 observer_gcrf_m, observer_gcrf_mps;
    bst_light light;
    double pixel_scale_arcsec;
    double body_fraction[3]; /* as bst_fits_frame */
} bst_recorder_truth_head;

/* Truth precedes its frame by the readout delay; maximum number of exposures in between. */
#define BST_TRUTH_HEADS 64

typedef struct bst_recorder_state {
    char observer[64], sensor[64], target[64];
    bst_camera camera;
    bool has_truth;
    bst_fits *fits; /* created with the first frame */
    bst_fits *planes[BST_PLANE_COUNT];
    bst_fits_frame shown; /* header of the last frame written */
    bool wcs_warned;
    bool frame_waits;
    bst_frame_message frame; /* retained while frame_waits */
    bst_recorder_truth_head heads[BST_TRUTH_HEADS];
    int next_head;
    /* the last recorded grid point of telemetry, for each of these tables */
    int64_t last_los, last_pointing, last_mount, last_nav, last_control, last_wheels;
    int32_t last_mode;
    int64_t last_target;
} bst_recorder_state;

struct bst_recorder {
    bst_run *run;
    bst_recorder_config config;
    bst_time epoch;
    int64_t tick_rate_hz, begin_tick;
    bool has_regions, has_wheels; /* of any sensor */
    char program[64];
    const struct bst_world *world;         /* NULL: objects have no names */
    bool *object_seen;                     /* [objects of the world] */
    bst_io_table *tables[BST_TABLE_COUNT]; /* NULL: the table is not recorded */
    int sensor_count;
    bst_recorder_state sensors[];
};

/* Opens a FITS file of a sensor, "frames" or that of a plane: a new one, or that of a reopened run,
 * to be restored by bst_fits_archive. */
bst_status bst_recorder_open_file(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                  const char *what, bool reopen, bst_fits **out) BST_MUST_CHECK;
/* Name of a plane's file, without extension. */
const char *bst_recorder_plane_file(int plane);
/* Name of the FITS file of a sensor: "frames.fits", or one file per sensor.
 *
 * Given:     what  "frames" or bst_recorder_plane_file */
void bst_recorder_file_name(const bst_recorder *recorder, const bst_recorder_state *sensor,
                            const char *what, char *name, size_t bytes);

/* Creates the tables of the run store that the configuration selects. */
bst_status bst_recorder_make_tables(bst_ctx *ctx, bst_recorder *recorder) BST_MUST_CHECK;

/* Writes the row of a frame. fits_index < 0: not in FITS; wcs NULL: none. */
bst_status bst_recorder_frame_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                  const bst_frame_message *message, const bst_wcs *wcs,
                                  int64_t fits_index) BST_MUST_CHECK;
/* Writes the row of the table `run`. */
bst_status bst_recorder_run_row(bst_ctx *ctx, bst_recorder *recorder) BST_MUST_CHECK;

/* Writes a sensor's row of the table `sensors`.
 *
 * Given:     sensor  index of the sensor
 *            file    name of its FITS file; NULL: none */
bst_status bst_recorder_sensor_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const char *file) BST_MUST_CHECK;

/* Middle of an exposure, s after the epoch. */
static inline double bst_recorder_mid_s(const bst_recorder *recorder, int64_t start_tick,
                                        int64_t end_tick) {
    return 0.5 * (double)(start_tick + end_tick) / (double)recorder->tick_rate_hz;
}

/* Writes the rows of table parts; none if the run has no such table. */
bst_status bst_recorder_part_rows(bst_ctx *ctx, bst_recorder *recorder) BST_MUST_CHECK;
/* Writes the rows of table shapes; none if the run has no such table. */
bst_status bst_recorder_shape_rows(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                   const bst_truth *truth) BST_MUST_CHECK;
/* Writes the row of table extended_targets of a detection; none if it is not extended, or the run
 * has no such table.
 *
 * Given:     item  index of the detection */
bst_status bst_recorder_extended_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                     const bst_detections *detections, int item) BST_MUST_CHECK;

/* Writes the row of table camera_calibration of a frame; none without an estimate or a table. */
bst_status bst_recorder_calibration_row(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                        const bst_detections *detections) BST_MUST_CHECK;

/* Functions that write the rows of one message. */
#define BST_RECORDER_ROWS(name)                                                            \
    bst_status name(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload, \
                    int64_t written_tick) BST_MUST_CHECK
BST_RECORDER_ROWS(bst_recorder_truth_rows);
BST_RECORDER_ROWS(bst_recorder_los_rows);
BST_RECORDER_ROWS(bst_recorder_detection_rows);
BST_RECORDER_ROWS(bst_recorder_track_rows);
BST_RECORDER_ROWS(bst_recorder_smoothed_rows);
BST_RECORDER_ROWS(bst_recorder_identity_rows);
BST_RECORDER_ROWS(bst_recorder_los_command_rows);
BST_RECORDER_ROWS(bst_recorder_sensor_command_rows);
BST_RECORDER_ROWS(bst_recorder_pointing_rows);
BST_RECORDER_ROWS(bst_recorder_mount_rows);
BST_RECORDER_ROWS(bst_recorder_nav_rows);
BST_RECORDER_ROWS(bst_recorder_control_rows);
BST_RECORDER_ROWS(bst_recorder_task_rows);
BST_RECORDER_ROWS(bst_recorder_region_rows);
BST_RECORDER_ROWS(bst_recorder_wheel_rows);

#endif
