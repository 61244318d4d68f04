#include "view/recorded_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"
#include "view/recorded_run_internal.h"
#include "view/thumbnail_store.h"

/* Longest list of exposures; a day of 100 frames a second has 8.6 million. */
static const size_t EXPOSURES_MOST = 10000000;

/* Work of all queries of a request, steps of SQLite: some 20 s. A panel of a day at 1 Hz needs 3e7.
 */
static const int64_t STEPS_MOST = INT64_C(2000000000);

/* Looks at a run that is about to end, after which it was killed. */
enum { ENDINGS_MOST = 5 };

/* Index of the sensor's target in the table objects; -1: none. */
static int64_t find_target(const bst_run_reader *reader, const char *name) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    int64_t id = -1;
    if (*name &&
        bst_io_rows_open(&ignored, reader, "SELECT id, name FROM objects", 0, 0, &rows) == BST_OK) {
        while (id < 0 && bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
            id = strcmp(bst_io_rows_text(rows, 1), name) == 0 ? bst_io_rows_int(rows, 0) : -1;
        }
        bst_io_rows_close(rows);
    }
    return id;
}

static void read_size(const bst_run_reader *reader, bst_view_sensor *s) {
    bst_ctx ignored = {0};
    bst_io_rows *rows;
    bool more;
    s->pixel_scale_arcsec = NAN;
    if (bst_io_rows_open(
            &ignored, reader,
            "SELECT width_px, height_px, pixel_scale_arcsec FROM sensors WHERE sensor = ?1",
            s->sensor.index, 0, &rows) != BST_OK) {
        return;
    }
    if (bst_io_rows_next(&ignored, rows, &more) == BST_OK && more) {
        s->width_px = bst_io_rows_int(rows, 0);
        s->height_px = bst_io_rows_int(rows, 1);
        s->pixel_scale_arcsec = bst_io_rows_real(rows, 2);
    }
    bst_io_rows_close(rows);
}

/* Takes the name that a folder gets when its run is complete. False: `path` is no unfinished one.
 */
static bool use_final_name(char *path) {
    static const char end[] = ".partial";
    size_t bytes = strlen(path);
    while (bytes > 1 && path[bytes - 1] == '/') {
        bytes--;
    }
    if (bytes < sizeof end || strncmp(path + bytes - (sizeof end - 1), end, sizeof end - 1) != 0) {
        return false;
    }
    path[bytes - (sizeof end - 1)] = '\0';
    return true;
}

/* Opens the folder, under its final name if the run ended meanwhile. */
static bst_status open_reader(bst_ctx *ctx, bst_view_run *run) {
    bst_status status = bst_run_reader_open(ctx, run->path, &run->reader);
    if (status == BST_ERR_NOT_FOUND && run->running && use_final_name(run->path)) {
        status = bst_run_reader_open(ctx, run->path, &run->reader);
    }
    return status;
}

/* Forgets what was read about the sensors. */
static void forget_sensors(bst_view_run *run) {
    for (int i = 0; i < run->sensors; i++) {
        bst_view_sensor *s = &run->sensor[i];
        bst_fits_reader_close(s->pixels);
        bst_fits_source_close(s->header);
        for (int k = 0; k < BST_VIEW_LINES; k++) {
            free(s->lines[k].samples);
        }
        free(s->exposures);
    }
    bst_view_thumbnails_free(run->thumbnails); /* a branch may have other frames */
    run->thumbnails = NULL;
    run->sensors = 0;
    run->samples = 0;
}

static void close_scene(bst_view_run *run) {
    if (run->scene) {
        bst_run_scene_close(run->scene);
        free(run->scene);
        run->scene = NULL;
    }
}

/* True while a process writes the run. A run that is about to end has a complete manifest but not
 * yet its final name; it looks as if it was killed. */
