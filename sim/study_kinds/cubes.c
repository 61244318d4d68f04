/* Study kind "cubes": a run makes a labelled sequence of frames for training and testing of
 * detectors. */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "boresight/version.h"
#include "sim/cli/plugins.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/draft.h"
#include "sim/core/folder.h"
#include "sim/io/fits_frames.h"
#include "sim/study_kinds/study_card.h"
#include "sim/study_kinds/study_kinds.h"
#include "sim/study_kinds/study_labels.h"
#include "sim/study_kinds/study_plugins.h"
#include "sim/world/frame_updates.h"
#include "sim/world/scene/object_shape.h"

enum {
    FRAMES,
    SATELLITES,
    STARS,
    MEAN_SNR,
    LONGEST,
    BACKGROUND,
    BYTES,
    LABEL_BYTES,
    MASK_BYTES,
    PART_BYTES,
    PART,
    METRICS
};

_Static_assert((int)METRICS <= (int)BST_STUDY_METRICS,
               "results of a run have room for the figures");
static const bst_study_metric metrics[METRICS] = {
    [FRAMES] = {"frames", "", "Frames.", 0},
    [SATELLITES] = {"satellite_labels", "", "Labels of satellites in all frames.", 0},
    [STARS] = {"star_labels", "", "Labels of stars in all frames.", 0},
    [MEAN_SNR] = {"mean_snr", "", "Mean SNR of the satellites.", 0},
    [LONGEST] = {"longest_px", "px", "Longest way of a satellite through a frame.", 0},
    [BACKGROUND] = {"background_e", "e-", "Sky and dark current per pixel, mean of the frames.", 0},
    [BYTES] = {"bytes", "", "Bytes of the file of frames.", 0},
    [LABEL_BYTES] = {"label_bytes", "", "Bytes of the file of labels.", 0},
    [MASK_BYTES] = {"mask_bytes", "", "Bytes of the file of masks; 0: none.", 0},
    [PART_BYTES] = {"part_bytes", "", "Bytes of the file of masks of parts; 0: none.", 0},
    [PART] = {"part", "", "0: training, 1: validation, 2: test.", 0},
};

enum { KEPT = 8 };

/* State of writing one sequence. */
typedef struct cube {
    const bst_study_cubes_config *config;
    const bst_scenario *scenario;
    const bst_camera *camera;
    char scope[160];
    const char *target; /* FITS OBJECT; NULL: none */
    bst_fits *fits;
    bst_fits *masks, *parts;   /* of the sources, of parts of shapes; NULL: none */
    bst_fits_frame mask_frame; /* header of the newest frame, without values from its truth */
    bst_study_labels labels;
    double background;
    bst_frame_message waiting; /* the frame that waits for its truth */
    bool waits;
    bst_truth *truths[KEPT]; /* truths that precede their frames */
    size_t truth_bytes[KEPT];
    int next;
    bst_ctx *ctx;
} cube;

/* Reads the settings of a study of image cubes. */
static bst_status read_settings(bst_ctx *ctx, const bst_study_run *run, bst_study_cubes_config *c) {
    BST_TRY(
        bst_config_read(ctx, run->study->json, run->settings, "/cubes", bst_study_cubes_table, c));
    if (!(c->train + c->validation + c->test > 0.0)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /cubes: train, validation and test are all 0 (allowed: shares of "
                        "which one is above 0)",
                        run->study->file);
    }
    return BST_OK;
}

/* Finds the sensor by name, or the first one; -1: no such name. */
static int find_sensor(const bst_scenario *scenario, const char *wanted, int *observer,
                       char scope[160]) {
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int s = 0; s < observers[o].sensors.count; s++) {
            snprintf(scope, 160, "%s/%s", observers[o].name, sensors[s].name);
            if (!*wanted || strcmp(wanted, scope) == 0) {
                *observer = o;
                return s;
            }
        }
    }
    return -1;
}

/* True if the scenario renders images for the sensor. */
static bool renders(const bst_scenario *scenario, int observer, int sensor) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (module->observer == observer && module->sensor == sensor && !module->off &&
            strcmp(module->desc->role, "scenegen") == 0) {
            return true;
        }
    }
    return false;
}

