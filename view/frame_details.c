/* What is known about a frame: keywords of its header, and truth, detections and tracks of its
 * exposure. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_number.h"
#include "view/json_list.h"
#include "view/recorded_run.h"
#include "view/recorded_run_internal.h"

/* Marks of one kind that are sent; the page says how many there are. */
enum { MARKS_MOST = 5000 };
/* Earlier exposures whose track positions are sent. */
enum { TRAIL_EXPOSURES = 40 };
/* Earlier exposures whose states of tracks are sent: from the newest of them the page predicts. */
enum { STATE_EXPOSURES = 6 };
/* Orders of a SIP polynomial that are read. */
enum { SIP_ORDER_MOST = 9 };

/* ------------------------------------------------------------------ header */

/* Numeric value of a keyword; NAN: missing. */
static double keyword(bst_fits_source *source, const char *name) {
    char text[BST_FITS_SOURCE_TEXT], *end;
    if (!bst_fits_source_text(source, name, text)) {
        return NAN;
    }
    double value = strtod(text, &end);
    return end == text ? NAN : value;
}

static void add_keyword(cJSON *node, const char *key, bst_fits_source *source, const char *name) {
    bst_json_add_number(node, key, keyword(source, name));
}

/* Adds the terms of a SIP polynomial as [p, q, coefficient]. Keywords are A_p_q; a cube has the
 * terms (0,0) (1,0) (0,1) (2,0) ... in a column A (Shupe et al. 2005). */
static void add_polynomial(cJSON *wcs, bst_fits_source *source, const char *name) {
    cJSON *terms = cJSON_AddArrayToObject(wcs, name);
    char word[32];
    snprintf(word, sizeof word, "%s_ORDER", name);
    double order = keyword(source, word);
    if (isnan(order)) {
        order = keyword(source, "A_ORDER"); /* a cube has one order for both */
    }
    int element = 0;
    for (int sum = 0; order >= 0.0 && sum <= fmin(order, SIP_ORDER_MOST); sum++) {
        for (int q = 0; q <= sum; q++) {
            element++;
            snprintf(word, sizeof word, "%s_%d_%d", name, sum - q, q);
            double value = keyword(source, word);
            if (isnan(value)) {
                snprintf(word, sizeof word, "%s[%d]", name, element);
                value = keyword(source, word);
            }
            if (isfinite(value) && value != 0.0) {
                const double term[3] = {sum - q, q, value};
                cJSON_AddItemToArray(terms, cJSON_CreateDoubleArray(term, 3));
            }
        }
    }
}

/* Adds a WCS of crpix, crval (deg) and cd (deg per pixel), eight numbers. NULL: one is missing. */
static cJSON *make_wcs(cJSON *node, const double value[8]) {
    for (int i = 0; i < 8; i++) {
        if (!isfinite(value[i])) {
            return NULL;
        }
    }
    cJSON *wcs = cJSON_AddObjectToObject(node, "wcs");
    cJSON_AddItemToObject(wcs, "crpix", cJSON_CreateDoubleArray(value, 2));
    cJSON_AddItemToObject(wcs, "crval_deg", cJSON_CreateDoubleArray(value + 2, 2));
    cJSON_AddItemToObject(wcs, "cd_deg", cJSON_CreateDoubleArray(value + 4, 4));
    return wcs;
}

static void add_wcs(cJSON *node, bst_fits_source *source) {
    static const char *const names[8] = {"CRPIX1", "CRPIX2", "CRVAL1", "CRVAL2",
                                         "CD1_1",  "CD1_2",  "CD2_1",  "CD2_2"};
    double value[8];
    for (int i = 0; i < 8; i++) {
        value[i] = keyword(source, names[i]);
    }
    cJSON *wcs = make_wcs(node, value);
    if (wcs) {
        add_polynomial(wcs, source, "A");
        add_polynomial(wcs, source, "B");
    }
}

/* Adds what the header of the frame says. A file that cannot be read adds nothing. */
static void add_header(bst_view_run *run, bst_view_sensor *s, int64_t fits_index, cJSON *node) {
    bst_ctx problem = {0};
    char path[4096];
    bst_fits_source_frame place;
    if (!s->header && !s->no_header) {
        bst_status status =
            bst_run_reader_file(&problem, run->reader, s->sensor.file, path, sizeof path);
        status = status == BST_OK ? bst_fits_source_open(&problem, path, &s->header) : status;
        s->no_header = status != BST_OK;
    }
    if (s->no_header || bst_fits_source_select(&problem, s->header, fits_index, &place) != BST_OK) {
        return;
    }
    add_wcs(node, s->header);
    add_keyword(node, "gain_e_per_dn", s->header, "GAIN");
    add_keyword(node, "offset_dn", s->header, "OFFSET");
    add_keyword(node, "saturation_dn", s->header, "SATURATE");
}

