#include "sim/engine/recorder/recorder.h"

#include <assert.h>
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/engine/recorder/recorder_internal.h"
#include "sim/world/frame_updates.h"

static const char *const frame_choices[] = {"extensions", "cube", "none", NULL};

static const char *const detection_choices[] = {"all", "no_stars", "objects", NULL};

/* bst_fits_compression, and auto */
static const char *const compression_choices[] = {"none", "rice", "auto", NULL};

/* in the order of bst_plane; also the file names */
static const char *const plane_choices[] = {"stars",      "targets", "background", "segmentation",
                                            "saturation", "parts",   NULL};
static const char *const plane_names[] = {"STARS",        "TARGETS",    "BACKGROUND",
                                          "SEGMENTATION", "SATURATION", "PARTS"};
static const bst_fits_content plane_contents[] = {BST_FITS_ELECTRONS, BST_FITS_ELECTRONS,
                                                  BST_FITS_ELECTRONS, BST_FITS_ITEMS,
                                                  BST_FITS_FLAGS,     BST_FITS_PARTS};

const bst_config_desc bst_record_config_table[] = {
    BST_ENUM(bst_recorder_config, frames, frame_choices, "\"extensions\"",
             "Frames in FITS: an image extension each, one datacube with a table of times and "
             "WCS, or none."),
    BST_ENUM(bst_recorder_config, compression, compression_choices, "\"auto\"",
             "Of frames in extensions: \"rice\" is lossless FITS tile compression, done beside "
             "the simulation by a thread of its own; \"auto\" is rice for extensions and none for "
             "a cube."),
    BST_BOOL(bst_recorder_config, checksums, "true",
             "CHECKSUM and DATASUM in each HDU; they take about 0.1 ms per million pixels."),
    BST_CHOICES(
        bst_recorder_config, planes, plane_choices, "[]",
        "Noise-free images beside each frame, a FITS file each: expected electrons of the "
        "stars, of the targets, of sky and dark current; the mask of who each pixel belongs "
        "to; which of the frame's own pixels are saturated; and the part of a satellite with a "
        "shape "
        "that covers each pixel."),
    BST_REAL(bst_recorder_config, mask_threshold_sigma, "sigma", 1e-3, 1e6, "1",
             "planes segmentation: least light of a source in a pixel of its own, in the noise of "
             "a pixel without sources."),
    BST_BOOL(bst_recorder_config, truth, "true", "True exposures and sources."),
    BST_BOOL(bst_recorder_config, truth_stars, "true", "Stars among the true sources."),
    BST_BOOL(bst_recorder_config, detections, "true", "What image processing found."),
    BST_ENUM(bst_recorder_config, detections_of, detection_choices, "\"all\"",
             "Which of the detections: all, all but those labelled star, or only those labelled "
             "object."),
    BST_BOOL(bst_recorder_config, tracks, "true", "Tracks and the attitude from stars."),
    BST_BOOL(bst_recorder_config, commands, "true", "Commands to gimbal and sensor."),
    BST_BOOL(bst_recorder_config, events, "true", "Events, and tasks where sensors are given any."),
    BST_BOOL(
        bst_recorder_config, sightings, "true",
        "Who saw what: the objects' passes through the fields, and their sums, against truth."),
    BST_REAL(bst_recorder_config, custody_timeout_s, "s", 0, 1e9, "21600",
             "sightings: an object counts as in custody for this long after each detection."),
    BST_FORMER("custody_s", "custody_timeout_s"),
    BST_BOOL(bst_recorder_config, custody, "false",
             "Custody of the catalogue: confirmed tracks of all sensors are correlated with the "
             "catalogued objects, and update a filter of the mean elements of each."),
    BST_REAL(bst_recorder_config, custody_sigma_m, "m", 1, 1e6, "500",
             "custody: standard deviation of a catalogued orbit along the track, across it and in "
             "height, at the epoch of its elements. The error is drawn from it."),
    BST_REAL(bst_recorder_config, custody_drift_m_per_day, "m", 1, 1e7, "1500",
             "custody: standard deviation of what a catalogued orbit errs more along the track "
             "each day."),
    BST_REAL(bst_recorder_config, custody_noise_m_per_day, "m", 0, 1e7, "0",
             "custody: process noise, the standard deviation by which that drift changes in a day. "
             "0 suits objects that move on their element sets."),
    BST_REAL(bst_recorder_config, custody_within_m, "m", 1, 1e9, "1000",
             "custody: an object is in custody if the standard deviation of its position is at "
             "most this."),
    BST_REAL(bst_recorder_config, custody_unknown_share, "", 0, 1, "0",
             "custody: share of the objects that the catalogue lacks, drawn by the seed. Their "
             "tracks may be linked to candidate objects."),
    BST_REAL(bst_recorder_config, telemetry_hz, "Hz", 0.0, 1e6, "1",
             "Rate at which telemetry, control status and the true line of sight are kept; 0: "
             "not at all."),
    BST_CONFIG_END,
};

