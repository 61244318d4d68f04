#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/astro/bodies.h"
#include "sim/astro/geodesy.h"
#include "sim/report/report.h"
#include "sim/report/report_track.h"
#include "sim/world/frame_updates.h"
#include "sim/world/world.h"

/* maximum number of frames in memory; longer runs are subsampled */
#define MOST_FRAMES 1000000

typedef struct task {
    double from_s;
    int64_t object; /* index of the object; -1: the sensor's own target */
} task;

typedef struct reading {
    const bst_run_reader *run;
    bst_run_scene *scene; /* NULL: none */
    int observer, camera_index;
    int64_t object; /* the sensor's own target: its index in scenario and truth; -1: none */
    task *tasks;    /* successive targets, by time */
    size_t task_count;
    bst_report_sensor *out;
} reading;

static const bst_report_frame unknown = {.tracked_s = NAN,
                                         .boresight_x_px = NAN,
                                         .boresight_y_px = NAN,
                                         .error_px = NAN,
                                         .error_x_px = NAN,
                                         .error_y_px = NAN,
                                         .snr = NAN,
                                         .track_snr = NAN,
                                         .detections = NAN,
                                         .stars = NAN,
                                         .track_east_arcsec = NAN,
                                         .track_north_arcsec = NAN,
                                         .track_sigma_arcsec = NAN,
                                         .nees = NAN,
                                         .v_mag = NAN,
                                         .range_m = NAN,
                                         .phase_rad = NAN,
                                         .ra_deg = NAN,
                                         .dec_deg = NAN,
                                         .target_ra_deg = NAN,
                                         .target_dec_deg = NAN,
                                         .apparent_ra_deg = NAN,
                                         .apparent_dec_deg = NAN,
                                         .sun_rad = NAN,
                                         .limb_rad = NAN,
                                         .latitude_rad = NAN,
                                         .longitude_rad = NAN,
                                         .mode = -1};

/* Calls `take` for each row of a query on one sensor. *missing: no such table, which is no
 * error. */
static bst_status each_row(bst_ctx *ctx, reading *r, const char *sql, int64_t parameter,
                           bst_status (*take)(bst_ctx *ctx, reading *r, const bst_io_rows *rows),
                           bool *missing) {
    bst_io_rows *rows;
    bst_ctx unheard = {0};
    bool more;
    *missing =
        bst_io_rows_open(&unheard, r->run, sql, r->out->sensor.index, parameter, &rows) != BST_OK;
    if (*missing) {
        return BST_OK;
    }
    bst_status status;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           (status = take(ctx, r, rows)) == BST_OK) {
    }
    bst_io_rows_close(rows);
    if (status == BST_ERR_FORMAT) { /* damaged database: rows read before the damage are valid */
        r->out->damaged = true;
        return BST_OK;
    }
    return status;
}

/* The report frame of an exposure; NULL: not kept. Frames are in ascending order. */
static bst_report_frame *find(const reading *r, int64_t exposure_id) {
    bst_report_frame *frames = r->out->frames;
    size_t low = 0, high = r->out->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (frames[middle].exposure_id < exposure_id) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < r->out->count && frames[low].exposure_id == exposure_id ? &frames[low] : NULL;
}

/* ------------------------------------------------------------------ frames */

static bst_vec3 vec3_of(const bst_io_rows *rows, int column) {
    return (bst_vec3){bst_io_rows_real(rows, column), bst_io_rows_real(rows, column + 1),
                      bst_io_rows_real(rows, column + 2)};
}

/* Adds a report frame; NULL: skipped by subsampling. */
static bst_report_frame *add_frame(reading *r, int64_t id, double mid_s) {
    bst_report_sensor *s = r->out;
    int64_t number = s->exposures++;
    bool ascends = s->count == 0 || s->frames[s->count - 1].exposure_id < id;
    if (number % s->every != 0 || s->count == MOST_FRAMES || !ascends) {
        return NULL;
    }
    bst_report_frame *f = &s->frames[s->count++];
    *f = unknown;
    f->exposure_id = id;
    f->mid_s = f->end_s = mid_s;
    return f;
}