static bool is_in_progress(bst_view_run *run) {
    bst_run_state state = bst_run_reader_state(run->reader);
    const cJSON *complete =
        cJSON_GetObjectItemCaseSensitive(bst_run_reader_manifest(run->reader), "complete");
    bool ending = run->running && state == BST_RUN_KILLED && cJSON_IsTrue(complete);
    run->endings = ending ? run->endings + 1 : 0;
    return run->written || state == BST_RUN_RUNNING || (ending && run->endings <= ENDINGS_MOST);
}

/* Reads which sensors the run has, and whether it is in progress. */
static bst_status read_sensors(bst_ctx *ctx, bst_view_run *run) {
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count = 0;
    run->running = is_in_progress(run);
    BST_TRY(bst_run_sensors(ctx, run->reader, NULL, sensors, &count));
    for (int i = 0; i < count; i++) {
        run->sensor[i] = (bst_view_sensor){.sensor = sensors[i]};
        run->sensor[i].target = find_target(run->reader, sensors[i].target);
        read_size(run->reader, &run->sensor[i]);
    }
    run->sensors = count;
    return BST_OK;
}

bst_status bst_view_lock(bst_ctx *ctx, bst_view_run *run) {
    pthread_mutex_lock(&run->lock);
    bst_status status = run->reader ? BST_OK : open_reader(ctx, run);
    if (status == BST_OK) {
        bst_run_reader_allow(run->reader, STEPS_MOST);
    }
    if (status == BST_OK && run->suspended) {
        status = read_sensors(ctx, run);
        run->suspended = status != BST_OK;
    }
    return status;
}

void bst_view_unlock(bst_view_run *run) {
    if (run->running) {
        bst_run_reader_close(run->reader);
        run->reader = NULL;
    }
    pthread_mutex_unlock(&run->lock);
}

bst_status bst_view_run_open(bst_ctx *ctx, const char *path, bst_view_run **out) {
    bst_view_run *run = calloc(1, sizeof *run);
    *out = NULL;
    if (!run || pthread_mutex_init(&run->lock, NULL) != 0 ||
        pthread_mutex_init(&run->ahead_lock, NULL) != 0 ||
        pthread_cond_init(&run->ahead_changed, NULL) != 0) {
        free(run);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the run");
    }
    int n = snprintf(run->path, sizeof run->path, "%s", path);
    bst_status status = n >= 0 && (size_t)n < sizeof run->path
                            ? BST_OK
                            : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    if (status == BST_OK) {
        status = bst_view_lock(ctx, run);
        status = status == BST_OK ? read_sensors(ctx, run) : status;
        bst_view_unlock(run);
    }
    if (status != BST_OK) {
        bst_view_run_close(run);
        return status;
    }
    *out = run;
    return BST_OK;
}

void bst_view_run_set_written(bst_view_run *run, bool written) {
    pthread_mutex_lock(&run->lock);
    run->written = written;
    if (written) { /* its tables stay closed from now on */
        run->running = true;
        bst_run_reader_close(run->reader);
        run->reader = NULL;
    }
    pthread_mutex_unlock(&run->lock);
}

bst_status bst_view_run_refresh(bst_ctx *ctx, bst_view_run *run) {
    bst_status status = bst_view_lock(ctx, run);
    if (status == BST_OK && run->running) {
        forget_sensors(run);
        status = read_sensors(ctx, run);
    }
    bst_view_unlock(run);
    return status;
}

bool bst_view_run_suspend(bst_view_run *run) {
    if (pthread_mutex_trylock(&run->lock) != 0) {
        return false;
    }
    const bool can_suspend = !run->written;
    if (can_suspend) {
        forget_sensors(run);
        bst_run_reader_close(run->reader);
        run->reader = NULL;
        close_scene(run);
        run->suspended = true;
    }
    pthread_mutex_unlock(&run->lock);
    return can_suspend;
}

void bst_view_run_close(bst_view_run *run) {
    if (run) {
        forget_sensors(run);
        bst_run_reader_close(run->reader);
        close_scene(run);
        pthread_cond_destroy(&run->ahead_changed);
        pthread_mutex_destroy(&run->ahead_lock);
        pthread_mutex_destroy(&run->lock);
        free(run);
    }
}

