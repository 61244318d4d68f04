/* Exports frames with SatNet annotations: ImageFiles/SET.NNNN.fits and Annotations/SET.NNNN.json.
 * Keys and meanings as in satsim/io/satnet.py of github.com/ssc-ai/satsim (commit 03e5ff3):
 * coordinates are fractions of the image between pixel edges, (pixel + 0.5) / size. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "boresight/version.h"
#include "sim/cli/progress.h"
#include "sim/core/compare.h"
#include "sim/core/fnv.h"
#include "sim/core/folder.h"
#include "sim/core/json_number.h"
#include "sim/core/text.h"
#include "sim/export/export.h"
#include "sim/export/mask_labels.h"
#include "sim/export/shape_labels.h"
#include "sim/io/draft_file.h"
#include "sim/io/fits_frames.h"
#include "sim/io/fits_reader.h"
#include "sim/run/run_observations.h"
#include "sim/world/frame_updates.h"

enum { PARTS = 3 };

static const char *const part_names[PARTS] = {"train.txt", "val.txt", "test.txt"};

bst_status bst_export_split(bst_ctx *ctx, const char *text, double shares[PARTS]) {
    char rest;
    double *s = shares;
    bool good = sscanf(text, "%lf,%lf,%lf%c", &s[0], &s[1], &s[2], &rest) == 3;
    double sum = good ? s[0] + s[1] + s[2] : NAN;
    if (!good || !(s[0] >= 0.0 && s[1] >= 0.0 && s[2] >= 0.0) || !(sum > 0.0) || !isfinite(sum)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--split %s: three shares of 0 or more are expected, such as 80,10,10",
                        text);
    }
    for (int i = 0; i < PARTS; i++) {
        shares[i] /= sum;
    }
    return BST_OK;
}

/* State of exporting the frames of one sensor. */
typedef struct job {
    const bst_export *e;
    const bst_run_sensor *sensor;
    const bst_scenario *scenario;
    const bst_camera *camera;
    bst_fits_reader *fits;
    bst_io_rows *truth; /* truth rows of the sensor, by exposure; at the next unprocessed row */
    bool truth_more;
    bst_shape_labels shapes;
    bst_mask_labels masks; /* of the parts of shapes */
    bool mask;             /* the run has a segmentation mask */
    int64_t written;
    double shares[PARTS];
    bst_draft *parts; /* [PARTS]; NULL: no split */
    char set[256];
} job;

/* ------------------------------------------------------------------ one frame */

/* Values of a frame from the tables of the run. */
typedef struct frame_row {
    int64_t id, fits_index;
    bst_fits_frame frame;
    char start_utc[48];
} frame_row;

static const char frames_sql[] =
    "SELECT f.exposure_id, f.fits_index, f.start_tick, f.exposure_s, f.x0_px, f.y0_px, f.width_px,"
    " f.height_px, f.binning, f.bits, f.start_utc, e.pixel_scale_arcsec,"
    " e.q_cam_from_gcrf_mean_x, e.q_cam_from_gcrf_mean_y, e.q_cam_from_gcrf_mean_z,"
    " e.q_cam_from_gcrf_mean_w, e.observer_gcrf_x_m, e.observer_gcrf_y_m, e.observer_gcrf_z_m,"
    " e.observer_gcrf_x_mps, e.observer_gcrf_y_mps, e.observer_gcrf_z_mps, e.velocity_bary_x_mps,"
    " e.velocity_bary_y_mps, e.velocity_bary_z_mps, e.sun_x_m, e.sun_y_m, e.sun_z_m"
    " FROM frames f JOIN exposures e USING (sensor, exposure_id)"
    " WHERE f.sensor = ?1 AND f.fits_index IS NOT NULL ORDER BY f.exposure_id";

static bst_vec3 vector(const bst_io_rows *rows, int column) {
    return (bst_vec3){bst_io_rows_real(rows, column), bst_io_rows_real(rows, column + 1),
                      bst_io_rows_real(rows, column + 2)};
}

