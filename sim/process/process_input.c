#define _XOPEN_SOURCE 700 /* realpath */
/* Files of a run with recorded frames: scenario, pointing, keyword map, list of files. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/folder.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/io/draft_file.h"
#include "sim/process/process_internal.h"

/* Time of the run after the last exposure, s: processing and recording. */
static const double TAIL_S = 1.0;
/* Time between the last exposure and the next one, which the run does not reach, s. */
static const double LAST_PERIOD_S = 2.0;
/* Attitudes per exposure that are recorded. */
static const double PATH_SAMPLES = 50.0;
/* Gravitational parameter of the Earth, m^3/s^2 (EGM2008), for states at both ends of an exposure.
 */
static const double EARTH_GM = 3.986004415e14;

static double seconds(int64_t ticks) {
    return (double)ticks / BST_PROCESS_TICK_RATE_HZ;
}

/* Array of numbers that read back as the same bits; NULL: out of memory. */
static cJSON *numbers(const double *values, int count) {
    cJSON *array = cJSON_CreateArray();
    for (int i = 0; array && i < count; i++) {
        char text[40];
        bst_text_of_number(values[i], text, sizeof text);
        cJSON_AddItemToArray(array, cJSON_CreateRaw(text));
    }
    return array;
}

static void put_number(cJSON *object, const char *key, double value) {
    char text[40];
    bst_text_of_number(value, text, sizeof text);
    cJSON_AddItemToObject(object, key, cJSON_CreateRaw(text));
}

static void put_quat(cJSON *object, const char *key, bst_quat q) {
    const double values[] = {q.x, q.y, q.z, q.w};
    cJSON_AddItemToObject(object, key, numbers(values, 4));
}

static void put_vector(cJSON *object, const char *key, bst_vec3 v) {
    const double values[] = {v.x, v.y, v.z};
    cJSON_AddItemToObject(object, key, numbers(values, 3));
}

/* Writes a document and deletes it. */
static bst_status write_json(bst_ctx *ctx, const bst_process *p, const char *name, cJSON *json) {
    char path[4096];
    bst_draft draft;
    char *text = json ? cJSON_Print(json) : NULL;
    cJSON_Delete(json);
    bst_status status =
        text ? bst_process_path(ctx, p, name, path) : bst_fail(ctx, BST_ERR_MEMORY, "no memory");
    if (status == BST_OK) {
        status = bst_draft_open(ctx, path, &draft);
    }
    if (status == BST_OK) {
        fprintf(draft.stream, "%s\n", text);
        status = bst_draft_close(ctx, &draft, BST_OK);
    }
    free(text);
    return status;
}

/* Attitude of a frame without one of its own: between the nearest solved frames, at a constant
 * rate; else the header's; else that of the GCRF axes. */
static bst_quat attitude_without_stars(const bst_process *p, int i) {
    const bst_process_frame *f = &p->frames[i], *before = NULL, *after = NULL;
    for (int k = i - 1; k >= 0 && !before; k--) {
        before = p->frames[k].solved ? &p->frames[k] : NULL;
    }
    for (int k = i + 1; k < p->count && !after; k++) {
        after = p->frames[k].solved ? &p->frames[k] : NULL;
    }
    if (before && after) {
        double share = (double)(f->start_tick - before->start_tick) /
                       (double)(after->start_tick - before->start_tick);
        return bst_quat_slerp(before->q_middle, after->q_middle, share);
    }
    return before                   ? before->q_middle
           : after                  ? after->q_middle
           : f->has_header_attitude ? f->q_header
                                    : BST_QUAT_IDENTITY;
}

/* First attitude of a frame's exposure. */
static bst_quat first_attitude(const bst_process *p, int i) {
    const bst_process_frame *f = &p->frames[i];
    return f->node_count > 0 ? f->nodes[0].q_cam_from_gcrf
           : f->solved       ? f->q_middle
                             : attitude_without_stars(p, i);
}

static void put_node(cJSON *list, double time_s, bst_quat q) {
    cJSON *node = cJSON_CreateObject();
    put_number(node, "time_s", time_s);
    put_quat(node, "q_cam_from_gcrf", bst_quat_unit(q));
    cJSON_AddItemToArray(list, node);
}