/* Stores a row of the table tasks: start time and target of a surveillance task. */
static bst_status take_task(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    if ((r->task_count & (r->task_count - 1)) == 0) { /* doubles the capacity */
        task *more = realloc(r->tasks, (r->task_count ? 2 * r->task_count : 1) * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the tasks");
        }
        r->tasks = more;
    }
    r->tasks[r->task_count++] = (task){bst_io_rows_real(rows, 0), bst_io_rows_int(rows, 1)};
    return BST_OK;
}

/* Target of the sensor at a time; -1: none. */
static int64_t object_at(const reading *r, double seconds) {
    size_t low = 0, high = r->task_count;
    while (low < high) { /* finds the first task that begins later */
        size_t middle = low + (high - low) / 2;
        if (r->tasks[middle].from_s <= seconds) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low > 0 && r->tasks[low - 1].object >= 0 ? r->tasks[low - 1].object : r->object;
}

/* Computes the target's direction, brightness and visibility for a frame, from the world of the
 * run. */
static bst_status look(bst_ctx *ctx, reading *r, bst_report_frame *f, bst_quat q_cam_from_gcrf,
                       double pixel_scale_arcsec) {
    bst_world_sight sight;
    int64_t object = object_at(r, f->mid_s);
    if (object < 0 || object >= bst_world_object_count(r->scene->world)) {
        return BST_OK;
    }
    bst_status status =
        bst_world_view_sight(ctx, r->scene->view, r->observer, (int)object, f->mid_s, &sight);
    if (status == BST_ERR_NUMERIC) {
        return BST_OK; /* decayed */
    }
    BST_TRY(status);
    const bst_camera *camera = bst_world_camera(r->scene->world, r->observer, r->camera_index);
    f->known = true;
    f->occulted = sight.occulted;
    f->dark = sight.sunlit_fraction <= 0.0;
    f->visible = !sight.occulted && bst_scene_glow_electrons_per_s(camera, &sight.glow, NULL) > 0.0;
    f->v_mag = isfinite(sight.v_mag) ? sight.v_mag : NAN;
    f->range_m = sight.range_m;
    f->phase_rad = sight.phase_rad;
    double ra, dec;
    bst_vec3_to_radec(sight.geometric, &ra, &dec);
    f->target_ra_deg = ra / BST_DEG_RAD;
    f->target_dec_deg = dec / BST_DEG_RAD;
    bst_vec3_to_radec(sight.apparent, &ra, &dec);
    f->apparent_ra_deg = ra / BST_DEG_RAD;
    f->apparent_dec_deg = dec / BST_DEG_RAD;
    f->error_px = bst_eval_pointing_error_px(camera, pixel_scale_arcsec, q_cam_from_gcrf,
                                             sight.apparent, &f->error_x_px, &f->error_y_px);
    return BST_OK;
}

static const char exposures_sql[] =
    "SELECT exposure_id, mid_s, dropped, q_cam_from_gcrf_mid_x, q_cam_from_gcrf_mid_y,"
    " q_cam_from_gcrf_mid_z, q_cam_from_gcrf_mid_w, boresight_x_px, boresight_y_px,"
    " boresight_ra_deg, boresight_dec_deg, observer_gcrf_x_m, observer_gcrf_y_m,"
    " observer_gcrf_z_m, sun_x_m, sun_y_m, sun_z_m, pixel_scale_arcsec,"
    " CAST(end_tick AS REAL) / (SELECT tick_rate_hz FROM run)"
    " FROM exposures WHERE sensor = ?1";

/* Fills a report frame from a row of the table exposures, with geometry from the world. */
static bst_status take_exposure(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    bst_report_frame *f = add_frame(r, bst_io_rows_int(rows, 0), bst_io_rows_real(rows, 1));
    if (!f) {
        return BST_OK;
    }
    f->dropped = bst_io_rows_int(rows, 2) == 1;
    f->end_s = bst_io_rows_real(rows, 18);
    bst_quat q = {bst_io_rows_real(rows, 3), bst_io_rows_real(rows, 4), bst_io_rows_real(rows, 5),
                  bst_io_rows_real(rows, 6)};
    f->boresight_x_px = bst_io_rows_real(rows, 7);
    f->boresight_y_px = bst_io_rows_real(rows, 8);
    f->ra_deg = bst_io_rows_real(rows, 9);
    f->dec_deg = bst_io_rows_real(rows, 10);
    bst_vec3 here = vec3_of(rows, 11), sun = vec3_of(rows, 14);
    bst_vec3 look_to = bst_vec3_from_radec(f->ra_deg * BST_DEG_RAD, f->dec_deg * BST_DEG_RAD);
    double distance = bst_vec3_norm(here);
    if (bst_vec3_norm(sun) > 0.0) {
        f->sun_rad = bst_vec3_angle(look_to, sun);
    }
    if (distance > BST_EARTH_RADIUS_M) {
        f->limb_rad = bst_vec3_angle(look_to, bst_vec3_scale(here, -1.0)) -
                      asin(BST_EARTH_RADIUS_M / distance);
    }
    if (!r->scene) {
        return BST_OK;
    }
    bst_astro_earth_frames frames;
    BST_TRY(bst_world_view_earth_frames(ctx, r->scene->view, f->mid_s, &frames));
    bst_vec3 ground = bst_mat3_mul_vec(&frames.itrf_from_gcrf, here);
    double height, itrf[3] = {ground.x, ground.y, ground.z};
    if (isfinite(distance)) {
        BST_TRY(
            bst_astro_itrf_to_geodetic(ctx, itrf, &f->latitude_rad, &f->longitude_rad, &height));
    }
    return look(ctx, r, f, q, bst_io_rows_real(rows, 17));
}

/* Adds a report frame with exposure number and time only, for runs without exposures. */
static bst_status take_frame(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    (void)ctx;
    add_frame(r, bst_io_rows_int(rows, 0), bst_io_rows_real(rows, 1));
    return BST_OK;
}

/* Reads the exposures of a sensor from the first table that has them. */
static bst_status read_frames(bst_ctx *ctx, reading *r) {
    static const struct {
        const char *count, *rows;
        bst_status (*take)(bst_ctx *ctx, reading *r, const bst_io_rows *rows);
    } sources[] = {
        {"SELECT count(*) FROM exposures WHERE sensor = ?1", exposures_sql, take_exposure},
        {"SELECT count(*) FROM frames WHERE sensor = ?1",
         "SELECT exposure_id, start_s + exposure_s / 2 FROM frames WHERE sensor = ?1", take_frame},
        {"SELECT count(*) FROM detection_frames WHERE sensor = ?1",
         "SELECT exposure_id, mid_s FROM detection_frames WHERE sensor = ?1", take_frame},
    };
    bst_report_sensor *s = r->out;
    for (size_t k = 0; k < sizeof sources / sizeof *sources && s->count == 0; k++) {
        int64_t total = bst_run_reader_int(r->run, sources[k].count, s->sensor.index, 0);
        if (total <= 0) {
            continue;
        }
        s->exposures = 0;
        s->every = 1 + (total - 1) / MOST_FRAMES;
        free(s->frames);
        s->frames = malloc((size_t)(total / s->every + 1) * sizeof *s->frames);
        if (!s->frames) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %" PRId64 " frames", total);
        }
        bool missing;
        BST_TRY(each_row(ctx, r, sources[k].rows, 0, sources[k].take, &missing));
    }
    return BST_OK;
}