/* ------------------------------------------------------------------ the list of exposures */

/* Adds an exposure. NULL: out of memory. */
static bst_view_exposure *add_exposure(bst_view_sensor *s, size_t *room) {
    void *memory = s->exposures;
    size_t needed = (s->count + 1) * sizeof *s->exposures;
    if (*room < needed &&
        bst_memory_grow(NULL, "out of memory", &memory, room, 2 * needed + 65536) != BST_OK) {
        return NULL;
    }
    s->exposures = memory;
    bst_view_exposure *e = &s->exposures[s->count++];
    *e = (bst_view_exposure){.fits_index = -1, .binning = 1.0, .exposure_s = NAN};
    return e;
}

/* Tables that list exposures, the most complete first. Rows are in the order of exposures. */
static const struct {
    const char *count, *rows;
} exposure_tables[] = {
    {"SELECT EXISTS(SELECT 1 FROM exposures WHERE sensor = ?1)",
     "SELECT exposure_id, mid_s, CAST(end_tick - start_tick AS REAL)"
     " / (SELECT tick_rate_hz FROM run), dropped FROM exposures WHERE sensor = ?1"},
    {"SELECT EXISTS(SELECT 1 FROM frames WHERE sensor = ?1)",
     "SELECT exposure_id, start_s + exposure_s / 2, exposure_s, 0 FROM frames WHERE sensor = ?1"},
    {"SELECT EXISTS(SELECT 1 FROM detection_frames WHERE sensor = ?1)",
     "SELECT exposure_id, mid_s, CAST(end_tick - start_tick AS REAL)"
     " / (SELECT tick_rate_hz FROM run), 0 FROM detection_frames WHERE sensor = ?1"}};

static bst_status read_exposures(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s,
                                 const char *sql) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    size_t room = 0;
    BST_TRY(bst_io_rows_open(ctx, run->reader, sql, s->sensor.index, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        if (s->count == EXPOSURES_MOST) {
            bst_run_reader_note_problem(run->reader, "only the first %zu exposures are listed",
                                        s->count);
            break;
        }
        bst_view_exposure *e = add_exposure(s, &room);
        if (!e) {
            status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu exposures", s->count);
            break;
        }
        e->id = bst_io_rows_int(rows, 0);
        e->mid_s = bst_io_rows_real(rows, 1);
        e->exposure_s = bst_io_rows_real(rows, 2);
        e->dropped = bst_io_rows_int(rows, 3) == 1;
    }
    bst_io_rows_close(rows);
    return status;
}

/* Adds windows and places in the FITS file to the exposures; both rise together. */
static bst_status read_windows(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    size_t k = 0;
    if (bst_io_rows_open(ctx, run->reader,
                         "SELECT exposure_id, fits_index, x0_px, y0_px, binning FROM frames"
                         " WHERE sensor = ?1",
                         s->sensor.index, 0, &rows) != BST_OK) {
        return BST_OK; /* not recorded */
    }
    bool cube = s->pixels && bst_fits_reader_info(s->pixels)->cube;
    int64_t kept = s->pixels ? bst_fits_reader_info(s->pixels)->frames : 0;
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        int64_t id = bst_io_rows_int(rows, 0);
        while (k < s->count && s->exposures[k].id < id) {
            k++;
        }
        if (k == s->count || s->exposures[k].id != id) {
            continue;
        }
        int64_t index = bst_io_rows_int(rows, 1), first = cube ? 0 : 1;
        bool is_kept = !bst_io_rows_is_null(rows, 1) && index >= first && index - first < kept;
        s->exposures[k].fits_index = is_kept ? index - first : -1;
        s->exposures[k].x0_px = bst_io_rows_real(rows, 2);
        s->exposures[k].y0_px = bst_io_rows_real(rows, 3);
        s->exposures[k].binning = fmax(1.0, bst_io_rows_real(rows, 4));
    }
    bst_io_rows_close(rows);
    return status;
}