static bst_status read_frame_row(bst_ctx *ctx, const job *j, const bst_io_rows *rows,
                                 frame_row *r) {
    *r = (frame_row){.id = bst_io_rows_int(rows, 0), .fits_index = bst_io_rows_int(rows, 1)};
    snprintf(r->start_utc, sizeof r->start_utc, "%s", bst_io_rows_text(rows, 10));
    bst_fits_frame *f = &r->frame;
    f->id = r->id;
    f->start =
        bst_time_at_tick(j->scenario->epoch, bst_io_rows_int(rows, 2), j->scenario->tick_rate_hz);
    f->exposure_s = bst_io_rows_real(rows, 3);
    f->window = (bst_window){(int)bst_io_rows_int(rows, 4), (int)bst_io_rows_int(rows, 5),
                             (int)bst_io_rows_int(rows, 6), (int)bst_io_rows_int(rows, 7)};
    f->binning = (int)bst_io_rows_int(rows, 8);
    f->bits = (int)bst_io_rows_int(rows, 9);
    f->pixel_scale_arcsec = bst_io_rows_real(rows, 11);
    bst_quat q = {bst_io_rows_real(rows, 12), bst_io_rows_real(rows, 13),
                  bst_io_rows_real(rows, 14), bst_io_rows_real(rows, 15)};
    f->has_observer = true;
    f->observer_gcrf_m = vector(rows, 16);
    f->observer_gcrf_mps = vector(rows, 19);
    bst_light light = {.velocity_mps = vector(rows, 22), .sun_m = vector(rows, 25)};
    bst_camera camera;
    BST_TRY(bst_world_camera_at_scale(ctx, j->camera, f->pixel_scale_arcsec, &camera));
    f->has_wcs = bst_wcs_fit(ctx, &camera, q, &light, &f->wcs) == BST_OK;
    return BST_OK;
}

/* Adds start, middle and end along one axis, as fractions of the image. */
static void put_axis(cJSON *node, char axis, const double v[3], double box) {
    const char *const names[] = {"min", "max", "center", "start", "mid", "end"};
    const double values[] = {bst_least_of_3(v),
                             bst_greatest_of_3(v),
                             0.5 * (bst_least_of_3(v) + bst_greatest_of_3(v)),
                             v[0],
                             v[1],
                             v[2]};
    char key[16];
    for (int k = 0; k < 6; k++) {
        snprintf(key, sizeof key, "%c_%s", axis, names[k]);
        bst_json_add_number(node, key, values[k]);
    }
    bst_json_add_number(node, axis == 'y' ? "bbox_height" : "bbox_width",
                        box > 0.0 ? box : bst_greatest_of_3(v) - bst_least_of_3(v));
}

static const char truth_sql[] =
    "SELECT t.exposure_id, t.kind, t.id, t.norad, t.x_start_px, t.x_mid_px, t.x_end_px,"
    " t.y_start_px, t.y_mid_px, t.y_end_px, t.v_mag, t.electrons, t.snr, t.ra_deg, t.dec_deg,"
    " t.item, o.name, t.x_chief_px, t.y_chief_px, t.x_centroid_px, t.y_centroid_px FROM truth t "
    "LEFT JOIN objects o ON t.kind = 'object' AND o.id = t.id"
    " WHERE t.sensor = ?1 ORDER BY t.rowid";

