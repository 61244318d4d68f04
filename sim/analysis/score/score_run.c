/* Points from the tables of a run. */
#include <math.h>
#include <stdio.h>

#include "sim/analysis/score/score_points.h"
#include "sim/run/run_sensors.h"

/* Columns: exposure, x, y, score, identity. Positions are
 * those in the frame: of the window, in binned pixels. */
#define IN_FRAME(x, x0) "(" x " - COALESCE(f." x0 ", 0) + 0.5) / COALESCE(f.binning, 1) - 0.5"
static const char *const point_sql[] = {
    [BST_SCORE_DETECTIONS] =
        "SELECT d.exposure_id, " IN_FRAME("d.x_px", "x0_px") ", " IN_FRAME("d.y_px", "y0_px")
        ", d.snr, -1 FROM detections d LEFT JOIN frames f USING (sensor, exposure_id) "
        "WHERE d.sensor = ?1 AND (d.label = 'object' OR (?2 AND d.label = 'unknown'))",
    [BST_SCORE_TRACKS] =
        "SELECT t.exposure_id, " IN_FRAME("t.x_px", "x0_px") ", " IN_FRAME("t.y_px", "y0_px")
        ", t.snr, t.track_id FROM tracks t LEFT JOIN frames f USING (sensor, exposure_id) "
        "WHERE t.sensor = ?1 AND t.status = 'confirmed' AND t.misses_in_row = 0",
    [BST_SCORE_TRUTH] =
        "SELECT t.exposure_id, " IN_FRAME("t.x_centroid_px", "x0_px") ", "
        IN_FRAME("t.y_centroid_px", "y0_px") ", t.snr, t.id FROM truth t LEFT JOIN frames f "
        "USING (sensor, exposure_id) WHERE t.sensor = ?1 AND t.kind = 'object' AND "
        "t.in_field = 1 AND t.occulted = 0 AND t.electrons > 0 AND t.exposure_id NOT IN "
        "(SELECT exposure_id FROM exposures WHERE sensor = ?1 AND dropped = 1)",
};
#undef IN_FRAME

/* Stands for the table frames of a run that did not record it: positions are on the sensor. */
static const char no_frames_sql[] =
    "WITH frames(sensor, exposure_id, x0_px, y0_px, binning) AS "
    "(SELECT NULL, NULL, NULL, NULL, NULL WHERE 0) ";

/* Frames with a result: a truth has all that were exposed. */
static const char *const frame_sql[] = {
    [BST_SCORE_DETECTIONS] = "SELECT exposure_id FROM detection_frames WHERE sensor = ?1",
    [BST_SCORE_TRACKS] = "SELECT exposure_id FROM track_frames WHERE sensor = ?1",
    [BST_SCORE_TRUTH] = "SELECT exposure_id FROM exposures WHERE sensor = ?1 AND dropped = 0",
};

static bst_status add_frames(bst_ctx *ctx, const bst_run_reader *run, const char *sql,
                             int64_t index, int64_t sequence, bst_score_points *points) {
    bst_io_rows *rows;
    bool more = false;
    BST_TRY(bst_io_rows_open(ctx, run, sql, index, 0, &rows));
    bst_status status = bst_io_rows_next(ctx, rows, &more);
    while (status == BST_OK && more) {
        status = bst_score_points_add_frame(ctx, points,
                                            (bst_score_key){sequence, bst_io_rows_int(rows, 0)});
        if (status == BST_OK) {
            status = bst_io_rows_next(ctx, rows, &more);
        }
    }
    bst_io_rows_close(rows);
    return status;
}

/* Adds the points of the sensor `index`; their frames are those of `sequence`. */
static bst_status add_points(bst_ctx *ctx, const bst_run_reader *run, int64_t index,
                             int64_t sequence, const bst_score_selection *selection,
                             bst_score_points *points) {
    bst_io_rows *rows;
    bool more = false;
    char sql[1000];
    bool has_frames =
        bst_run_reader_int(run, "SELECT count(*) FROM sqlite_master WHERE name = 'frames'", 0, 0) >
        0;
    snprintf(sql, sizeof sql, "%s%s", has_frames ? "" : no_frames_sql, point_sql[selection->what]);
    BST_TRY(bst_io_rows_open(ctx, run, sql, index, selection->unknown, &rows));
    bst_status status = bst_io_rows_next(ctx, rows, &more);
    while (status == BST_OK && more) {
        const bst_score_point p = {.key = {sequence, bst_io_rows_int(rows, 0)},
                                   .x_px = bst_io_rows_real(rows, 1),
                                   .y_px = bst_io_rows_real(rows, 2),
                                   .score = bst_io_rows_real(rows, 3),
                                   .id = bst_io_rows_int(rows, 4)};
        if (isfinite(p.x_px) && isfinite(p.y_px)) {
            status = bst_score_points_add(ctx, points, &p);
        }
        if (status == BST_OK) {
            status = bst_io_rows_next(ctx, rows, &more);
        }
    }
    bst_io_rows_close(rows);
    return status;
}

bst_status bst_score_points_add_run(bst_ctx *ctx, const char *folder,
                                    const bst_score_selection *selection,
                                    bst_score_points *points) {
    bst_run_reader *run;
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count = 0;
    BST_TRY(bst_run_reader_open(ctx, folder, &run));
    bst_status status = bst_run_sensors(ctx, run, selection->sensor, sensors, &count);
    for (int i = 0; status == BST_OK && i < count; i++) {
        /* one sensor of several compares with a file that names no sequence */
        int64_t index = sensors[i].index, sequence = count == 1 ? 0 : index;
        status = add_frames(ctx, run, frame_sql[selection->what], index, sequence, points);
        if (status == BST_OK) {
            status = add_points(ctx, run, index, sequence, selection, points);
        }
    }
    bst_run_reader_close(run);
    return status;
}
