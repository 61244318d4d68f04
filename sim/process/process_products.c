/* What was found, as files that others read: tables, light curves, TDM, pictures, report. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sim/core/folder.h"
#include "sim/export/export.h"
#include "sim/io/draft_file.h"
#include "sim/process/process_internal.h"
#include "sim/report/report_file.h"

/* Pictures that are written at most. */
enum { PICTURES = 50 };

/* Direction of the frame's middle and position angle of its rows. */
static void put_direction(FILE *out, bst_quat q_cam_from_gcrf) {
    bst_quat back = bst_quat_conj(q_cam_from_gcrf);
    bst_vec3 b = bst_quat_rotate(back, (bst_vec3){0, 0, 1});
    bst_vec3 up = bst_quat_rotate(back, (bst_vec3){0, -1, 0});
    double ra, dec;
    bst_vec3_to_radec(b, &ra, &dec);
    bst_vec3 east = bst_vec3_unit(bst_vec3_cross((bst_vec3){0, 0, 1}, b));
    double angle = atan2(bst_vec3_dot(up, east), bst_vec3_dot(up, bst_vec3_cross(b, east)));
    fprintf(out, "%.7f,%.7f,%.5f", ra / BST_DEG_RAD, dec / BST_DEG_RAD, angle / BST_DEG_RAD);
}

/* Writes a name as a CSV field. */
static void put_field(FILE *out, const char *text) {
    fputc('"', out);
    for (const char *c = text; *c; c++) {
        fputs(*c == '"' ? "\"\"" : (char[2]){*c, '\0'}, out);
    }
    fputc('"', out);
}

/* Path of the file with a frame's pixels: in a side table its picture. */
static const char *picture_of(bst_ctx *ctx, const bst_process *p, const bst_process_frame *f) {
    const bst_recorded_options plain = {.map = NULL};
    bst_recorded_frame r;
    return f->place.line > 0 &&
                   bst_recorded_frames_select(ctx, p->recorded, f->index, &plain, &r) == BST_OK
               ? bst_frame_source_picture(bst_recorded_frames_source(p->recorded))
               : f->path;
}

/* attitudes.csv: a row for each frame. */
static bst_status write_attitudes(bst_ctx *ctx, const bst_process *p) {
    char path[4096], utc[40];
    bst_draft draft;
    BST_TRY(bst_process_path(ctx, p, "products/attitudes.csv", path));
    BST_TRY(bst_draft_open(ctx, path, &draft));
    FILE *out = draft.stream;
    fputs(
        "frame,file,hdu,plane,start_utc,exposure_s,solved,stars_found,stars_matched,"
        "stars_predicted,rms_px,streak_px,direction_known,ra_deg,dec_deg,position_angle_deg\n",
        out);
    for (int i = 0; i < p->count; i++) {
        const bst_process_frame *f = &p->frames[i];
        bst_time_to_utc(f->values.start, 6, utc, sizeof utc);
        fprintf(out, "%d,", i);
        put_field(out, picture_of(ctx, p, f));
        fprintf(out, ",%d,%" PRId64 ",%s,%.9g,%d,%d,%d,%d,%.3f,%.2f,%d,", f->place.hdu,
                f->place.hdu > 0 ? f->place.plane + 1 : f->place.page, utc, f->values.exposure_s,
                f->solved, f->found, f->matched, f->predicted, f->rms_px, f->streak_px,
                f->node_count == 0 || p->direction_known);
        if (f->solved) {
            put_direction(out, f->q_middle);
        } else {
            fputs(",,", out);
        }
        fputc('\n', out);
    }
    return bst_draft_close(ctx, &draft, BST_OK);
}

/* Places of a star's image at the nodes of a frame, relative to its mean place. */
static void star_places(const bst_camera *camera, const bst_process_frame *f, double places[][2]) {
    double mean[2] = {0.0, 0.0};
    for (int k = 0; k < f->node_count; k++) {
        bst_quat turn = bst_quat_mul(f->nodes[k].q_cam_from_gcrf, bst_quat_conj(f->q_middle));
        (void)bst_camera_project(camera, bst_quat_rotate(turn, (bst_vec3){0, 0, 1}), &places[k][0],
                                 &places[k][1]);
        for (int c = 0; k > 0 && c < 2; c++) {
            double share = f->nodes[k].share - f->nodes[k - 1].share;
            mean[c] += 0.5 * share * (places[k][c] + places[k - 1][c]);
        }
    }
    for (int k = 0; k < f->node_count; k++) {
        places[k][0] -= mean[0];
        places[k][1] -= mean[1];
    }
}

/* paths.csv: how the image of a star at the middle of each frame moved. */
static bst_status write_paths(bst_ctx *ctx, const bst_process *p) {
    char path[4096];
    bst_draft draft;
    bst_camera camera = {
        .width_px = p->width, .height_px = p->height, .pixel_scale_arcsec = p->scale_arcsec};
    BST_TRY(bst_camera_prepare(ctx, &camera));
    BST_TRY(bst_process_path(ctx, p, "products/paths.csv", path));
    BST_TRY(bst_draft_open(ctx, path, &draft));
    fputs("frame,time_s,dx_px,dy_px\n", draft.stream);
    for (int i = 0; i < p->count; i++) {
        const bst_process_frame *f = &p->frames[i];
        double places[BST_PROCESS_NODES + 2][2];
        star_places(&camera, f, places);
        for (int k = 0; k < f->node_count; k++) {
            fprintf(draft.stream, "%d,%.6f,%.3f,%.3f\n", i,
                    f->nodes[k].share * f->values.exposure_s, places[k][0], places[k][1]);
        }
    }
    return bst_draft_close(ctx, &draft, BST_OK);
}