/* Pointing during a frame: ascending times from 0 to the exposure. */
static void put_pointing(cJSON *object, const bst_process *p, int i) {
    const bst_process_frame *f = &p->frames[i];
    double exposure_s = seconds(f->exposure_ticks), last_s = 0.0;
    bool joined = i + 1 < p->count && f[1].start_tick == f->start_tick + f->exposure_ticks;
    bst_quat first = first_attitude(p, i);
    bst_quat last = joined              ? first_attitude(p, i + 1)
                    : f->node_count > 0 ? f->nodes[f->node_count - 1].q_cam_from_gcrf
                                        : first;
    cJSON *list = cJSON_AddArrayToObject(object, "pointing");
    put_node(list, 0.0, first);
    for (int k = 1; k + 1 < f->node_count; k++) {
        double time_s = f->nodes[k].share * exposure_s;
        if (time_s > last_s && time_s < exposure_s) {
            put_node(list, time_s, f->nodes[k].q_cam_from_gcrf);
            last_s = time_s;
        }
    }
    if (f->exposure_ticks > 0) {
        put_node(list, exposure_s, last);
    }
}

/* Observer's states at both ends of an exposure, by the state and the acceleration in between. */
static void put_observer(cJSON *object, const bst_process_frame *f) {
    bst_vec3 r, v;
    bst_process_observer(f, &r, &v);
    double half = 0.5 * seconds(f->exposure_ticks), range = bst_vec3_norm(r);
    bool moves = f->values.has_position && f->values.has_velocity && range > 0.0;
    bst_vec3 a = bst_vec3_scale(r, moves ? -EARTH_GM / (range * range * range) : 0.0);
    cJSON *list = cJSON_AddArrayToObject(object, "objects"), *eye = cJSON_CreateObject();
    cJSON_AddItemToArray(list, eye);
    cJSON_AddStringToObject(eye, "object", "observer");
    for (int end = -1; end <= 1; end += 2) {
        double t = end * half;
        bst_vec3 place = bst_vec3_axpy(bst_vec3_axpy(r, t, v), 0.5 * t * t, a);
        put_vector(eye, end < 0 ? "start_position_m" : "end_position_m", place);
        put_vector(eye, end < 0 ? "start_velocity_mps" : "end_velocity_mps",
                   bst_vec3_axpy(v, t, a));
    }
}

cJSON *bst_process_make_pointing(const bst_process *p) {
    cJSON *root = cJSON_CreateObject();
    cJSON_AddNumberToObject(root, "boresight_frame_updates", 1);
    cJSON *frames = cJSON_AddArrayToObject(root, "frames");
    for (int i = 0; i < p->count; i++) {
        const bst_process_frame *f = &p->frames[i];
        cJSON *frame = cJSON_CreateObject();
        int64_t period = i + 1 < p->count ? f[1].start_tick - f->start_tick
                                          : f->exposure_ticks +
                                                (int64_t)(LAST_PERIOD_S * BST_PROCESS_TICK_RATE_HZ);
        cJSON_AddNumberToObject(frame, "frame", i);
        put_number(frame, "exposure_s", seconds(f->exposure_ticks));
        put_number(frame, "period_s", seconds(period));
        put_pointing(frame, p, i);
        put_observer(frame, f);
        cJSON_AddItemToArray(frames, frame);
    }
    return root;
}

/* Sets a key unless the map's camera gives it. */
static void put_default(cJSON *object, const char *key, double value) {
    if (!cJSON_GetObjectItemCaseSensitive(object, key)) {
        put_number(object, key, value);
    }
}

static double camera_number(const cJSON *c, const char *key, double fallback) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(c, key);
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

/* Light of a star of V = 0 that makes the camera's zero point that of the frames, unless the map
 * gives it or a band. Without this, stars of an unknown camera have magnitudes too wrong to be
 * identified. */
static void put_flux(cJSON *c, double zero_point_mag) {
    double aperture_m = camera_number(c, "aperture_m", 0.1);
    double area_m2 =
        0.25 * BST_PI * aperture_m * aperture_m * (1.0 - camera_number(c, "obscuration", 0.0));
    double flux = pow(10.0, 0.4 * zero_point_mag) / (area_m2 * camera_number(c, "throughput", 0.8) *
                                                     camera_number(c, "quantum_efficiency", 0.8));
    if (isfinite(flux) && !cJSON_GetObjectItemCaseSensitive(c, "band")) {
        put_default(c, "photon_flux_v0_per_s_m2", fmin(fmax(flux, 1.0), 1e15));
    }
}