static bst_status check_cubes(bst_ctx *ctx, void *user, const bst_study_run *run, bool deep) {
    bst_study_cubes_config config;
    bst_scenario scenario;
    char scope[160];
    int observer = 0;
    BST_TRY(read_settings(ctx, run, &config));
    BST_TRY(bst_study_check_scenario(ctx, user, run, deep));
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    if (status == BST_OK && deep) {
        int sensor = find_sensor(&scenario, config.sensor, &observer, scope);
        if (sensor < 0 || !renders(&scenario, observer, sensor)) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "%s: /cubes/sensor: %s (allowed: OBSERVER/SENSOR of a sensor with a "
                              "module \"scenegen\")",
                              run->study->file,
                              sensor < 0 ? "there is no such sensor" : "the sensor has no frames");
        }
    }
    bst_scenario_free(&scenario);
    return status;
}

/* ------------------------------------------------------------------ frames and labels */

static bst_status write_frame(cube *c, const bst_frame_message *m, const bst_truth *truth) {
    bst_ctx *ctx = c->ctx;
    int64_t rate = c->scenario->tick_rate_hz;
    bst_camera camera = *c->camera;
    char utc[48];
    bst_fits_frame frame = {
        .id = m->exposure_id,
        .start = bst_time_at_tick(c->scenario->epoch, m->start_tick, rate),
        .exposure_s = (double)(m->end_tick - m->start_tick) / (double)rate,
        .window = m->window,
        .binning = m->binning,
        .bits = m->bits,
        .has_observer = true,
        .observer_gcrf_m = truth->observer_gcrf_m,
        .observer_gcrf_mps = truth->observer_gcrf_mps,
        .body_fraction = {truth->earth_fraction, truth->moon_fraction, truth->sun_fraction}};
    const bst_light light = {.velocity_mps = truth->velocity_bary_mps, .sun_m = truth->sun_m};
    if (truth->pixel_scale_arcsec > 0.0 && truth->pixel_scale_arcsec != camera.pixel_scale_arcsec) {
        BST_TRY(bst_world_camera_at_scale(ctx, c->camera, truth->pixel_scale_arcsec, &camera));
    }
    frame.pixel_scale_arcsec = camera.pixel_scale_arcsec;
    frame.has_wcs =
        bst_wcs_fit(ctx, &camera, truth->q_cam_from_gcrf_mean, &light, &frame.wcs) == BST_OK;
    const uint16_t *pixels;
    BST_TRY(bst_frame_map(m->frame, ctx, &pixels));
    bst_status status =
        bst_fits_write(ctx, c->fits, &frame, pixels, m->frame->width, m->frame->height, NULL);
    bst_frame_unmap(m->frame);
    BST_TRY(status);
    bst_time_to_utc(frame.start, 6, utc, sizeof utc);
    bst_study_labels_frame(&c->labels, m, utc, frame.exposure_s, truth);
    c->background += truth->background_e + truth->dark_e;
    return BST_OK;
}

/* Writes the masks of the newest frame from its planes. */
static bst_status take_planes(cube *c, const bst_planes *p) {
    if (p->exposure_id != c->mask_frame.id) {
        return BST_OK;
    }
    if (c->masks && p->segmentation) {
        const bst_fits_plane plane = {"SEGMENTATION", p->segmentation, p->width, p->height};
        BST_TRY(bst_fits_write_plane(c->ctx, c->masks, &c->mask_frame, &plane, NULL));
    }
    if (c->parts && p->parts) {
        const bst_fits_plane plane = {"PARTS", p->parts, p->width, p->height};
        BST_TRY(bst_fits_write_plane(c->ctx, c->parts, &c->mask_frame, &plane, NULL));
    }
    return BST_OK;
}

/* Writes a frame with its labels, or keeps it until its truth arrives. */
static bst_status take_frame(cube *c, const bst_frame_message *m) {
    int64_t rate = c->scenario->tick_rate_hz;
    c->mask_frame =
        (bst_fits_frame){.id = m->exposure_id,
                         .start = bst_time_at_tick(c->scenario->epoch, m->start_tick, rate),
                         .exposure_s = (double)(m->end_tick - m->start_tick) / (double)rate,
                         .window = m->window,
                         .binning = m->binning,
                         .bits = m->bits,
                         .pixel_scale_arcsec = c->camera->pixel_scale_arcsec};
    for (int i = 0; i < KEPT; i++) {
        if (c->truths[i] && c->truths[i]->exposure_id == m->exposure_id) {
            return write_frame(c, m, c->truths[i]);
        }
    }
    if (c->waits) {
        bst_frame_release(c->waiting.frame);
    }
    c->waiting = *m;
    c->waits = true;
    bst_frame_retain(m->frame);
    return BST_OK;
}