/* Label of the current truth row; NULL: not in the frame. */
static cJSON *label(const job *j, const bst_fits_frame *f, int width, int height) {
    const bst_io_rows *r = j->truth;
    const char *kind = bst_io_rows_text(r, 1);
    bool ghost = strstr(kind, "ghost") != NULL, star = strncmp(kind, "star", 4) == 0;
    double x[3], y[3], v_mag = bst_io_rows_real(r, 10), electrons = bst_io_rows_real(r, 11);
    double binning = f->binning > 1 ? f->binning : 1;
    double chief_x = bst_io_rows_real(r, 17), chief_y = bst_io_rows_real(r, 18);
    /* boxes enclose the light, which the optics shift from the chief ray */
    double beside_x = bst_io_rows_real(r, 19) - chief_x,
           beside_y = bst_io_rows_real(r, 20) - chief_y;
    for (int k = 0; k < 3; k++) {
        x[k] = (bst_io_rows_real(r, 4 + k) + beside_x - f->window.x0 + 0.5) / binning / width;
        y[k] = (bst_io_rows_real(r, 7 + k) + beside_y - f->window.y0 + 0.5) / binning / height;
        if (!isfinite(x[k]) || !isfinite(y[k])) {
            return NULL;
        }
    }
    if (!(electrons > 0.0) || (star && !(v_mag <= j->e->star_limit)) ||
        bst_greatest_of_3(x) < 0.0 || bst_least_of_3(x) > 1.0 || bst_greatest_of_3(y) < 0.0 ||
        bst_least_of_3(y) > 1.0) {
        return NULL;
    }
    char id[32];
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "class_name", ghost ? "Ghost" : star ? "Star" : "Satellite");
    cJSON_AddNumberToObject(node, "class_id", ghost ? 3 : star ? 2 : 1);
    put_axis(node, 'y', y, j->e->box_px / height);
    put_axis(node, 'x', x, j->e->box_px / width);
    bst_json_add_number(node, "x_centroid",
                        (chief_x + beside_x - f->window.x0 + 0.5) / binning / width);
    bst_json_add_number(node, "y_centroid",
                        (chief_y + beside_y - f->window.y0 + 0.5) / binning / height);
    bst_json_add_number(node, "x_chief", (chief_x - f->window.x0 + 0.5) / binning / width);
    bst_json_add_number(node, "y_chief", (chief_y - f->window.y0 + 0.5) / binning / height);
    cJSON_AddStringToObject(node, "source", "boresight");
    bst_json_add_number(node, "magnitude", v_mag);
    bst_json_add_number(node, "pe_per_sec", f->exposure_s > 0.0 ? electrons / f->exposure_s : NAN);
    cJSON_AddNumberToObject(node, "seg_id", j->mask ? (double)bst_io_rows_int(r, 15) : -1.0);
    cJSON_AddStringToObject(node, "object_name", bst_io_rows_text(r, 16));
    int64_t norad = bst_io_rows_int(r, 3);
    snprintf(id, sizeof id, "%" PRId64, star || norad == 0 ? bst_io_rows_int(r, 2) : norad);
    cJSON_AddStringToObject(node, "object_id", id);
    cJSON_AddItemToObject(node, "pixels", cJSON_CreateArray());
    cJSON_AddItemToObject(node, "snr", cJSON_CreateArray());
    bst_json_add_number(node, "snr_aperture", bst_io_rows_real(r, 12));
    bst_json_add_number(node, "ra", bst_io_rows_real(r, 13));
    bst_json_add_number(node, "dec", bst_io_rows_real(r, 14));
    return node;
}

/* Adds the shape of the current truth row, if it has one; coordinates are fractions of the image.
 */
static bst_status add_shape(bst_ctx *ctx, job *j, const frame_row *row, int width, int height,
                            cJSON *node) {
    bst_shape_label shape;
    bool found;
    BST_TRY(bst_shape_labels_find(ctx, &j->shapes, row->id, bst_io_rows_int(j->truth, 15), &shape,
                                  &found));
    if (found) {
        double binning = row->frame.binning > 1 ? row->frame.binning : 1;
        const bst_shape_label_view view = {row->frame.window.x0, row->frame.window.y0,
                                           binning * width, binning * height};
        bst_shape_label_add(&shape, &view, node);
        return bst_mask_labels_add_parts(ctx, &j->masks, bst_io_rows_int(j->truth, 2), true,
                                         cJSON_GetObjectItem(node, "shape"));
    }
    return BST_OK;
}

/* Adds the labels of a frame from the truth rows of its exposure; skips earlier rows. */
static bst_status add_labels(bst_ctx *ctx, job *j, const frame_row *row, int width, int height,
                             cJSON *list, int *satellites) {
    *satellites = 0;
    while (j->truth_more && bst_io_rows_int(j->truth, 0) <= row->id) {
        if (bst_io_rows_int(j->truth, 0) == row->id) {
            cJSON *node = label(j, &row->frame, width, height);
            if (node) {
                BST_TRY(add_shape(ctx, j, row, width, height, node));
                *satellites += strcmp(bst_io_rows_text(j->truth, 1), "object") == 0;
                cJSON_AddItemToArray(list, node);
            }
        }
        BST_TRY(bst_io_rows_next(ctx, j->truth, &j->truth_more));
    }
    return BST_OK;
}