bool bst_recorder_compresses(const bst_recorder_config *config) {
    return config->frames == BST_RECORD_EXTENSIONS && config->compression != BST_FITS_RAW;
}

bst_status bst_recorder_config_check(bst_ctx *ctx, const bst_recorder_config *config) {
    if (config->compression == BST_FITS_RICE && config->frames == BST_RECORD_CUBE) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "/record/compression: \"rice\" compresses frames in extensions only; give "
            "/record/frames \"extensions\", or /record/compression \"auto\" or \"none\"");
    }
    return BST_OK;
}

/* A recorded channel: the tables that need it and the function that writes the rows. */
typedef struct channel_rows {
    const char *channel;
    bst_recorder_table table;
    bst_status (*rows)(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                       int64_t written_tick);
} channel_rows;

static bst_status take_frame(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                             int64_t written_tick);
static bst_status take_truth(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                             int64_t written_tick);

static bst_status take_planes(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                              int64_t written_tick);

static const channel_rows channels[] = {
    {BST_CHANNEL_FRAME, BST_TABLE_FRAMES, take_frame},
    {BST_CHANNEL_TRUTH, BST_TABLE_FRAMES, take_truth},
    {BST_CHANNEL_PLANES, BST_TABLE_FRAMES, take_planes},
    {BST_CHANNEL_LOS_HISTORY, BST_TABLE_LOS_TRUTH, bst_recorder_los_rows},
    {BST_CHANNEL_DETECTIONS, BST_TABLE_DETECTIONS, bst_recorder_detection_rows},
    {BST_CHANNEL_TRACKS, BST_TABLE_TRACKS, bst_recorder_track_rows},
    {BST_CHANNEL_TRACKS_SMOOTHED, BST_TABLE_TRACKS_SMOOTHED, bst_recorder_smoothed_rows},
    {BST_CHANNEL_TRACK_IDENTITIES, BST_TABLE_TRACK_IDENTITIES, bst_recorder_identity_rows},
    {BST_CHANNEL_REGIONS_OF_INTEREST, BST_TABLE_REGIONS_OF_INTEREST, bst_recorder_region_rows},
    {BST_CHANNEL_WHEEL_STATUS, BST_TABLE_WHEELS, bst_recorder_wheel_rows},
    {BST_CHANNEL_LOS_COMMAND, BST_TABLE_LOS_COMMANDS, bst_recorder_los_command_rows},
    {BST_CHANNEL_SENSOR_COMMAND, BST_TABLE_SENSOR_COMMANDS, bst_recorder_sensor_command_rows},
    {BST_CHANNEL_POINTING_TELEMETRY, BST_TABLE_POINTING, bst_recorder_pointing_rows},
    {BST_CHANNEL_MOUNT_STATUS, BST_TABLE_MOUNT, bst_recorder_mount_rows},
    {BST_CHANNEL_NAV_TELEMETRY, BST_TABLE_NAV, bst_recorder_nav_rows},
    {BST_CHANNEL_CONTROL_STATUS, BST_TABLE_CONTROL, bst_recorder_control_rows},
    {BST_CHANNEL_TASK, BST_TABLE_TASKS, bst_recorder_task_rows},
};