static bst_status take_truth(cube *c, const bst_truth *truth) {
    if (c->waits && c->waiting.exposure_id == truth->exposure_id) {
        c->waits = false;
        bst_status status = write_frame(c, &c->waiting, truth);
        bst_frame_release(c->waiting.frame);
        return status;
    }
    size_t bytes = sizeof *truth + (size_t)truth->count * sizeof truth->items[0];
    int i = c->next++ % KEPT;
    if (c->truth_bytes[i] < bytes) {
        bst_truth *grown = realloc(c->truths[i], 2 * bytes);
        if (!grown) {
            return bst_fail(c->ctx, BST_ERR_MEMORY, "out of memory for labels");
        }
        c->truths[i] = grown;
        c->truth_bytes[i] = 2 * bytes;
    }
    memcpy(c->truths[i], truth, bytes);
    return BST_OK;
}

static bool wants(void *user, const char *scope, const char *channel, const void *payload,
                  int64_t tick, bst_hook_mark *mark) {
    cube *c = user;
    (void)payload;
    (void)tick;
    if (!mark->of) {
        bool looked_at = strcmp(scope, c->scope) == 0 && (strcmp(channel, BST_CHANNEL_FRAME) == 0 ||
                                                          strcmp(channel, BST_CHANNEL_TRUTH) == 0 ||
                                                          strcmp(channel, BST_CHANNEL_PLANES) == 0);
        mark->of = c;
        mark->unwanted_before = looked_at ? 0 : INT64_MAX;
    }
    return mark->unwanted_before == 0;
}

static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    (void)scope;
    (void)tick;
    return strcmp(channel, BST_CHANNEL_FRAME) == 0    ? take_frame(user, payload)
           : strcmp(channel, BST_CHANNEL_PLANES) == 0 ? take_planes(user, payload)
                                                      : take_truth(user, payload);
}

static bool interrupted(void *user, int64_t tick) {
    (void)user;
    (void)tick;
    return bst_stop_requested();
}

/* ------------------------------------------------------------------ a sequence */

/* Paths of the final file and its draft, such as "OUT/ImageFiles/000017.fits". */
static bst_status path_of(bst_ctx *ctx, const bst_study_run *run, const char *folder,
                          const char *end, char path[4096]) {
    int n =
        snprintf(path, 4096, "%.3900s/%s/%06" PRId64 "%s", run->out, folder, run->place.run, end);
    return n > 0 && n < 4096 ? BST_OK : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: too long", run->out);
}

/* Files of a sequence: frames, labels, and masks where they are asked for. */
enum { IMAGE_FILE, LABEL_FILE, MASK_FILE, PART_FILE, FILES };

static const char *const folders[FILES] = {"ImageFiles", "Annotations", "MaskFiles", "PartFiles"};
static const char *const endings[FILES] = {".fits", ".json", ".fits", ".fits"};
/* figures that hold their sizes */
static const int bytes[FILES] = {BYTES, LABEL_BYTES, MASK_BYTES, PART_BYTES};

/* Paths of the files of a sequence, and of their drafts. */
typedef struct cube_paths {
    char final[FILES][4096], draft[FILES][4096];
} cube_paths;

static bool has_file(const bst_study_cubes_config *config, int file) {
    return file == MASK_FILE ? config->masks : file == PART_FILE ? config->part_masks : true;
}

static bst_status make_paths(bst_ctx *ctx, const bst_study_run *run, cube_paths *out) {
    for (int k = 0; k < FILES; k++) {
        char draft[32];
        snprintf(draft, sizeof draft, "%s.partial", endings[k]);
        BST_TRY(path_of(ctx, run, folders[k], endings[k], out->final[k]));
        BST_TRY(path_of(ctx, run, folders[k], draft, out->draft[k]));
    }
    return BST_OK;
}

