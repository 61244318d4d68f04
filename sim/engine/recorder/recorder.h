/* The recorder: turns what goes over the channels into the run's files, as it comes. */
#ifndef BST_ENGINE_RECORDER_RECORDER_H
#define BST_ENGINE_RECORDER_RECORDER_H

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
    BST_RECORD_NO_STARS, /* without those labelled star */
    BST_RECORD_OBJECTS,  /* those labelled so */
} bst_recorder_detections;

/* The scenario's "record" block. */
typedef struct bst_recorder_config {
    int32_t frames;      /* bst_recorder_frames */
    int32_t compression; /* bst_fits_compression, or 2: auto; of extensions */
    bool checksums;      /* of each HDU */
    uint32_t planes;     /* bit k: the bst_plane k */
    double mask_threshold_sigma;
    bool truth;
    bool truth_stars;
    bool detections;
    int32_t detections_of; /* bst_recorder_detections */
    bool tracks;
    bool commands;
    bool events;
    bool sightings; /* by the caller, who judges */
    double custody_timeout_s;
    double telemetry_hz;
} bst_recorder_config;

extern const bst_config_desc bst_record_config_table[];

/* Checks what the table cannot: BST_ERR_CONFIG when a cube is to be compressed. */
bst_status bst_recorder_config_check(bst_ctx *ctx,
                                     const bst_recorder_config *config) BST_MUST_CHECK;

/* Whether frames are Rice compressed: "auto" does so for extensions. */
bool bst_recorder_compresses(const bst_recorder_config *config);

/* A sensor whose channels are recorded. Names and camera are copied or used in create only. */
typedef struct bst_recorder_sensor {
    const char *observer, *sensor;
    const char *target;       /* FITS OBJECT; may be NULL */
    const bst_camera *camera; /* the true one */
    bool has_truth; /* a truth message comes for every frame, in the same tick or before it; the
                       frame waits for it */
} bst_recorder_sensor;

typedef struct bst_recorder_info {
    bst_time epoch; /* of tick 0 */
    int64_t tick_rate_hz;
    const char *program; /* "boresight 0.1.0" */
    const bst_recorder_sensor *sensors;
    int sensor_count;
    const struct bst_world *world; /* names of the objects; outlives the recorder; may be NULL */
} bst_recorder_info;

typedef struct bst_recorder bst_recorder;

/* Makes the tables in `run` (which must outlive the recorder). FITS files are made with the first
 * frame: frames.fits, or frames_<observer>_<sensor>.fits when there are several sensors. */
bst_status bst_recorder_create(bst_ctx *ctx, bst_run *run, const bst_recorder_config *config,
                               const bst_recorder_info *info, bst_recorder **out) BST_MUST_CHECK;

/* Index of a sensor in info->sensors, -1 when it is not recorded. */
int bst_recorder_find(const bst_recorder *recorder, const char *observer, const char *sensor);

/* Whether messages of this channel (unscoped name) are recorded at all, so that the caller may
 * spare the call. */
bool bst_recorder_wants(const bst_recorder *recorder, const char *channel);

/* Whether telemetry is recorded at this tick, the next of its grid after *last (-1 at first), which
 * is updated. */
bool bst_recorder_due(const bst_recorder *recorder, int64_t tick, int64_t *last);
/* No tick below this is due after `last`. */
int64_t bst_recorder_not_due_before(const bst_recorder *recorder, int64_t last);

/* Records a message that was written at `written_tick`. Frames are retained until their truth is
 * there, at most one per sensor. Channels that are not wanted are ignored. Telemetry written in
 * place is recorded at config->telemetry_hz, on the grid of ticks; control_status on the same grid
 * and whenever mode or target change. Errors: BST_ERR_IO with the file and the reason; of a
 * compressed frame at one of the next calls, or at close. */
bst_status bst_recorder_channel(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                const char *channel, const void *payload,
                                int64_t written_tick) BST_MUST_CHECK;

/* Records an event; `source` is the instance that reports it. */
bst_status bst_recorder_event(bst_ctx *ctx, bst_recorder *recorder, int64_t tick,
                              const char *source, const char *kind,
                              const char *text) BST_MUST_CHECK;

/* Writes what still waits, completes the FITS files and frees the recorder, in every case. Call it
 * before bst_run_finish or bst_run_abandon. NULL is allowed. */
bst_status bst_recorder_close(bst_ctx *ctx, bst_recorder *recorder) BST_MUST_CHECK;

#endif