static const channel_rows *find_channel(const bst_recorder *recorder, const char *channel) {
    for (size_t i = 0; i < sizeof channels / sizeof *channels; i++) {
        if (strcmp(channels[i].channel, channel) == 0) {
            return recorder->tables[channels[i].table] ? &channels[i] : NULL;
        }
    }
    return NULL;
}

bool bst_recorder_wants(const bst_recorder *recorder, const char *channel) {
    return find_channel(recorder, channel) != NULL;
}

int bst_recorder_find(const bst_recorder *recorder, const char *observer, const char *sensor) {
    for (int i = 0; i < recorder->sensor_count; i++) {
        if (strcmp(recorder->sensors[i].observer, observer) == 0 &&
            strcmp(recorder->sensors[i].sensor, sensor) == 0) {
            return i;
        }
    }
    return -1;
}

static bst_status copy_name(bst_ctx *ctx, char *to, size_t bytes, const char *from) {
    int n = snprintf(to, bytes, "%s", from ? from : "");
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "'%s': the name is longer than %zu characters", from,
                        bytes - 1);
    }
    return BST_OK;
}

void bst_recorder_file_name(const bst_recorder *recorder, const bst_recorder_state *s,
                            const char *what, char *name, size_t bytes) {
    if (recorder->sensor_count == 1) {
        snprintf(name, bytes, "%s.fits", what);
        return;
    }
    snprintf(name, bytes, "%s_%s_%s.fits", what, s->observer, s->sensor);
    for (char *c = name; *c; c++) {
        if (!isalnum((unsigned char)*c) && !strchr("._-", *c)) {
            *c = '_';
        }
    }
}

/* Sets up the state of each recorded sensor and the tables. */
static bst_status fill(bst_ctx *ctx, bst_recorder *recorder, const bst_recorder_info *info) {
    BST_TRY(copy_name(ctx, recorder->program, sizeof recorder->program, info->program));
    for (int i = 0; i < info->sensor_count; i++) {
        const bst_recorder_sensor *from = &info->sensors[i];
        bst_recorder_state *s = &recorder->sensors[i];
        BST_TRY(copy_name(ctx, s->observer, sizeof s->observer, from->observer));
        BST_TRY(copy_name(ctx, s->sensor, sizeof s->sensor, from->sensor));
        BST_TRY(copy_name(ctx, s->target, sizeof s->target, from->target));
        s->camera = *from->camera;
        s->has_truth = from->has_truth;
        s->last_los = s->last_pointing = s->last_mount = s->last_nav = s->last_control = -1;
        s->last_wheels = -1;
        recorder->has_regions = recorder->has_regions || from->has_regions;
        recorder->has_wheels = recorder->has_wheels || from->has_wheels;
        s->last_mode = -1;
        s->shown.id = -1;
        s->last_target = -1;
    }
    BST_TRY(bst_recorder_make_tables(ctx, recorder));
    if (bst_run_is_reopened(recorder->run)) {
        return BST_OK; /* bst_recorder_archive restores what follows */
    }
    BST_TRY(bst_recorder_run_row(ctx, recorder));
    for (int i = 0; i < recorder->sensor_count; i++) {
        char name[256];
        bst_recorder_file_name(recorder, &recorder->sensors[i], "frames", name, sizeof name);
        bool kept = recorder->config.frames != BST_RECORD_NO_FRAMES;
        BST_TRY(bst_recorder_sensor_row(ctx, recorder, i, kept ? name : NULL));
    }
    BST_TRY(bst_recorder_part_rows(ctx, recorder));
    return bst_run_commit(ctx, recorder->run);
}

/* Flushes FITS frames before the rows that refer to them are committed. */
static bst_status flush_frames(bst_ctx *ctx, void *user) {
    bst_recorder *recorder = user;
    for (int i = 0; i < recorder->sensor_count; i++) {
        BST_TRY(bst_fits_flush(ctx, recorder->sensors[i].fits));
    }
    return BST_OK;
}