/* ------------------------------------------------------------------ truth */

/* Reads the target's position and SNR from the table truth, for frames with the target in the
 * field. */
static bst_status take_truth(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    (void)ctx;
    bst_report_frame *f = find(r, bst_io_rows_int(rows, 0));
    if (!f || bst_io_rows_int(rows, 12) != object_at(r, f->mid_s)) {
        return BST_OK;
    }
    f->in_field = bst_io_rows_int(rows, 3) == 1;
    double snr = bst_io_rows_real(rows, 4);
    f->snr = f->in_field && snr > 0.0 ? snr : NAN;
    if (f->known) {
        return BST_OK;
    }
    /* without world: recorded position relative to the boresight; in the field it differs from the
     * angle only by distortion */
    f->known = true;
    f->error_x_px = bst_io_rows_real(rows, 1) - f->boresight_x_px;
    f->error_y_px = bst_io_rows_real(rows, 2) - f->boresight_y_px;
    f->error_px = hypot(f->error_x_px, f->error_y_px);
    f->occulted = bst_io_rows_int(rows, 5) == 1;
    f->dark = bst_io_rows_real(rows, 6) <= 0.0;
    f->v_mag = bst_io_rows_real(rows, 7);
    f->visible = !f->occulted && isfinite(f->v_mag);
    f->range_m = bst_io_rows_real(rows, 8);
    f->phase_rad = bst_io_rows_real(rows, 9) * BST_DEG_RAD;
    f->target_ra_deg = bst_io_rows_real(rows, 10);
    f->target_dec_deg = bst_io_rows_real(rows, 11);
    f->apparent_ra_deg = f->target_ra_deg;
    f->apparent_dec_deg = f->target_dec_deg;
    return BST_OK;
}

