/* The recorder: writes the messages of a run to FITS files and tables while the run proceeds. */
#ifndef BST_ENGINE_RECORDER_RECORDER_H
#define BST_ENGINE_RECORDER_RECORDER_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/config.h"
#include "boresight/messages.h"
#include "sim/astro/time.h"
#include "sim/io/run_store.h"

typedef enum bst_recorder_frames {
    BST_RECORD_EXTENSIONS,
    BST_RECORD_CUBE,
    BST_RECORD_NO_FRAMES,
} bst_recorder_frames;

typedef enum bst_recorder_detections {
    BST_RECORD_ALL_DETECTIONS,
    BST_RECORD_NO_STARS, /* all but those labelled "star" */
    BST_RECORD_OBJECTS,  /* those labelled "object" */
} bst_recorder_detections;

/* The scenario's "record" block. */
typedef struct bst_recorder_config {
    int32_t frames;      /* bst_recorder_frames */
    int32_t compression; /* bst_fits_compression, or 2: auto; for image extensions */
    bool checksums;      /* checksum keywords in each HDU */
    uint32_t planes;     /* bit k: the bst_plane k */
    double mask_threshold_sigma;
    bool truth;
    bool truth_stars;
    bool detections;
    int32_t detections_of; /* bst_recorder_detections */
    bool tracks;
    bool commands;
    bool events;
    bool sightings; /* table `sightings`, written by the caller */
    double custody_timeout_s;
    bool custody; /* tables `custody` and `custody_tracks`, written by the caller */
    double custody_sigma_m, custody_drift_m_per_day, custody_noise_m_per_day, custody_within_m;
    double custody_unknown_share;
    double telemetry_hz;
} bst_recorder_config;

extern const bst_config_desc bst_record_config_table[];

/* Checks options that the configuration table cannot check. BST_ERR_CONFIG if a cube is to be
 * compressed. */
bst_status bst_recorder_config_check(bst_ctx *ctx,
                                     const bst_recorder_config *config) BST_MUST_CHECK;

/* True if frames are Rice compressed: "auto" compresses extensions. */
bool bst_recorder_compresses(const bst_recorder_config *config);

/* A sensor whose channels are recorded. The recorder copies the names and uses the camera in create
 * only. */
typedef struct bst_recorder_sensor {
    const char *observer, *sensor;
    const char *target;       /* FITS OBJECT; may be NULL */
    const bst_camera *camera; /* the true camera */
    bool has_truth;   /* each frame has a truth message in the same tick or earlier; the frame waits
                         for it */
    bool has_regions; /* image processing may search windows of its frames */
    bool has_wheels;  /* its spacecraft has reaction wheels */
} bst_recorder_sensor;

typedef struct bst_recorder_info {
    bst_time epoch; /* time of tick 0 */
    int64_t tick_rate_hz;
    const char *program; /* program and version, such as "boresight 0.1.0" */
    const bst_recorder_sensor *sensors;
    int sensor_count;
    int64_t begin_tick; /* first tick of the record; exposures from before it have no truth */
    const struct bst_world
        *world; /* source of object names; must outlive the recorder; may be NULL */
} bst_recorder_info;

typedef struct bst_recorder bst_recorder;

/* Creates the tables in `run` (which must outlive the recorder). The first frame creates the FITS
 * files: frames.fits, or frames_<observer>_<sensor>.fits when there are several sensors. */
bst_status bst_recorder_create(bst_ctx *ctx, bst_run *run, const bst_recorder_config *config,
                               const bst_recorder_info *info, bst_recorder **out) BST_MUST_CHECK;

/* Saves the recorder, with all frames on the disk, or restores it into a reopened run, whose files
 * are cut to what was saved. Archive the run's tables first (bst_run_archive).
 *
 * Errors:    BST_ERR_IO with the file and the reason; BST_ERR_FORMAT: a file is shorter than the
 *            saved one; BST_ERR_MEMORY */
bst_status bst_recorder_archive(bst_ctx *ctx, bst_recorder *recorder,
                                bst_archive *archive) BST_MUST_CHECK;

/* Word for a bst_source_kind ("star") in table truth. Never NULL. */
const char *bst_recorder_source_name(int32_t kind);
/* Word for a bst_label ("star") in table detections. Never NULL. */
const char *bst_recorder_label_name(int32_t label);
/* Word for a bst_track_status ("confirmed") in table tracks. Never NULL. */
const char *bst_recorder_track_status_name(int32_t status);

/* Word for a bst_region_reason ("target") in table regions_of_interest. Never NULL. */
const char *bst_recorder_region_reason_name(int32_t reason);

/* Index of a sensor in info->sensors, -1 when it is not recorded. */
int bst_recorder_find(const bst_recorder *recorder, const char *observer, const char *sensor);

/* True if messages of this channel (name without scope) are recorded. */
bool bst_recorder_wants(const bst_recorder *recorder, const char *channel);

/* True if telemetry is recorded at this tick. *last: index of the last recorded grid point (-1 at
 * first); it is updated. */
bool bst_recorder_due(const bst_recorder *recorder, int64_t tick, int64_t *last);
/* First tick at which the next telemetry sample can be due after `last`. */
int64_t bst_recorder_not_due_before(const bst_recorder *recorder, int64_t last);

/* Records a message that was written at `written_tick`. Frames are retained until their truth is
 * there, at most one per sensor. Channels that are not wanted are ignored. Telemetry written in
 * place is recorded at config->telemetry_hz, on the grid of ticks; control_status on the same grid
 * and whenever mode or target change. Errors: BST_ERR_IO with the file and the reason; the error of
 * a compressed frame appears at a later call or at close. */
bst_status bst_recorder_channel(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                const char *channel, const void *payload,
                                int64_t written_tick) BST_MUST_CHECK;

/* Records an event; `source` is the name of the module instance. */
bst_status bst_recorder_event(bst_ctx *ctx, bst_recorder *recorder, int64_t tick,
                              const char *source, const char *kind,
                              const char *text) BST_MUST_CHECK;

/* Writes retained frames, completes the FITS files and frees the recorder, also after an error.
 * Call it before bst_run_finish or bst_run_abandon. NULL is allowed. */
bst_status bst_recorder_close(bst_ctx *ctx, bst_recorder *recorder) BST_MUST_CHECK;

#endif