static bst_status make_folders(bst_ctx *ctx, const char *out,
                               const bst_study_cubes_config *config) {
    for (int k = 0; k < FILES; k++) {
        char path[4200];
        if (!has_file(config, k)) {
            continue;
        }
        snprintf(path, sizeof path, "%.4000s/%s", out, folders[k]);
        BST_TRY(bst_folder_make(ctx, path));
    }
    return BST_OK;
}

/* Numbers and names of the parts of all objects with a shape, as the member "parts". */
static void put_parts(FILE *stream, const bst_world *world) {
    bool first = true;
    fprintf(stream, ",\"parts\":[");
    for (int i = 0; i < bst_world_object_count(world); i++) {
        const bst_world_object_info *info = bst_world_object(world, i);
        const bst_satellite *satellite = info->shape ? info->shape->satellite : NULL;
        for (int p = 0; satellite && p < satellite->part_count; p++) {
            fprintf(stream, "%s{\"number\":%d", first ? "" : ",",
                    bst_world_first_part(world, i) + p);
            bst_study_labels_text(stream, "object_name", info->name);
            bst_study_labels_text(stream, "name", satellite->parts[p].name);
            fputc('}', stream);
            first = false;
        }
    }
    fprintf(stream, "]");
}

/* Starts the file of masks `file`. */
static bst_status create_masks(bst_ctx *ctx, const bst_fits_info *frames, const char *path,
                               bst_fits **out) {
    bst_fits_info info = *frames;
    info.compression = BST_FITS_RAW;
    info.content = BST_FITS_ITEMS;
    unlink(path);
    return bst_fits_create(ctx, path, BST_FITS_EXTENSIONS, &info, out);
}

static bst_status step_through(bst_ctx *ctx, cube *c, bst_simulation *sim, const cube_paths *paths,
                               const bst_study_run *run) {
    const char *fits = paths->draft[IMAGE_FILE], *labels = paths->draft[LABEL_FILE];
    char program[64];
    snprintf(program, sizeof program, "boresight %s", bst_version());
    const char *slash = strchr(c->scope, '/');
    char observer[160];
    snprintf(observer, sizeof observer, "%.*s", (int)(slash - c->scope), c->scope);
    bst_fits_info info = {.observer = observer,
                          .instrument = slash + 1,
                          .object = c->target,
                          .program = program,
                          .camera = c->camera,
                          .checksums = c->scenario->record.checksums,
                          .compression = c->config->compress ? BST_FITS_RICE : BST_FITS_RAW,
                          .content = BST_FITS_COUNTS};
    unlink(fits);
    BST_TRY(bst_fits_create(ctx, fits, c->config->compress ? BST_FITS_EXTENSIONS : BST_FITS_CUBE,
                            &info, &c->fits));
    if (c->config->masks) {
        BST_TRY(create_masks(ctx, &info, paths->draft[MASK_FILE], &c->masks));
    }
    if (c->config->part_masks) {
        BST_TRY(create_masks(ctx, &info, paths->draft[PART_FILE], &c->parts));
    }
    int fd;
    BST_TRY(bst_draft_make_at(ctx, labels, &fd));
    c->labels.stream = fdopen(fd, "w");
    if (!c->labels.stream) {
        close(fd);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", labels);
    }
    fprintf(c->labels.stream,
            "{\"data\":{\"file\":{\"dirname\":\"ImageFiles\",\"sequence\":%" PRId64
            ",\"filename\":\"%06" PRId64
            ".fits\"},\"sensor\":{\"height\":%lld,\"width\":%lld,"
            "\"iFOVy\":%.12g,\"iFOVx\":%.12g},\"metadata\":{\"program\":\"%s\",\"scenario\":\"%s\","
            "\"sensor\":\"%s\",\"seed\":\"0x%" PRIX64 "\",\"run\":%" PRId64 "}",
            run->place.run, run->place.run, (long long)c->camera->height_px,
            (long long)c->camera->width_px, c->camera->pixel_scale_arcsec / 3600.0,
            c->camera->pixel_scale_arcsec / 3600.0, program, c->scenario->name, c->scope,
            c->scenario->seed, c->scenario->run);
    if (c->config->part_masks) {
        put_parts(c->labels.stream, c->labels.world);
    }
    fprintf(c->labels.stream, ",\"frames\":[");
    const bst_engine_hooks hooks = {
        .user = c, .message = on_message, .interrupted = interrupted, .wants = wants, .ctx = ctx};
    bst_engine_set_hooks(bst_simulation_engine(sim), &hooks);
    return bst_engine_run(ctx, bst_simulation_engine(sim), c->scenario->duration_ticks);
}