/* Index of the target in the table truth. */
static int64_t find_object(const bst_run_reader *run, const char *name) {
    bst_ctx unheard = {0};
    bst_io_rows *rows;
    bool more;
    int64_t id = -1;
    if (bst_io_rows_open(&unheard, run, "SELECT id, name FROM objects", 0, 0, &rows) == BST_OK) {
        while (id < 0 && bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
            id = strcmp(bst_io_rows_text(rows, 1), name) == 0 ? bst_io_rows_int(rows, 0) : -1;
        }
        bst_io_rows_close(rows);
    }
    if (id >= 0) {
        return id;
    }
    const cJSON *world = cJSON_GetObjectItemCaseSensitive(bst_run_reader_scenario(run), "world");
    const cJSON *objects = cJSON_GetObjectItemCaseSensitive(world, "objects"), *object;
    int64_t i = 0;
    cJSON_ArrayForEach(object, objects) {
        const cJSON *text = cJSON_GetObjectItemCaseSensitive(object, "name");
        if (cJSON_IsString(text) && strcmp(text->valuestring, name) == 0) {
            return i;
        }
        i++;
    }
    return -1;
}

/* ------------------------------------------------------------------ image processing, modes */

/* Stores the number of detections and identified stars of a frame. */
static bst_status take_detections(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    (void)ctx;
    bst_report_frame *f = find(r, bst_io_rows_int(rows, 0));
    if (f) {
        f->detections = bst_io_rows_real(rows, 1);
        f->stars = bst_io_rows_real(rows, 2);
    }
    return BST_OK;
}

/* Appends a change of the controller's mode; rows of the same mode are skipped. */
static bst_status take_mode(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    bst_report_sensor *s = r->out;
    int mode = -1;
    for (int i = 0; i < BST_MODE_COUNT; i++) {
        mode = strcmp(bst_io_rows_text(rows, 1), bst_mode_name(i)) == 0 ? i : mode;
    }
    if (s->mode_count > 0 && s->modes[s->mode_count - 1].mode == mode) {
        return BST_OK;
    }
    if ((s->mode_count & (s->mode_count - 1)) == 0) { /* doubles the capacity */
        bst_report_mode *more =
            realloc(s->modes, (s->mode_count ? 2 * s->mode_count : 1) * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the modes");
        }
        s->modes = more;
    }
    s->modes[s->mode_count++] = (bst_report_mode){bst_io_rows_real(rows, 0), mode};
    return BST_OK;
}

/* Sets the controller's mode of each report frame. */
static void spread_modes(bst_report_sensor *s) {
    size_t k = 0;
    for (size_t i = 0; i < s->count && s->mode_count > 0; i++) {
        while (k + 1 < s->mode_count && s->modes[k + 1].from_s <= s->frames[i].end_s) {
            k++;
        }
        s->frames[i].mode = s->modes[k].from_s <= s->frames[i].end_s ? s->modes[k].mode : -1;
    }
}