/* ------------------------------------------------------------------ rows of an exposure */

/* Rows of a sensor are in the order of exposures, so that bisection finds it: the tables have no
 * index, and a day has millions of rows. */
bst_status bst_view_open_from(bst_ctx *ctx, const bst_view_run *run, int64_t sensor,
                              const char *table, const char *columns, int64_t exposure,
                              bst_io_rows **out) {
    char probe[160], most[80], query[700];
    snprintf(most, sizeof most, "SELECT max(rowid) FROM %s", table);
    snprintf(probe, sizeof probe,
             "SELECT exposure_id FROM %s WHERE rowid >= ?1 AND sensor = ?2 ORDER BY rowid LIMIT 1",
             table);
    snprintf(query, sizeof query,
             "SELECT exposure_id, %s FROM %s WHERE rowid >= ?1 AND sensor = ?2 ORDER BY rowid",
             columns, table);
    int64_t low = 1, high = bst_run_reader_int(run->reader, most, 0, 0);
    high += high < INT64_MAX;
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        bst_io_rows *rows;
        bool more;
        BST_TRY(bst_io_rows_open(ctx, run->reader, probe, middle, sensor, &rows));
        bst_status status = bst_io_rows_next(ctx, rows, &more);
        bool before = status == BST_OK && more && bst_io_rows_int(rows, 0) < exposure;
        bst_io_rows_close(rows);
        BST_TRY(status);
        if (before) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return bst_io_rows_open(ctx, run->reader, query, low, sensor, out);
}

/* What adds a row to a list, in pixels of the frame. */
typedef void (*add_row)(cJSON *list, const bst_io_rows *rows, const bst_view_exposure *frame);

/* Exposures from `first` to `last`. */
typedef struct exposure_range {
    int64_t first, last;
} exposure_range;

/* Adds rows of exposures, until the list has MARKS_MOST. A table that was not recorded gives none.
 */
static bst_status add_rows(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                           const bst_view_exposure *frame, const char *const table[2],
                           exposure_range range, add_row add, cJSON *list) {
    bst_io_rows *rows;
    bst_ctx ignored = {0};
    bool more;
    bst_status status;
    int count = cJSON_GetArraySize(list);
    if (bst_view_open_from(&ignored, run, s->sensor.index, table[0], table[1], range.first,
                           &rows) != BST_OK) {
        return BST_OK;
    }
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           bst_io_rows_int(rows, 0) <= range.last && count < MARKS_MOST) {
        if (bst_io_rows_int(rows, 0) >= range.first) {
            add(list, rows, frame);
            count++;
        }
    }
    bst_io_rows_close(rows);
    return status;
}

/* Adds a position on the sensor as pixels of the frame: the first pixel's centre is 0. */
static void add_place(cJSON *node, const bst_io_rows *rows, int column,
                      const bst_view_exposure *f) {
    bst_json_add_number(node, "x",
                        (bst_io_rows_real(rows, column) - f->x0_px + 0.5) / f->binning - 0.5);
    bst_json_add_number(node, "y",
                        (bst_io_rows_real(rows, column + 1) - f->y0_px + 0.5) / f->binning - 0.5);
}

static const char *const truth[2] = {
    "truth", "kind, id, norad, in_field, x_centroid_px, y_centroid_px, v_mag, snr"};

static void add_truth(cJSON *list, const bst_io_rows *rows, const bst_view_exposure *f) {
    if (bst_io_rows_int(rows, 4) != 1) {
        return;
    }
    cJSON *node = bst_view_add_object(list);
    cJSON_AddStringToObject(node, "kind", bst_io_rows_text(rows, 1));
    cJSON_AddNumberToObject(node, "id", (double)bst_io_rows_int(rows, 2));
    cJSON_AddNumberToObject(node, "norad", (double)bst_io_rows_int(rows, 3));
    add_place(node, rows, 5, f);
    bst_json_add_number(node, "v_mag", bst_io_rows_real(rows, 7));
    bst_json_add_number(node, "snr", bst_io_rows_real(rows, 8));
}

static const char *const detections[2] = {
    "detections",
    "label, star_id, x_px, y_px, cov_xx_px2, cov_xy_px2, cov_yy_px2, flux_e, snr, length_px,"
    " angle_deg, v_mag"};