/* Lists the frames of the file where tables are missing; their times are their numbers. */
static bst_status list_file(bst_ctx *ctx, bst_view_sensor *s) {
    int64_t frames = s->pixels ? bst_fits_reader_info(s->pixels)->frames : 0;
    size_t room = 0;
    for (int64_t i = 0; i < frames && s->count < EXPOSURES_MOST; i++) {
        bst_view_exposure *e = add_exposure(s, &room);
        if (!e) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu exposures", s->count);
        }
        e->id = e->fits_index = i;
        e->mid_s = (double)i;
    }
    return BST_OK;
}

static bst_status open_pixels(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s) {
    char path[4096];
    if (s->pixels) {
        return BST_OK;
    }
    if (!s->sensor.file[0]) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "frames are not kept");
    }
    BST_TRY(bst_run_reader_file(ctx, run->reader, s->sensor.file, path, sizeof path));
    return bst_fits_reader_open(ctx, path, &s->pixels);
}

static bst_status list_exposures(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s) {
    bst_ctx problem = {0};
    bst_status status = open_pixels(&problem, run, s);
    /* a run that is being written has no frames before its first exposure ends */
    if (status != BST_OK && s->sensor.file[0] && !run->running) {
        bst_run_reader_note_problem(run->reader, "%s", problem.message);
    }
    const int tables = sizeof exposure_tables / sizeof *exposure_tables;
    for (int k = 0; k < tables && s->count == 0; k++) {
        if (bst_run_reader_int(run->reader, exposure_tables[k].count, s->sensor.index, 0) == 1) {
            BST_TRY(read_exposures(ctx, run, s, exposure_tables[k].rows));
        }
    }
    return s->count > 0 ? read_windows(ctx, run, s) : list_file(ctx, s);
}

bst_status bst_view_find_sensor(bst_ctx *ctx, bst_view_run *run, int64_t number,
                                bst_view_sensor **out) {
    *out = NULL;
    if (number < 0 || number >= run->sensors) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no sensor %lld (allowed: 0 to %d)",
                        (long long)number, run->sensors - 1);
    }
    bst_view_sensor *s = &run->sensor[number];
    if (!s->listed) {
        bst_status status = list_exposures(ctx, run, s);
        if (status != BST_OK) {
            free(s->exposures);
            s->exposures = NULL;
            s->count = 0;
            return status;
        }
        s->listed = true;
    }
    *out = s;
    return BST_OK;
}

/* ------------------------------------------------------------------ what is sent */

static bst_status copy_list(bst_ctx *ctx, const bst_view_sensor *s, bst_view_bytes *out) {
    out->bytes = s->count * BST_VIEW_FRAME_NUMBERS * sizeof(double);
    out->data = malloc(out->bytes + 1);
    if (!out->data) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu exposures", s->count);
    }
    double *row = out->data;
    for (size_t i = 0; i < s->count; i++) {
        const bst_view_exposure *e = &s->exposures[i];
        *row++ = (double)e->id;
        *row++ = e->mid_s;
        *row++ = e->exposure_s;
        *row++ = (double)e->fits_index;
        *row++ = e->dropped;
    }
    return BST_OK;
}

bst_status bst_view_run_frames(bst_ctx *ctx, bst_view_run *run, int64_t sensor,
                               bst_view_bytes *out) {
    bst_view_sensor *s;
    *out = (bst_view_bytes){.data = NULL};
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? bst_view_find_sensor(ctx, run, sensor, &s) : status;
    status = status == BST_OK ? copy_list(ctx, s, out) : status;
    bst_view_unlock(run);
    return status;
}

bst_status bst_view_read_rows(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                              int first, int rows, bst_fits_read_frame *out) {
    if (frame < 0 || (uint64_t)frame >= s->count || s->exposures[frame].fits_index < 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "frame %lld is not kept", (long long)frame);
    }
    BST_TRY(open_pixels(ctx, run, s));
    return bst_fits_reader_rows(ctx, s->pixels, s->exposures[frame].fits_index, first, rows, out);
}