static bst_status close_files(bst_ctx *ctx, cube *c, bst_status status) {
    bst_ctx quiet = {0};
    bst_status closed = bst_fits_close(status == BST_OK ? ctx : &quiet, c->fits);
    bst_status masks_closed = bst_fits_close(status == BST_OK ? ctx : &quiet, c->masks);
    bst_status parts_closed = bst_fits_close(status == BST_OK ? ctx : &quiet, c->parts);
    closed = closed == BST_OK ? masks_closed : closed;
    closed = closed == BST_OK ? parts_closed : closed;
    if (c->labels.stream) {
        fprintf(c->labels.stream,
                "\n],\"stats\":{\"num_frames\":%" PRId64 ",\"num_satellite_labels\":%" PRId64
                ",\"num_star_labels\":%" PRId64 "}}}\n",
                c->labels.frames, c->labels.satellites, c->labels.stars);
        bool bad = ferror(c->labels.stream) != 0;
        bad = fclose(c->labels.stream) != 0 || bad;
        if (bad && status == BST_OK && closed == BST_OK) {
            closed = bst_fail(ctx, BST_ERR_IO, "labels cannot be written: %s", strerror(errno));
        }
    }
    return status == BST_OK ? closed : status;
}

static double file_bytes(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 ? (double)info.st_size : -1.0;
}

int bst_study_part(const bst_study_cubes_config *c, uint64_t seed, int64_t run) {
    double sum = c->train + c->validation + c->test;
    double u = sum * bst_rng_uniform(bst_rng_make_key(seed, 0, "cubes", "parts"), (uint64_t)run, 0);
    return u < c->train ? 0 : u < c->train + c->validation ? 1 : 2;
}

static void fill(const cube *c, const cube_paths *paths, const bst_study_run *run, double *m) {
    const bst_study_labels *l = &c->labels;
    m[FRAMES] = (double)l->frames;
    m[SATELLITES] = (double)l->satellites;
    m[STARS] = (double)l->stars;
    m[MEAN_SNR] = l->satellites > 0 ? l->snr_sum / (double)l->satellites : NAN;
    m[LONGEST] = l->satellites > 0 ? l->longest_px : NAN;
    m[BACKGROUND] = l->frames > 0 ? c->background / (double)l->frames : NAN;
    for (int k = 0; k < FILES; k++) {
        m[bytes[k]] = has_file(c->config, k) ? file_bytes(paths->draft[k]) : 0.0;
    }
    m[PART] = bst_study_part(c->config, c->scenario->seed, run->place.run);
}

static bst_status make_cube(bst_ctx *ctx, cube *c, bst_simulation *sim, const bst_study_run *run,
                            bst_study_result *out) {
    cube_paths *paths = calloc(1, sizeof *paths);
    if (!paths) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the paths of a sequence");
    }
    bst_status status = make_paths(ctx, run, paths);
    status = status == BST_OK ? make_folders(ctx, run->out, c->config) : status;
    bool begun = status == BST_OK;
    status = begun ? step_through(ctx, c, sim, paths, run) : status;
    status = close_files(ctx, c, status);
    if (status == BST_OK && c->labels.frames == 0) {
        status =
            bst_fail(ctx, BST_ERR_CONFIG,
                     "%s: no frame ends within the run; make duration_s longer", c->scenario->file);
    }
    if (status == BST_OK) {
        fill(c, paths, run, out->metrics);
    }
    /* the labels last: with them the sequence is complete */
    static const int order[FILES] = {MASK_FILE, PART_FILE, IMAGE_FILE, LABEL_FILE};
    for (int k = 0; status == BST_OK && k < FILES; k++) {
        if (has_file(c->config, order[k]) &&
            rename(paths->draft[order[k]], paths->final[order[k]]) != 0) {
            status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be put in its place: %s",
                              paths->final[order[k]], strerror(errno));
        }
    }
    for (int k = 0; begun && status != BST_OK && k < FILES; k++) {
        unlink(paths->draft[k]);
    }
    free(paths);
    return status;
}