/* Marks the first frame of each task. */
static void spread_tasks(const reading *r) {
    bst_report_sensor *s = r->out;
    size_t k = 0;
    for (size_t i = 0; i < s->count; i++) {
        for (; k < r->task_count && r->tasks[k].from_s <= s->frames[i].end_s; k++) {
            s->frames[i].task_begins = true;
        }
    }
}

/* ------------------------------------------------------------------ all of it */

/* Stores width, height and pixel scale of the sensor. */
static bst_status take_size(bst_ctx *ctx, reading *r, const bst_io_rows *rows) {
    (void)ctx;
    r->out->width_px = bst_io_rows_int(rows, 0);
    r->out->height_px = bst_io_rows_int(rows, 1);
    r->out->pixel_scale_arcsec = bst_io_rows_real(rows, 2);
    return BST_OK;
}

#define TRUTH_COLUMNS                                                                            \
    "exposure_id, x_mid_px, y_mid_px, in_field, snr, occulted, sunlit_fraction, v_mag, range_m," \
    " phase_deg, ra_deg, dec_deg, id FROM truth WHERE sensor = ?1 AND kind = 'object'"

/* Reads everything the report needs about a sensor: frames, truth, detections, modes, tracks. */
static bst_status read_all(bst_ctx *ctx, reading *r) {
    bst_report_sensor *s = r->out;
    bool missing;
    BST_TRY(each_row(
        ctx, r, "SELECT width_px, height_px, pixel_scale_arcsec FROM sensors WHERE sensor = ?1", 0,
        take_size, &missing));
    BST_TRY(each_row(ctx, r, "SELECT time_s, object FROM tasks WHERE sensor = ?1 ORDER BY rowid", 0,
                     take_task, &missing));
    BST_TRY(read_frames(ctx, r));
    /* with a single target only its own rows are queried */
    bool one = r->task_count == 0;
    if (r->object >= 0 || !one) {
        BST_TRY(each_row(ctx, r,
                         one ? "SELECT " TRUTH_COLUMNS " AND id = ?2" : "SELECT " TRUTH_COLUMNS,
                         r->object, take_truth, &missing));
    }
    BST_TRY(each_row(ctx, r,
                     "SELECT exposure_id, detections, stars_identified FROM detection_frames"
                     " WHERE sensor = ?1",
                     0, take_detections, &missing));
    BST_TRY(each_row(ctx, r, "SELECT time_s, mode FROM control WHERE sensor = ?1", 0, take_mode,
                     &missing));
    spread_modes(s);
    spread_tasks(r);
    for (size_t i = 0; i < s->count; i++) {
        s->has_truth = s->has_truth || s->frames[i].known;
    }
    return bst_report_read_tracks(ctx, r->run, s);
}

bst_status bst_report_read(bst_ctx *ctx, const bst_run_reader *run, bst_run_scene *scene,
                           const bst_run_sensor *sensor, const cJSON *summary,
                           bst_report_sensor *out) {
    *out = (bst_report_sensor){.sensor = *sensor, .every = 1, .pixel_scale_arcsec = NAN};
    snprintf(out->name, sizeof out->name, "%s/%s", sensor->observer, sensor->name);
    reading r = {.run = run, .scene = scene, .object = -1, .out = out};
    bst_ctx unheard = {0};
    if (!bst_run_reader_has_tables(run) || sensor->index < 0) {
        bst_report_judge(out, summary);
        return BST_OK;
    }
    if (scene &&
        bst_run_scene_find(&unheard, scene, sensor, &r.observer, &r.camera_index) != BST_OK) {
        r.scene = NULL;
    }
    if (sensor->target[0]) {
        r.object = r.scene ? bst_world_find_object(r.scene->world, sensor->target)
                           : find_object(run, sensor->target);
    }
    bst_status status = read_all(ctx, &r);
    out->task_count = r.task_count;
    free(r.tasks);
    bst_report_judge(out, summary);
    if (status != BST_OK) {
        bst_report_sensor_free(out);
    }
    return status;
}

void bst_report_sensor_free(bst_report_sensor *s) {
    free(s->frames);
    free(s->modes);
    s->frames = NULL;
    s->modes = NULL;
    s->count = s->mode_count = 0;
}