bst_status bst_recorder_create(bst_ctx *ctx, bst_run *run, const bst_recorder_config *config,
                               const bst_recorder_info *info, bst_recorder **out) {
    assert(run && config && info && out);
    *out = NULL;
    if (info->sensor_count < 1 || info->tick_rate_hz < 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "a record needs a sensor and a tick rate");
    }
    size_t bytes = sizeof(bst_recorder) + (size_t)info->sensor_count * sizeof(bst_recorder_state);
    bst_recorder *recorder = calloc(1, bytes);
    if (!recorder) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    recorder->run = run;
    recorder->config = *config;
    recorder->epoch = info->epoch;
    recorder->tick_rate_hz = info->tick_rate_hz;
    recorder->begin_tick = info->begin_tick;
    recorder->sensor_count = info->sensor_count;
    recorder->world = info->world;
    bst_status status = bst_recorder_config_check(ctx, config);
    if (info->world) {
        recorder->object_seen =
            calloc((size_t)bst_world_object_count(info->world) + 1, sizeof *recorder->object_seen);
        if (!recorder->object_seen) {
            status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
        }
    }
    if (status == BST_OK) {
        status = fill(ctx, recorder, info);
    }
    if (status != BST_OK) {
        free(recorder->object_seen);
        free(recorder);
        return status;
    }
    bst_run_set_before_commit(run, flush_frames, recorder);
    *out = recorder;
    return BST_OK;
}

const char *bst_recorder_plane_file(int plane) {
    return plane_choices[plane];
}

/* Content of a file by its name: frames or a plane. */
static bst_fits_content content_of(const char *what) {
    for (int k = 0; k < BST_PLANE_COUNT; k++) {
        if (strcmp(what, plane_choices[k]) == 0) {
            return plane_contents[k];
        }
    }
    return BST_FITS_COUNTS;
}

bst_status bst_recorder_open_file(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                  const char *what, bool reopen, bst_fits **out) {
    char name[256], path[4096];
    const bst_recorder_state *s = &recorder->sensors[sensor];
    bst_recorder_file_name(recorder, s, what, name, sizeof name);
    BST_TRY(bst_run_file(ctx, recorder->run, name, path, sizeof path));
    bst_fits_content content = content_of(what);
    bool frames = content == BST_FITS_COUNTS;
    bst_fits_info info = {.observer = s->observer,
                          .instrument = s->sensor,
                          .object = s->target,
                          .program = recorder->program,
                          .camera = &s->camera,
                          .checksums = recorder->config.checksums,
                          .compression = frames && bst_recorder_compresses(&recorder->config)
                                             ? BST_FITS_RICE
                                             : BST_FITS_RAW,
                          .content = content};
    bst_fits_layout layout =
        frames && recorder->config.frames == BST_RECORD_CUBE ? BST_FITS_CUBE : BST_FITS_EXTENSIONS;
    return reopen ? bst_fits_reopen(ctx, path, layout, &info, out)
                  : bst_fits_create(ctx, path, layout, &info, out);
}

/* Fits the WCS of a frame. If the field is too wide, the frame has no WCS; an event reports it
 * once. */
static void solve_wcs(bst_ctx *ctx, bst_recorder_state *s, const bst_recorder_truth_head *head,
                      bst_fits_frame *frame) {
    bst_camera camera = s->camera;
    if (head->pixel_scale_arcsec > 0.0 &&
        head->pixel_scale_arcsec != s->camera.pixel_scale_arcsec &&
        bst_world_camera_at_scale(ctx, &s->camera, head->pixel_scale_arcsec, &camera) != BST_OK) {
        camera = s->camera; /* unreachable: the frame was rendered with these values */
    }
    frame->pixel_scale_arcsec = camera.pixel_scale_arcsec;
    frame->has_wcs =
        bst_wcs_fit(ctx, &camera, head->q_cam_from_gcrf_mean, &head->light, &frame->wcs) == BST_OK;
    if (!frame->has_wcs && !s->wcs_warned) {
        bst_log(ctx, BST_LOG_WARNING, "%s/%s: frames get no WCS: %s", s->observer, s->sensor,
                ctx ? ctx->message : "");
        s->wcs_warned = true;
    }
    frame->has_observer = true;
    frame->observer_gcrf_m = head->observer_gcrf_m;
    frame->observer_gcrf_mps = head->observer_gcrf_mps;
    memcpy(frame->body_fraction, head->body_fraction, sizeof frame->body_fraction);
}