static void add_detection(cJSON *list, const bst_io_rows *rows, const bst_view_exposure *f) {
    cJSON *node = bst_view_add_object(list);
    const double per_area = 1.0 / (f->binning * f->binning);
    cJSON_AddStringToObject(node, "label", bst_io_rows_text(rows, 1));
    cJSON_AddNumberToObject(node, "star_id", (double)bst_io_rows_int(rows, 2));
    add_place(node, rows, 3, f);
    bst_json_add_number(node, "xx", bst_io_rows_real(rows, 5) * per_area);
    bst_json_add_number(node, "xy", bst_io_rows_real(rows, 6) * per_area);
    bst_json_add_number(node, "yy", bst_io_rows_real(rows, 7) * per_area);
    bst_json_add_number(node, "flux_e", bst_io_rows_real(rows, 8));
    bst_json_add_number(node, "snr", bst_io_rows_real(rows, 9));
    bst_json_add_number(node, "length", bst_io_rows_real(rows, 10) / f->binning);
    bst_json_add_number(node, "angle_deg", bst_io_rows_real(rows, 11));
    bst_json_add_number(node, "v_mag", bst_io_rows_real(rows, 12));
}

static const char *const tracks[2] = {
    "tracks",
    "track_id, status, target_of_interest, x_px, y_px, snr, ra_deg, dec_deg, misses_in_row,"
    " v_mag, time_s, rate_east_arcsec_per_s, rate_north_arcsec_per_s, cov_d1_d1_rad2,"
    " cov_d1_d2_rad2, cov_d2_d2_rad2, cov_d1_r1_rad2ps, cov_d1_r2_rad2ps, cov_d2_r1_rad2ps,"
    " cov_d2_r2_rad2ps, cov_r1_r1_rad2ps2, cov_r1_r2_rad2ps2, cov_r2_r2_rad2ps2"};
enum { STATE_COLUMN = 11, STATE_NUMBERS = 13 }; /* of time_s; with what follows */

static void add_track(cJSON *list, const bst_io_rows *rows, const bst_view_exposure *f) {
    cJSON *node = bst_view_add_object(list);
    cJSON_AddBoolToObject(node, "now", bst_io_rows_int(rows, 0) == f->id);
    cJSON_AddNumberToObject(node, "id", (double)bst_io_rows_int(rows, 1));
    cJSON_AddStringToObject(node, "status", bst_io_rows_text(rows, 2));
    cJSON_AddBoolToObject(node, "target", bst_io_rows_int(rows, 3) == 1);
    add_place(node, rows, 4, f);
    bst_json_add_number(node, "snr", bst_io_rows_real(rows, 6));
    bst_json_add_number(node, "ra_deg", bst_io_rows_real(rows, 7));
    bst_json_add_number(node, "dec_deg", bst_io_rows_real(rows, 8));
    cJSON_AddNumberToObject(node, "misses", (double)bst_io_rows_int(rows, 9));
    bst_json_add_number(node, "v_mag", bst_io_rows_real(rows, 10));
    if (bst_io_rows_int(rows, 0) < f->id - STATE_EXPOSURES) {
        return;
    }
    double state[STATE_NUMBERS];
    bool known = true;
    for (int i = 0; i < STATE_NUMBERS; i++) {
        state[i] = bst_io_rows_real(rows, STATE_COLUMN + i);
        known = known && isfinite(state[i]);
    }
    if (known) {
        cJSON_AddItemToObject(node, "state", cJSON_CreateDoubleArray(state, STATE_NUMBERS));
    }
}

static const char *const windows[2] = {
    "regions_of_interest", "window, x0_px, y0_px, width_px, height_px, reason, track_id, star_id"};

static void add_window(cJSON *list, const bst_io_rows *rows, const bst_view_exposure *f) {
    cJSON *node = bst_view_add_object(list);
    cJSON_AddNumberToObject(node, "window", (double)bst_io_rows_int(rows, 1));
    bst_json_add_number(node, "x0", (bst_io_rows_real(rows, 2) - f->x0_px) / f->binning);
    bst_json_add_number(node, "y0", (bst_io_rows_real(rows, 3) - f->y0_px) / f->binning);
    bst_json_add_number(node, "width", bst_io_rows_real(rows, 4) / f->binning);
    bst_json_add_number(node, "height", bst_io_rows_real(rows, 5) / f->binning);
    cJSON_AddStringToObject(node, "reason", bst_io_rows_text(rows, 6));
    cJSON_AddNumberToObject(node, "track_id", (double)bst_io_rows_int(rows, 7));
    cJSON_AddNumberToObject(node, "star_id", (double)bst_io_rows_int(rows, 8));
}