static cJSON *file_node(const job *j, const frame_row *row, const char *name) {
    cJSON *node = cJSON_CreateObject();
    const char *slash = strrchr(j->e->satnet, '/');
    cJSON_AddStringToObject(node, "dirname", slash && slash[1] ? slash + 1 : j->e->satnet);
    cJSON_AddNumberToObject(node, "sequence", (double)j->sensor->index);
    char text[320];
    snprintf(text, sizeof text, "%s.fits", name);
    cJSON_AddStringToObject(node, "filename", text);
    cJSON_AddNumberToObject(node, "sequence_id", (double)row->id);
    return node;
}

static bst_status write_annotation(bst_ctx *ctx, job *j, const frame_row *row, const char *name,
                                   int width, int height) {
    const bst_fits_frame *f = &row->frame;
    cJSON *root = cJSON_CreateObject(), *data = cJSON_AddObjectToObject(root, "data");
    cJSON_AddItemToObject(data, "file", file_node(j, row, name));
    cJSON *sensor = cJSON_AddObjectToObject(data, "sensor");
    double ifov_deg = f->pixel_scale_arcsec / 3600.0 * (f->binning > 1 ? f->binning : 1);
    cJSON_AddNumberToObject(sensor, "height", height);
    cJSON_AddNumberToObject(sensor, "width", width);
    bst_json_add_number(sensor, "iFOVy", ifov_deg);
    bst_json_add_number(sensor, "iFOVx", ifov_deg);
    cJSON *objects = cJSON_CreateArray();
    int satellites;
    bst_status status = add_labels(ctx, j, row, width, height, objects, &satellites);
    cJSON_AddItemToObject(data, "objects", objects);
    cJSON *stats = cJSON_AddObjectToObject(data, "stats");
    cJSON_AddNumberToObject(stats, "num_obs_initial", satellites);
    cJSON_AddNumberToObject(stats, "num_obs", satellites);
    cJSON *more = cJSON_AddObjectToObject(data, "metadata");
    cJSON_AddStringToObject(more, "program", "boresight");
    cJSON_AddStringToObject(more, "version", bst_version());
    cJSON_AddStringToObject(more, "scenario", j->scenario->name);
    cJSON_AddStringToObject(more, "observer", j->sensor->observer);
    cJSON_AddStringToObject(more, "sensor", j->sensor->name);
    cJSON_AddStringToObject(more, "start_utc", row->start_utc);
    bst_json_add_number(more, "exposure_s", f->exposure_s);
    if (status == BST_OK) {
        char path[4400];
        bst_draft draft;
        snprintf(path, sizeof path, "%.4000s/Annotations/%s.json", j->e->satnet, name);
        char *text = cJSON_PrintUnformatted(root);
        status = text ? bst_draft_open(ctx, path, &draft)
                      : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for annotations");
        if (status == BST_OK) {
            fputs(text, draft.stream);
            status = bst_draft_close(ctx, &draft, BST_OK);
        }
        cJSON_free(text);
    }
    cJSON_Delete(root);
    return status;
}

/* Selects training, validation or test from the frame's name only (FNV-1a, mixed as in
 * SplitMix64). */