/* Writes a frame to FITS and its row to the table. head NULL: the truth is missing. */
static bst_status write_frame(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                              const bst_frame_message *m, const bst_recorder_truth_head *head) {
    bst_recorder_state *s = &recorder->sensors[sensor];
    bst_fits_frame frame = {
        .id = m->exposure_id,
        .start = bst_time_at_tick(recorder->epoch, m->start_tick, recorder->tick_rate_hz),
        .exposure_s = (double)(m->end_tick - m->start_tick) / (double)recorder->tick_rate_hz,
        .window = m->window,
        .binning = m->binning,
        .bits = m->bits};
    if (head) {
        solve_wcs(ctx, s, head, &frame);
    }
    int64_t index = -1;
    if (recorder->config.frames != BST_RECORD_NO_FRAMES) {
        if (!s->fits) {
            BST_TRY(bst_recorder_open_file(ctx, recorder, sensor, "frames", false, &s->fits));
        }
        const uint16_t *pixels;
        BST_TRY(bst_frame_map(m->frame, ctx, &pixels));
        bst_status status =
            bst_fits_write(ctx, s->fits, &frame, pixels, m->frame->width, m->frame->height, &index);
        bst_frame_unmap(m->frame);
        BST_TRY(status);
    }
    s->shown = frame;
    return bst_recorder_frame_row(ctx, recorder, sensor, m, frame.has_wcs ? &frame.wcs : NULL,
                                  index);
}

/* Writes the retained frame, with or without its truth, and releases it. */
static bst_status write_waiting(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                const bst_recorder_truth_head *head) {
    bst_recorder_state *s = &recorder->sensors[sensor];
    if (!s->frame_waits) {
        return BST_OK;
    }
    s->frame_waits = false;
    bst_status status = write_frame(ctx, recorder, sensor, &s->frame, head);
    bst_frame_release(s->frame.frame);
    return status;
}

/* Records planes of a frame with the FITS header of that frame. */
static bst_status take_planes(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                              int64_t written_tick) {
    (void)written_tick;
    const bst_planes *p = payload;
    bst_recorder_state *s = &recorder->sensors[sensor];
    if (s->shown.id != p->exposure_id) {
        if (recorder->begin_tick > 0 && s->shown.id < 0) {
            return BST_OK; /* its frame came before the record began */
        }
        return bst_fail(ctx, BST_ERR_STATE, "%s/%s: planes of exposure %lld without its frame",
                        s->observer, s->sensor, (long long)p->exposure_id);
    }
    for (int k = 0; k < BST_PLANE_COUNT; k++) {
        const void *pixels = k == BST_PLANE_SEGMENTATION ? (const void *)p->segmentation
                             : k == BST_PLANE_SATURATION ? (const void *)p->saturation
                             : k == BST_PLANE_PARTS      ? (const void *)p->parts
                                                         : (const void *)p->electrons[k];
        if (!pixels) {
            continue;
        }
        if (!s->planes[k]) {
            BST_TRY(bst_recorder_open_file(ctx, recorder, sensor, plane_choices[k], false,
                                           &s->planes[k]));
        }
        const bst_fits_plane plane = {plane_names[k], pixels, p->width, p->height};
        BST_TRY(bst_fits_write_plane(ctx, s->planes[k], &s->shown, &plane, NULL));
    }
    return BST_OK;
}

static bst_recorder_truth_head *find_head(bst_recorder_state *s, int64_t exposure_id) {
    for (int i = 0; i < BST_TRUTH_HEADS; i++) {
        if (s->heads[i].valid && s->heads[i].exposure_id == exposure_id) {
            return &s->heads[i];
        }
    }
    return NULL;
}

static bst_status take_frame(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                             int64_t written_tick) {
    (void)written_tick;
    const bst_frame_message *m = payload;
    bst_recorder_state *s = &recorder->sensors[sensor];
    if (s->frame_waits) {
        bst_log(ctx, BST_LOG_WARNING, "%s/%s: frame %lld has no truth and gets no WCS", s->observer,
                s->sensor, (long long)s->frame.exposure_id);
        BST_TRY(write_waiting(ctx, recorder, sensor, NULL));
    }
    bst_recorder_truth_head *head = find_head(s, m->exposure_id);
    if (head || !s->has_truth || m->start_tick < recorder->begin_tick) {
        bst_status status = write_frame(ctx, recorder, sensor, m, head);
        if (head) {
            head->valid = false;
        }
        return status;
    }
    s->frame = *m;
    s->frame_waits = true;
    if (m->frame) {
        bst_frame_retain(m->frame);
    }
    return BST_OK;
}