/* Detections of tracks and of identified stars, by source and time. */
static const char light_curves_sql[] =
    "SELECT 'star', d.star_id, utc(d.mid_s), d.exposure_id, d.v_mag, d.v_mag_sigma, d.flux_e,"
    " d.flux_sigma_e, d.snr, d.x_px, d.y_px FROM detections d WHERE d.star_id > 0 UNION ALL"
    " SELECT 'track', t.track_id, utc(d.mid_s), d.exposure_id, d.v_mag, d.v_mag_sigma, d.flux_e,"
    " d.flux_sigma_e, d.snr, d.x_px, d.y_px FROM tracks t JOIN detections d USING (sensor,"
    " exposure_id) WHERE t.status = 'confirmed' AND t.misses_in_row = 0"
    " AND abs(d.x_px - t.x_px) < 1e-6 AND abs(d.y_px - t.y_px) < 1e-6 ORDER BY 1 DESC, 2, 4";

/* light_curves.csv: magnitudes of stars and confirmed tracks against time. */
static bst_status write_light_curves(bst_ctx *ctx, const bst_process *p,
                                     const bst_run_reader *run) {
    char path[4096];
    bst_draft draft;
    bst_io_rows *rows;
    BST_TRY(bst_process_path(ctx, p, "products/light_curves.csv", path));
    BST_TRY(bst_io_rows_open(ctx, run, light_curves_sql, 0, 0, &rows));
    bst_status status = bst_draft_open(ctx, path, &draft);
    if (status != BST_OK) {
        bst_io_rows_close(rows);
        return status;
    }
    fputs("source,id,mid_utc,frame,v_mag,v_mag_sigma,flux_e,flux_sigma_e,snr,x_px,y_px\n",
          draft.stream);
    bool more = true;
    while (status == BST_OK && (status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more) {
        fprintf(draft.stream, "%s,", bst_io_rows_text(rows, 0));
        fprintf(draft.stream, "%" PRId64 ",", bst_io_rows_int(rows, 1));
        fprintf(draft.stream, "%s,%" PRId64, bst_io_rows_text(rows, 2), bst_io_rows_int(rows, 3));
        for (int c = 4; c < 11; c++) {
            if (bst_io_rows_is_null(rows, c)) {
                fputc(',', draft.stream);
            } else {
                fprintf(draft.stream, ",%.6g", bst_io_rows_real(rows, c));
            }
        }
        fputc('\n', draft.stream);
    }
    bst_io_rows_close(rows);
    return bst_draft_close(ctx, &draft, status);
}

/* Annotated pictures, tables as CSV, and the angles of confirmed tracks. */
static bst_status write_exports(bst_ctx *ctx, const bst_process *p, const bst_run_reader *run) {
    char folder[4096];
    BST_TRY(bst_process_path(ctx, p, "products", folder));
    bst_export_parts parts = {.e = {.run = run,
                                    .last = p->count,
                                    .every = 1 + (p->count - 1) / PICTURES,
                                    .annotate = true,
                                    .frame_rate = 10.0,
                                    .image_bits = 16},
                              .out = folder,
                              .frames = 0,
                              .table = 0,
                              .orbits = BST_EXPORT_NOT,
                              .observations = BST_EXPORT_NOT};
    BST_TRY(bst_export_run(ctx, &parts));
    parts.frames = parts.table = BST_EXPORT_NOT;
    parts.observations = BST_OBSERVATIONS_TDM;
    parts.e.observation_format = BST_OBSERVATIONS_TDM;
    bst_ctx unheard = {0};
    bst_status status = bst_export_run(&unheard, &parts);
    if (status == BST_ERR_NOT_FOUND) {
        printf("no confirmed track: no observations.tdm\n");
        return BST_OK;
    }
    return status == BST_OK ? BST_OK : bst_fail(ctx, status, "%s", unheard.message);
}

bst_status bst_process_write_products(bst_ctx *ctx, const bst_process *p) {
    char folder[4096], path[4096], page[4096];
    bst_run_reader *run = NULL;
    bool damaged = false;
    BST_TRY(bst_process_path(ctx, p, "run", folder));
    BST_TRY(bst_process_path(ctx, p, "products", path));
    BST_TRY(bst_folder_make(ctx, path));
    BST_TRY(write_attitudes(ctx, p));
    BST_TRY(write_paths(ctx, p));
    BST_TRY(bst_run_reader_open(ctx, folder, &run));
    bst_status status = write_light_curves(ctx, p, run);
    if (status == BST_OK) {
        status = write_exports(ctx, p, run);
    }
    bst_run_reader_close(run);
    BST_TRY(status);
    BST_TRY(bst_process_path(ctx, p, "report.html", path));
    BST_TRY(bst_report_write(ctx, folder, path, page, &damaged));
    printf("%s\n", page);
    return BST_OK;
}