static int part_of(const job *j, const char *name) {
    uint64_t h = bst_fnv(BST_FNV_START, name, strlen(name));
    h = (h ^ (h >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    h = (h ^ (h >> 27)) * UINT64_C(0x94d049bb133111eb);
    double u = (double)((h ^ (h >> 31)) >> 11) * 0x1p-53;
    return u < j->shares[0] ? 0 : u < j->shares[0] + j->shares[1] ? 1 : 2;
}

static bst_status write_frame(bst_ctx *ctx, job *j, const frame_row *row) {
    char name[300], path[4400];
    bst_fits_read_frame image;
    int64_t index = bst_fits_reader_info(j->fits)->cube ? row->fits_index : row->fits_index - 1;
    BST_TRY(bst_fits_reader_frame(ctx, j->fits, index, &image));
    const bst_mask_frame parts = {index, row->id, image.width, image.height};
    bst_status read = bst_mask_labels_read(ctx, &j->masks, &parts);
    if (read != BST_OK) {
        return bst_fail_prefix(ctx, read, "%s", bst_run_reader_folder(j->e->run));
    }
    snprintf(name, sizeof name, "%s.%04" PRId64, j->set, row->id);
    snprintf(path, sizeof path, "%.4000s/ImageFiles/%s.fits", j->e->satnet, name);
    char program[64];
    snprintf(program, sizeof program, "boresight %s", bst_version());
    bst_fits_info info = {.observer = j->sensor->observer,
                          .instrument = j->sensor->name,
                          .object = j->sensor->target,
                          .program = program,
                          .camera = j->camera};
    BST_TRY(bst_fits_write_single(ctx, path, &info, &row->frame, image.pixels, image.width,
                                  image.height));
    BST_TRY(write_annotation(ctx, j, row, name, image.width, image.height));
    if (j->parts) {
        fprintf(j->parts[part_of(j, name)].stream, "ImageFiles/%s.fits Annotations/%s.json\n", name,
                name);
    }
    j->written++;
    return BST_OK;
}

/* ------------------------------------------------------------------ a sensor, a run */

static bst_status write_frames(bst_ctx *ctx, job *j) {
    bst_io_rows *rows;
    bool more;
    bst_progress progress;
    BST_TRY(bst_io_rows_open(ctx, j->e->run, truth_sql, j->sensor->index, 0, &j->truth));
    bst_status status = bst_io_rows_next(ctx, j->truth, &j->truth_more);
    if (status == BST_OK) {
        status = bst_io_rows_open(ctx, j->e->run, frames_sql, j->sensor->index, 0, &rows);
    }
    if (status != BST_OK) {
        bst_io_rows_close(j->truth);
        return status;
    }
    bst_progress_start(
        &progress, j->set, "frames",
        bst_run_reader_int(j->e->run, "SELECT count(*) FROM frames WHERE sensor = ?1",
                           j->sensor->index, 0));
    for (int64_t n = 0; (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more; n++) {
        int64_t id = bst_io_rows_int(rows, 0);
        frame_row row;
        if (id < j->e->first || id > j->e->last || (id - j->e->first) % j->e->every != 0) {
            continue;
        }
        status = bst_export_check(ctx);
        status = status == BST_OK ? read_frame_row(ctx, j, rows, &row) : status;
        status = status == BST_OK ? write_frame(ctx, j, &row) : status;
        if (status != BST_OK) {
            break;
        }
        bst_progress_update(&progress, n + 1);
    }
    bst_progress_end(&progress);
    bst_io_rows_close(rows);
    bst_io_rows_close(j->truth);
    return status;
}

void bst_export_set_name(const bst_run_reader *run, const bst_run_sensor *sensor, char out[256]) {
    const char *folder = bst_run_reader_folder(run);
    size_t length = strlen(folder);
    while (length > 1 && folder[length - 1] == '/') {
        length--;
    }
    size_t start = length;
    while (start > 0 && folder[start - 1] != '/') {
        start--;
    }
    snprintf(out, 256, "%.*s%s%s%s%s", (int)(length - start < 100 ? length - start : 100),
             folder + start, sensor ? "_" : "", sensor ? sensor->observer : "", sensor ? "_" : "",
             sensor ? sensor->name : "");
}

bst_status bst_export_need_truth(bst_ctx *ctx, const bst_run_reader *run) {
    if (bst_run_reader_has_tables(run) &&
        bst_run_reader_int(run, "SELECT count(*) FROM exposures", 0, -1) >= 0) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "%s: holds no truth to label frames by; run it with /record/truth=true",
                    bst_run_reader_folder(run));
}

static bst_status export_sensor(bst_ctx *ctx, job *j, int sensors) {
    char path[4096];
    int observer = 0, sensor = (int)j->sensor->index;
    const bst_observer_config *observers = j->scenario->observers.items;
    while (observer < j->scenario->observers.count && sensor >= observers[observer].sensors.count) {
        sensor -= observers[observer++].sensors.count;
    }
    if (observer == j->scenario->observers.count) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: scenario.json has no sensor %s/%s",
                        bst_run_reader_folder(j->e->run), j->sensor->observer, j->sensor->name);
    }
    j->camera = &((const bst_sensor_config *)observers[observer].sensors.items)[sensor].camera;
    bst_export_set_name(j->e->run, sensors > 1 ? j->sensor : NULL, j->set);
    BST_TRY(bst_run_reader_file(ctx, j->e->run, j->sensor->file, path, sizeof path));
    BST_TRY(bst_fits_reader_open(ctx, path, &j->fits));
    bst_status status = bst_shape_labels_open(ctx, j->e, (int)j->sensor->index, &j->shapes);
    status = status == BST_OK
                 ? bst_mask_labels_open(ctx, j->e->run, j->sensor->file, "parts", &j->masks)
                 : status;
    status = status == BST_OK ? write_frames(ctx, j) : status;
    bst_shape_labels_close(&j->shapes);
    bst_mask_labels_close(&j->masks);
    bst_fits_reader_close(j->fits);
    j->fits = NULL;
    return status;
}