static void ask_for_masks(const bst_study_cubes_config *config, bst_scenario *scenario) {
    if (config->masks) {
        scenario->record.planes |= UINT32_C(1) << BST_PLANE_SEGMENTATION;
    }
    if (config->part_masks) {
        scenario->record.planes |= UINT32_C(1) << BST_PLANE_PARTS;
    }
}

static bst_status run_cubes(bst_ctx *ctx, void *worker, const bst_study_run *run,
                            bst_study_result *out) {
    bst_study_cubes_config config;
    bst_scenario scenario;
    bst_simulation *sim = NULL;
    cube c = {.config = &config, .scenario = &scenario, .ctx = ctx};
    int observer = 0, sensor = -1;
    BST_TRY(read_settings(ctx, run, &config));
    bst_status status = bst_study_read_scenario(ctx, run, &scenario);
    if (status == BST_OK) {
        ask_for_masks(&config, &scenario);
        sensor = find_sensor(&scenario, config.sensor, &observer, c.scope);
        status = sensor >= 0 ? bst_study_simulation(ctx, worker, &scenario, &sim)
                             : bst_fail(ctx, BST_ERR_CONFIG, "%s: there is no sensor %s",
                                        scenario.file, config.sensor);
    }
    if (status == BST_OK) {
        const bst_world *world = bst_simulation_world(sim);
        c.camera = bst_world_camera(world, observer, sensor);
        const bst_observer_config *observers = scenario.observers.items;
        const bst_sensor_config *sensors = observers[observer].sensors.items;
        c.target = *sensors[sensor].cue.object ? sensors[sensor].cue.object : NULL;
        c.labels = (bst_study_labels){.world = world,
                                      .box_px = config.box_px,
                                      .star_limit_v_mag = config.star_limit_v_mag,
                                      .mask = config.masks};
        status = make_cube(ctx, &c, sim, run, out);
    }
    if (c.waits) {
        bst_frame_release(c.waiting.frame);
    }
    for (int i = 0; i < KEPT; i++) {
        free(c.truths[i]);
    }
    bst_simulation_free(sim);
    bst_scenario_free(&scenario);
    return status;
}

/* ------------------------------------------------------------------ the kind */

static bst_status emit_cubes(bst_ctx *ctx, void *user, const bst_study_run *run, FILE *stream,
                             FILE *command) {
    bst_study_cubes_config config;
    bst_scenario scenario;
    (void)user;
    BST_TRY(read_settings(ctx, run, &config));
    bst_status status = bst_plugins_scenario_read(ctx, run->scenario, &scenario);
    if (status == BST_OK) {
        ask_for_masks(&config, &scenario);
        scenario.record.frames = config.compress ? BST_RECORD_EXTENSIONS : BST_RECORD_CUBE;
        scenario.record.compression = config.compress ? BST_FITS_RICE : BST_FITS_RAW;
        status = bst_study_print_scenario(ctx, &scenario, stream);
        fprintf(command,
                "by hand: boresight run SCENARIO.json --out FOLDER; its frames.fits is "
                "ImageFiles/%06" PRId64 ".fits\n",
                run->place.run);
    }
    bst_scenario_free(&scenario);
    return status;
}

static bool intact(void *user, const bst_study_run *run, const double *m) {
    char path[4096];
    (void)user;
    for (int k = 0; k < FILES; k++) {
        bool written = k == IMAGE_FILE || k == LABEL_FILE || m[bytes[k]] != 0.0;
        if (written && (path_of(NULL, run, folders[k], endings[k], path) != BST_OK ||
                        file_bytes(path) != m[bytes[k]])) {
            return false;
        }
    }
    return true;
}

static bst_status finish(bst_ctx *ctx, void *user, const struct bst_results *results,
                         const char *out) {
    (void)user;
    const bst_study_card_metrics columns = {FRAMES, SATELLITES, STARS, BYTES, PART};
    return bst_study_write_card(ctx, results, &columns, out);
}

const bst_study_kind bst_study_cubes_kind = {.name = "cubes",
                                             .metrics = metrics,
                                             .metric_count = METRICS,
                                             .check = check_cubes,
                                             .open = bst_study_warm_open,
                                             .close = bst_study_warm_close,
                                             .run = run_cubes,
                                             .emit = emit_cubes,
                                             .intact = intact,
                                             .finish = finish,
                                             .stop_requested = bst_study_stop_requested};