/* Adds the windows that image processing searched; nothing for a run without such a table. */
static bst_status add_windows(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                              const bst_view_exposure *frame, exposure_range now, cJSON *node) {
    if (bst_run_reader_int(run->reader, "SELECT EXISTS(SELECT 1 FROM regions_of_interest)", 0, -1) <
        0) {
        return BST_OK;
    }
    return add_rows(ctx, run, s, frame, windows, now, add_window,
                    cJSON_AddArrayToObject(node, "windows"));
}

/* Adds the WCS that the tables have, which lacks the distortion, where the header could not be
 * read: the file of a run in progress, or of one that was killed, may end within a frame. */
static bst_status add_recorded_wcs(bst_ctx *ctx, const bst_view_run *run, const bst_view_sensor *s,
                                   const bst_view_exposure *frame, cJSON *node) {
    bst_io_rows *rows;
    bst_ctx ignored = {0};
    bool more;
    double value[8];
    if (bst_view_open_from(
            &ignored, run, s->sensor.index, "frames",
            "crpix1, crpix2, crval1_deg, crval2_deg, cd1_1_deg, cd1_2_deg, cd2_1_deg,"
            " cd2_2_deg",
            frame->id, &rows) != BST_OK) {
        return BST_OK;
    }
    bst_status status = bst_io_rows_next(ctx, rows, &more);
    if (status == BST_OK && more && bst_io_rows_int(rows, 0) == frame->id) {
        for (int i = 0; i < 8; i++) {
            value[i] = bst_io_rows_real(rows, i + 1);
        }
        cJSON *wcs = make_wcs(node, value);
        if (wcs) {
            cJSON_AddArrayToObject(wcs, "A");
            cJSON_AddArrayToObject(wcs, "B");
            cJSON_AddTrueToObject(wcs, "without_distortion");
        }
    }
    bst_io_rows_close(rows);
    return status;
}

/* Adds the UTC of a time of the run. */
static void add_utc(const bst_view_run *run, double time_s, cJSON *node) {
    bst_time epoch;
    if (bst_run_reader_epoch(run->reader, &epoch) && isfinite(time_s)) {
        char text[48];
        bst_time_to_utc(bst_time_add(epoch, time_s), 3, text, sizeof text);
        cJSON_AddStringToObject(node, "utc", text);
    }
}

static bst_status describe_frame(bst_ctx *ctx, bst_view_run *run, bst_view_sensor *s, int64_t frame,
                                 cJSON *node) {
    if (frame < 0 || (uint64_t)frame >= s->count) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no frame %lld (allowed: 0 to %lld)",
                        (long long)frame, (long long)s->count - 1);
    }
    const bst_view_exposure *f = &s->exposures[frame];
    const int64_t oldest = frame > TRAIL_EXPOSURES ? frame - TRAIL_EXPOSURES : 0;
    cJSON_AddNumberToObject(node, "exposure_id", (double)f->id);
    cJSON_AddNumberToObject(node, "binning", f->binning);
    cJSON_AddNumberToObject(node, "target", (double)s->target);
    add_utc(run, f->mid_s, node);
    if (f->fits_index >= 0) {
        add_header(run, s, f->fits_index, node);
    }
    if (!cJSON_HasObjectItem(node, "wcs")) {
        BST_TRY(add_recorded_wcs(ctx, run, s, f, node));
    }
    const exposure_range now = {f->id, f->id};
    BST_TRY(add_rows(ctx, run, s, f, truth, now, add_truth, cJSON_AddArrayToObject(node, "truth")));
    BST_TRY(add_rows(ctx, run, s, f, detections, now, add_detection,
                     cJSON_AddArrayToObject(node, "detections")));
    BST_TRY(add_windows(ctx, run, s, f, now, node));
    cJSON *list = cJSON_AddArrayToObject(node, "tracks");
    BST_TRY(add_rows(ctx, run, s, f, tracks, now, add_track, list));
    if (oldest == frame) {
        return BST_OK;
    }
    /* the trail has what room the frame's own tracks leave */
    const exposure_range trail = {s->exposures[oldest].id, s->exposures[frame - 1].id};
    return add_rows(ctx, run, s, f, tracks, trail, add_track, list);
}

bst_status bst_view_run_frame(bst_ctx *ctx, bst_view_run *run, int64_t sensor, int64_t frame,
                              cJSON **out) {
    bst_view_sensor *s;
    *out = cJSON_CreateObject();
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? bst_view_find_sensor(ctx, run, sensor, &s) : status;
    status = status == BST_OK ? describe_frame(ctx, run, s, frame, *out) : status;
    bst_view_unlock(run);
    return bst_view_keep(status, out);
}