static bst_status make_folders(bst_ctx *ctx, const char *folder) {
    static const char *const names[] = {"ImageFiles", "Annotations"};
    for (int k = 0; k < 2; k++) {
        char path[4200];
        snprintf(path, sizeof path, "%.4000s/%s", folder, names[k]);
        BST_TRY(bst_folder_make(ctx, path));
    }
    return BST_OK;
}

static bst_status export_all(bst_ctx *ctx, job *j) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count, kept = 0;
    int64_t several = bst_run_reader_int(j->e->run, "SELECT count(*) FROM sensors", 0, 1);
    BST_TRY(bst_run_sensors(ctx, j->e->run, j->e->sensor, sensors, &count));
    BST_TRY(bst_export_need_truth(ctx, j->e->run));
    for (int i = 0; i < count; i++) {
        if (sensors[i].file[0]) {
            kept++;
            j->sensor = &sensors[i];
            BST_TRY(export_sensor(ctx, j, (int)several));
        }
    }
    return kept > 0 ? BST_OK
                    : bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: its frames were not kept",
                               bst_run_reader_folder(j->e->run));
}

static bst_status export_with_parts(bst_ctx *ctx, job *j) {
    bst_draft parts[PARTS];
    int opened = 0;
    bst_status status = bst_export_split(ctx, j->e->split, j->shares);
    for (; status == BST_OK && opened < PARTS; opened++) {
        char path[4200];
        snprintf(path, sizeof path, "%.4000s/%s", j->e->satnet, part_names[opened]);
        status = bst_draft_open(ctx, path, &parts[opened]);
        if (status != BST_OK) {
            break;
        }
    }
    j->parts = parts;
    status = status == BST_OK ? export_all(ctx, j) : status;
    for (int k = 0; k < opened; k++) {
        bst_status closed = bst_draft_close(status == BST_OK ? ctx : NULL, &parts[k], status);
        status = status == BST_OK ? closed : status;
    }
    j->parts = NULL;
    return status;
}

bst_status bst_export_satnet(bst_ctx *ctx, const bst_export *e) {
    bst_json *json;
    bst_scenario scenario;
    job j = {.e = e, .scenario = &scenario};
    BST_TRY(make_folders(ctx, e->satnet));
    bst_status status = bst_run_recorded_scenario(ctx, e->run, &json, &scenario);
    if (status == BST_OK) {
        j.mask = scenario.record.planes & UINT32_C(1) << BST_PLANE_SEGMENTATION;
        status = e->split ? export_with_parts(ctx, &j) : export_all(ctx, &j);
    }
    if (status == BST_OK) {
        printf("%s: %s with annotations\n", e->satnet,
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, j.written, "frame", "frames"));
    }
    bst_scenario_free(&scenario);
    bst_json_free(json);
    return status;
}