static bst_status take_truth(bst_ctx *ctx, bst_recorder *recorder, int sensor, const void *payload,
                             int64_t written_tick) {
    const bst_truth *t = payload;
    bst_recorder_state *s = &recorder->sensors[sensor];
    bst_recorder_truth_head head = {
        .valid = true,
        .exposure_id = t->exposure_id,
        .q_cam_from_gcrf_mean = t->q_cam_from_gcrf_mean,
        .observer_gcrf_m = t->observer_gcrf_m,
        .observer_gcrf_mps = t->observer_gcrf_mps,
        .pixel_scale_arcsec = t->pixel_scale_arcsec,
        .body_fraction = {t->earth_fraction, t->moon_fraction, t->sun_fraction},
        .light = {.velocity_mps = t->velocity_bary_mps, .sun_m = t->sun_m}};
    if (s->frame_waits && s->frame.exposure_id == t->exposure_id) {
        BST_TRY(write_waiting(ctx, recorder, sensor, &head));
    } else if (!t->dropped) {
        s->heads[s->next_head] = head;
        s->next_head = (s->next_head + 1) % BST_TRUTH_HEADS;
    }
    return recorder->tables[BST_TABLE_TRUTH]
               ? bst_recorder_truth_rows(ctx, recorder, sensor, payload, written_tick)
               : BST_OK;
}

bst_status bst_recorder_channel(bst_ctx *ctx, bst_recorder *recorder, int sensor,
                                const char *channel, const void *payload, int64_t written_tick) {
    assert(recorder && channel && payload && sensor >= 0);
    if (sensor < 0 || sensor >= recorder->sensor_count) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "sensor %d of %d is not recorded", sensor,
                        recorder->sensor_count);
    }
    const channel_rows *found = find_channel(recorder, channel);
    return found ? found->rows(ctx, recorder, sensor, payload, written_tick) : BST_OK;
}

bst_status bst_recorder_event(bst_ctx *ctx, bst_recorder *recorder, int64_t tick,
                              const char *source, const char *kind, const char *text) {
    if (!recorder->tables[BST_TABLE_EVENTS]) {
        return BST_OK;
    }
    const bst_io_value cells[] = {
        bst_io_int_value(tick), bst_io_real_value((double)tick / (double)recorder->tick_rate_hz),
        bst_io_text_value(source), bst_io_text_value(kind), bst_io_text_value(text)};
    return bst_io_table_append(ctx, recorder->tables[BST_TABLE_EVENTS], cells);
}

bst_status bst_recorder_close(bst_ctx *ctx, bst_recorder *recorder) {
    if (!recorder) {
        return BST_OK;
    }
    bst_status status = BST_OK;
    for (int i = 0; i < recorder->sensor_count; i++) {
        bst_status waiting = write_waiting(status == BST_OK ? ctx : NULL, recorder, i, NULL);
        status = status == BST_OK ? waiting : status; /* the message of the first failure is kept */
    }
    bst_status committed = bst_run_commit(status == BST_OK ? ctx : NULL, recorder->run);
    status = status == BST_OK ? committed : status;
    bst_run_set_before_commit(recorder->run, NULL, NULL);
    for (int i = 0; i < recorder->sensor_count; i++) {
        bst_status closed =
            bst_fits_close(status == BST_OK ? ctx : NULL, recorder->sensors[i].fits);
        status = status == BST_OK ? closed : status;
        for (int k = 0; k < BST_PLANE_COUNT; k++) {
            closed = bst_fits_close(status == BST_OK ? ctx : NULL, recorder->sensors[i].planes[k]);
            status = status == BST_OK ? closed : status;
        }
    }
    free(recorder->object_seen);
    free(recorder);
    return status;
}