/* The camera: what the map's "camera" gives, then headers and stars. */
static bst_status make_camera(bst_ctx *ctx, const bst_process *p, cJSON **out) {
    const bst_keyword_values *v = &p->frames[0].values;
    cJSON *c;
    BST_TRY(bst_keyword_map_camera(ctx, p->map_path, &c));
    static const char *const measured[] = {"width_px", "height_px", "pixel_scale_arcsec"};
    for (size_t i = 0; i < sizeof measured / sizeof *measured; i++) {
        cJSON_DeleteItemFromObjectCaseSensitive(c, measured[i]);
    }
    cJSON_AddNumberToObject(c, "width_px", p->width);
    cJSON_AddNumberToObject(c, "height_px", p->height);
    put_number(c, "pixel_scale_arcsec", p->scale_arcsec);
    put_default(c, "aperture_m", 0.1);
    put_default(c, "psf_fwhm_px", 2.0);
    put_default(c, "bits", 16);
    put_default(c, "gain_e_per_dn", v->gain_e_per_dn / p->map.dn_per_unit);
    put_default(c, "read_noise_e", v->read_noise_e);
    put_default(c, "full_well_e", v->full_well_e);
    put_flux(c, p->zero_point_mag);
    bool overscan = *p->map.bias_section != '\0';
    put_default(c, "offset_dn",
                p->map.pedestal_dn + p->map.dn_per_unit * (overscan ? 0.0 : v->offset_dn));
    *out = c;
    return BST_OK;
}

/* Longest time from the start of a frame to that of the next one. */
static double longest_cycle_s(const bst_process *p) {
    double longest = seconds(p->frames[0].exposure_ticks) + LAST_PERIOD_S;
    for (int i = 1; i < p->count; i++) {
        longest = fmax(longest, seconds(p->frames[i].start_tick - p->frames[i - 1].start_tick));
    }
    return longest;
}

static cJSON *make_modules(const bst_process *p, double longest_s) {
    cJSON *modules = cJSON_CreateObject();
    cJSON *gimbal = cJSON_AddObjectToObject(modules, "gimbal");
    cJSON_AddStringToObject(gimbal, "type", "scripted");
    cJSON *platform = cJSON_AddObjectToObject(gimbal, "platform");
    put_number(platform, "history_s", ceil(longest_s) + 4.0);
    put_number(platform, "telemetry_history_s", ceil(longest_s) + 8.0);
    cJSON *scenegen = cJSON_AddObjectToObject(modules, "scenegen");
    cJSON_AddStringToObject(scenegen, "type", "recorded");
    cJSON_AddStringToObject(scenegen, "frames", "frames.txt");
    cJSON_AddStringToObject(scenegen, "keyword_map", "keyword_map.json");
    cJSON_AddBoolToObject(scenegen, "flip_rows", p->options.flip_rows);
    cJSON *imgproc = cJSON_AddObjectToObject(modules, "imgproc");
    cJSON_AddStringToObject(imgproc, "type", "standard");
    cJSON_AddBoolToObject(imgproc, "long_streaks", true);
    cJSON *tracker = cJSON_AddObjectToObject(modules, "tracker");
    cJSON_AddStringToObject(tracker, "type", "ekf");
    /* two frames further on a track must still be able to begin */
    put_number(tracker, "initiation_gap_s", fmin(fmax(2.5 * longest_cycle_s(p), 5.0), 1e4));
    return modules;
}

/* Name of the run: that of the output folder, as far as a name allows it. */
static void run_name(const bst_process *p, char name[64]) {
    const char *out = p->request->out, *slash = strrchr(out, '/');
    snprintf(name, 64, "%s", slash && slash[1] ? slash + 1 : out);
    for (char *c = name; *c; c++) {
        *c = (unsigned char)*c < 33 || *c == '/' || *c == 127 ? '_' : *c;
    }
    if (!*name || *name == '.') {
        snprintf(name, 64, "frames");
    }
}

/* The only observer with its only sensor. */
static cJSON *make_observer(const bst_process *p, cJSON *camera) {
    double longest_s = 0.0;
    for (int i = 0; i < p->count; i++) {
        longest_s = fmax(longest_s, seconds(p->frames[i].exposure_ticks));
    }
    cJSON *observer = cJSON_CreateObject(), *orbit, *sensor = cJSON_CreateObject();
    cJSON_AddStringToObject(observer, "name", "observer");
    orbit = cJSON_AddObjectToObject(observer, "orbit");
    cJSON_AddStringToObject(orbit, "source", "injected");
    cJSON_AddStringToObject(orbit, "states_file", "pointing.json");
    cJSON_AddStringToObject(orbit, "states_object", "observer");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(observer, "sensors"), sensor);
    cJSON_AddStringToObject(sensor, "name", "camera");
    cJSON_AddStringToObject(sensor, "frame_updates_file", "pointing.json");
    cJSON_AddItemToObject(sensor, "camera", camera);
    cJSON *exposure = cJSON_AddObjectToObject(sensor, "exposure");
    put_number(exposure, "exposure_s", seconds(p->frames[0].exposure_ticks));
    put_number(exposure, "period_s", seconds(p->frames[0].exposure_ticks) + LAST_PERIOD_S);
    cJSON_AddItemToObject(sensor, "modules", make_modules(p, longest_s));
    return observer;
}

bst_status bst_process_make_scenario(bst_ctx *ctx, const bst_process *p, cJSON **out) {
    cJSON *camera;
    BST_TRY(make_camera(ctx, p, &camera));
    char epoch[40], name[64];
    const bst_process_frame *last = &p->frames[p->count - 1];
    cJSON *root = cJSON_CreateObject();
    run_name(p, name);
    bst_time_to_utc(p->frames[0].values.start, 9, epoch, sizeof epoch);
    cJSON_AddNumberToObject(root, "boresight", 1);
    cJSON_AddStringToObject(root, "name", name);
    cJSON_AddStringToObject(root, "description", "Recorded frames: written by boresight process.");
    cJSON_AddStringToObject(root, "epoch_utc", epoch);
    put_number(root, "duration_s", seconds(last->start_tick + last->exposure_ticks) + TAIL_S);
    cJSON_AddNumberToObject(root, "tick_rate_hz", BST_PROCESS_TICK_RATE_HZ);
    cJSON *world = cJSON_AddObjectToObject(root, "world");
    cJSON_AddStringToObject(world, "star_catalogue", p->request->catalogue);
    cJSON_AddItemToArray(cJSON_AddArrayToObject(root, "observers"), make_observer(p, camera));
    cJSON *record = cJSON_AddObjectToObject(root, "record");
    cJSON_AddStringToObject(record, "frames", "extensions");
    /* attitudes for the path of the streaks in pictures */
    double exposure_s = fmax(seconds(p->frames[0].exposure_ticks), 1e-3);
    put_number(record, "telemetry_hz", fmin(fmax(ceil(PATH_SAMPLES / exposure_s), 1.0), 100.0));
    *out = root;
    return BST_OK;
}

/* frames.txt: the files in the order of their frames. */
static bst_status write_list(bst_ctx *ctx, const bst_process *p) {
    char path[4096], here[4096];
    bst_draft draft;
    const char *before = NULL;
    BST_TRY(bst_process_path(ctx, p, "input/frames.txt", path));
    BST_TRY(bst_draft_open(ctx, path, &draft));
    bst_status status = BST_OK;
    for (int i = 0; i < p->count && status == BST_OK; i++) {
        const char *file = p->frames[i].path;
        if (!before || strcmp(file, before) != 0) {
            char *full = realpath(file, NULL);
            int n = full ? snprintf(here, sizeof here, "%s", full) : -1;
            free(full);
            if (n < 0 || (size_t)n >= sizeof here || strchr(here, '\n')) {
                status = bst_fail(ctx, BST_ERR_IO, "%.400s: has no full path on one line", file);
            } else {
                fprintf(draft.stream, "%s\n", here);
            }
        }
        before = file;
    }
    return bst_draft_close(ctx, &draft, status);
}

/* keyword_map.json: the map as it is used; exposures are counted in the order of the frames. */
static cJSON *make_map(const bst_process *p) {
    bst_keyword_map map = p->map;
    map.exposure_id = (bst_keyword_number){.factor = 1.0, .value = -1.0};
    return bst_config_echo(bst_keyword_map_table, &map);
}

bst_status bst_process_write_input(bst_ctx *ctx, const bst_process *p) {
    char folder[4096];
    cJSON *scenario;
    BST_TRY(bst_process_path(ctx, p, "input", folder));
    BST_TRY(bst_folder_make(ctx, folder));
    BST_TRY(bst_process_make_scenario(ctx, p, &scenario));
    bst_status status = write_json(ctx, p, "input/scenario.json", scenario);
    if (status == BST_OK) {
        status = write_json(ctx, p, "input/pointing.json", bst_process_make_pointing(p));
    }
    if (status == BST_OK) {
        status = write_json(ctx, p, "input/keyword_map.json", make_map(p));
    }
    return status == BST_OK ? write_list(ctx, p) : status;
}
