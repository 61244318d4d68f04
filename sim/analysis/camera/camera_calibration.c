#include "sim/analysis/camera/camera_calibration.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "sim/analysis/camera/camera_psf.h"
#include "sim/analysis/camera/point_width.h"
#include "sim/catalogue/stars.h"
#include "sim/cli/outputs.h"
#include "sim/core/compare.h"
#include "sim/core/folder.h"
#include "sim/io/fits_reader.h"
#include "sim/run/run_observations.h"

#define Q bst_camera_calibration_request
const bst_option bst_camera_calibration_options[] = {
    {.name = "out",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, out),
     .path = BST_PATH_OUTPUT_FOLDER,
     .argument = "FOLDER",
     .doc = "folder for the results",
     .required = true},
    {.name = "sensor",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, sensor),
     .argument = "OBSERVER/SENSOR",
     .doc = "sensor of the run, if it has several"},
    {.name = "extends",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, extends),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "scenario whose camera camera.json changes"},
    {.name = "camera",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, camera),
     .argument = "POINTER",
     .doc = "place of the camera in that scenario (default: as in the run's)"},
    {.name = "psf-columns",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, psf_columns),
     .argument = "N",
     .doc = "measure the PSF at so many places along x, from the first to the last column",
     .minimum = 1,
     .maximum = BST_EFFECTIVE_PSF_NODES},
    {.name = "psf-rows",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, psf_rows),
     .argument = "N",
     .doc = "the same along y",
     .minimum = 1,
     .maximum = BST_EFFECTIVE_PSF_NODES},
    {.name = "psf-radius",
     .needs = "psf-columns|psf-rows",
     .kind = BST_OPTION_INT,
     .offset = offsetof(Q, psf_radius_px),
     .argument = "PX",
     .doc = "reach of the PSF's wings (default 12)",
     .minimum = 6,
     .maximum = 64},
    {.name = "overwrite",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(Q, overwrite),
     .doc = "replace earlier results there"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "print this"},
    {.name = NULL},
};
#undef Q

enum { MOST_WIDTHS = 2000 };
/* Stars for the width are at least this bright. */
static const double LEAST_WIDTH_SNR = 30.0;

/* What the stars of a run are read into. */
typedef struct reading {
    bst_run_reader *run;
    bst_run_scene scene;
    bst_run_sensor sensor;
    bst_camera camera;    /* of the scenario: start of the fit */
    char pointer[64];     /* place of the camera in the scenario */
    bst_stars *catalogue; /* by which the run identified them */
    double julian_year;
    bst_camera_fit_star *stars;
    int64_t *exposures, *fits_index;  /* fits_index -1: not for the width */
    int *window;                      /* first column and row of the frame, two a star */
    int count, room, frames, unknown; /* unknown: stars that the catalogue does not have */
} reading;

/* Identified stars that are neither saturated nor cut nor merged, of frames with an attitude from
 * stars. */
static const char stars_sql[] =
    "SELECT d.exposure_id, d.star_id, d.x_px, d.y_px, d.cov_xx_px2, d.cov_xy_px2, d.cov_yy_px2,"
    " d.flux_e, d.flux_sigma_e, d.snr, d.streak, f.exposure_s, f.fits_index, f.x0_px, f.y0_px,"
    " f.binning, t.attitude_q_cam_from_gcrf_x, t.attitude_q_cam_from_gcrf_y,"
    " t.attitude_q_cam_from_gcrf_z, t.attitude_q_cam_from_gcrf_w, e.velocity_bary_x_mps,"
    " e.velocity_bary_y_mps, e.velocity_bary_z_mps, e.sun_x_m, e.sun_y_m, e.sun_z_m"
    " FROM detections d JOIN frames f USING (sensor, exposure_id)"
    " JOIN track_frames t USING (sensor, exposure_id) JOIN exposures e USING (sensor, exposure_id)"
    " WHERE d.sensor = ?1 AND d.star_id > 0 AND d.stack = 0 AND t.attitude_valid"
    " AND NOT d.saturated AND NOT d.edge AND NOT d.blend AND NOT d.bloom"
    " ORDER BY d.exposure_id, d.item";

static bst_vec3 vector(const bst_io_rows *r, int column) {
    return (bst_vec3){bst_io_rows_real(r, column), bst_io_rows_real(r, column + 1),
                      bst_io_rows_real(r, column + 2)};
}

static bst_status make_room(bst_ctx *ctx, reading *d) {
    if (d->count < d->room) {
        return BST_OK;
    }
    const size_t room = d->room ? 2 * (size_t)d->room : 4096;
    bst_camera_fit_star *stars = realloc(d->stars, room * sizeof *stars);
    d->stars = stars ? stars : d->stars;
    int64_t *exposures = realloc(d->exposures, room * sizeof *exposures);
    d->exposures = exposures ? exposures : d->exposures;
    int64_t *fits = realloc(d->fits_index, room * sizeof *fits);
    d->fits_index = fits ? fits : d->fits_index;
    int *window = realloc(d->window, 2 * room * sizeof *window);
    d->window = window ? window : d->window;
    if (!stars || !exposures || !fits || !window || room > INT32_MAX / 2) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu stars", room);
    }
    d->room = (int)room;
    return BST_OK;
}

/* Adds the star of the present row. */
static bst_status add_star(bst_ctx *ctx, reading *d, const bst_io_rows *r) {
    bst_star star;
    bst_ctx quiet;
    bst_ctx_init(&quiet, NULL, NULL, BST_LOG_ERROR);
    const bst_star_epoch epoch = {d->julian_year, vector(r, 23)};
    if (bst_stars_find_seen(&quiet, d->catalogue, (uint32_t)bst_io_rows_int(r, 1), &epoch, &star) !=
        BST_OK) {
        d->unknown++;
        return BST_OK;
    }
    BST_TRY(make_room(ctx, d));
    const int i = d->count++;
    d->exposures[i] = bst_io_rows_int(r, 0);
    d->frames += i == 0 || d->exposures[i] != d->exposures[i - 1];
    const bst_quat q = {bst_io_rows_real(r, 16), bst_io_rows_real(r, 17), bst_io_rows_real(r, 18),
                        bst_io_rows_real(r, 19)};
    const bst_light light = {.velocity_mps = vector(r, 20), .sun_m = vector(r, 23)};
    const double exposure_s = bst_io_rows_real(r, 11);
    d->stars[i] =
        (bst_camera_fit_star){.frame = d->frames - 1,
                              .id = bst_io_rows_int(r, 1),
                              .cam = bst_quat_rotate(q, bst_light_apparent_star(&light, star.icrs)),
                              .x_px = bst_io_rows_real(r, 2),
                              .y_px = bst_io_rows_real(r, 3),
                              .cov_xx = bst_io_rows_real(r, 4),
                              .cov_xy = bst_io_rows_real(r, 5),
                              .cov_yy = bst_io_rows_real(r, 6),
                              .v_mag = (double)star.v_mag,
                              .b_minus_v = (double)star.b_minus_v,
                              .rate_e_per_s = bst_io_rows_real(r, 7) / exposure_s,
                              .rate_sigma_e_per_s = bst_io_rows_real(r, 8) / exposure_s};
    const bool point = !bst_io_rows_int(r, 10) && bst_io_rows_int(r, 15) <= 1 &&
                       bst_io_rows_real(r, 9) >= LEAST_WIDTH_SNR && !bst_io_rows_is_null(r, 12);
    d->fits_index[i] = point ? bst_io_rows_int(r, 12) : -1;
    d->window[2 * i] = (int)bst_io_rows_int(r, 13);
    d->window[2 * i + 1] = (int)bst_io_rows_int(r, 14);
    return BST_OK;
}

/* Opens the run and reads its stars. */
static bst_status read_run(bst_ctx *ctx, const bst_camera_calibration_request *q, const char *path,
                           reading *d) {
    BST_TRY(bst_run_reader_open(ctx, path, &d->run));
    BST_TRY(bst_run_scene_open(ctx, d->run, &d->scene));
    bst_run_sensor sensors[BST_EXPORT_SENSORS];
    int count, observer, sensor;
    BST_TRY(bst_run_sensors(ctx, d->run, q->sensor, sensors, &count));
    if (count != 1) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "%s: has %d sensors; choose one by --sensor, for example --sensor %s/%s",
                        path, count, sensors[0].observer, sensors[0].name);
    }
    d->sensor = sensors[0];
    BST_TRY(bst_run_scene_find(ctx, &d->scene, &d->sensor, &observer, &sensor));
    const bst_observer_config *observers = d->scene.scenario.observers.items;
    const bst_sensor_config *config = observers[observer].sensors.items;
    d->camera = config[sensor].camera;
    snprintf(d->pointer, sizeof d->pointer, "/observers/%d/sensors/%d/camera", observer, sensor);
    BST_TRY(bst_camera_prepare(ctx, &d->camera));
    const char *own = config[sensor].knowledge.star_catalogue;
    BST_TRY(
        bst_stars_open(ctx, *own ? own : d->scene.scenario.world.star_catalogue, &d->catalogue));
    d->julian_year = bst_time_julian_year(d->scene.scenario.epoch);
    bst_io_rows *rows;
    BST_TRY(bst_io_rows_open(ctx, d->run, stars_sql, d->sensor.index, 0, &rows));
    bst_status status = BST_OK;
    for (bool more = true; status == BST_OK && more;) {
        status = bst_io_rows_next(ctx, rows, &more);
        if (status == BST_OK && more) {
            status = add_star(ctx, d, rows);
        }
    }
    bst_io_rows_close(rows);
    if (status == BST_OK && d->unknown > 0) {
        bst_log(ctx, BST_LOG_WARNING,
                "%d of %d identified stars are not in the star catalogue now: is it another one "
                "than that of the run?",
                d->unknown, d->unknown + d->count);
    }
    return status;
}

/* ---------------------------------------------------------------- widths */

/* Fits a star in its frame; false: it does not lie wholly in it, or has no width. */
static bool width_of(const bst_fits_read_frame *frame, const bst_camera_fit_star *s,
                     const int window[2], double *fwhm_px) {
    enum { SIDE = BST_POINT_WIDTH_SIDE };
    double pixels[SIDE * SIDE];
    const double x = s->x_px - window[0], y = s->y_px - window[1];
    const int x0 = (int)lround(x) - SIDE / 2, y0 = (int)lround(y) - SIDE / 2;
    if (x0 < 0 || y0 < 0 || x0 + SIDE > frame->width || y0 + SIDE > frame->height) {
        return false;
    }
    for (int row = 0; row < SIDE; row++) {
        for (int column = 0; column < SIDE; column++) {
            pixels[row * SIDE + column] =
                frame->pixels[(size_t)(y0 + row) * (size_t)frame->width + (size_t)(x0 + column)];
        }
    }
    return bst_point_width_fit(pixels, x - x0, y - y0, fwhm_px);
}

static double median(double *values, int count) {
    qsort(values, (size_t)count, sizeof *values, bst_compare_doubles);
    return count > 0 ? 0.5 * (values[(count - 1) / 2] + values[count / 2]) : NAN;
}

/* Medians of widths; sorts `fwhm`. */
static void summarise(double *fwhm, const int *ninth, int count, bst_camera_widths *out) {
    double some[MOST_WIDTHS];
    for (int c = 0; c < 9; c++) {
        int n = 0;
        for (int i = 0; i < count; i++) {
            if (ninth[i] == c) {
                some[n++] = fwhm[i];
            }
        }
        out->ninth_px[c] = median(some, n);
    }
    out->stars = count;
    out->fwhm_px = median(fwhm, count);
    for (int i = 0; i < count; i++) {
        some[i] = fabs(fwhm[i] - out->fwhm_px);
    }
    /* of the median of normal deviates: sqrt(pi / 2) sigma / sqrt(n), sigma = 1.4826 MAD */
    out->fwhm_sigma_px = sqrt(BST_PI / 2.0) * 1.4826 * median(some, count) / sqrt(fmax(count, 1));
}

/* Measures widths of stars all over the run. */
static bst_status measure_widths(bst_ctx *ctx, const reading *d, bst_camera_widths *out) {
    *out = (bst_camera_widths){.fwhm_px = NAN, .fwhm_sigma_px = NAN};
    for (int c = 0; c < 9; c++) {
        out->ninth_px[c] = NAN;
    }
    int64_t candidates = 0, seen = 0;
    for (int i = 0; i < d->count; i++) {
        candidates += d->fits_index[i] >= 0;
    }
    if (candidates == 0) {
        return BST_OK;
    }
    char path[4096];
    bst_fits_reader *reader;
    BST_TRY(bst_run_reader_file(ctx, d->run, d->sensor.file, path, sizeof path));
    BST_TRY(bst_fits_reader_open(ctx, path, &reader));
    static double fwhm[MOST_WIDTHS];
    static int ninth[MOST_WIDTHS];
    int count = 0;
    const bool cube = bst_fits_reader_info(reader)->cube;
    int64_t loaded = -1;
    bst_fits_read_frame frame = {0};
    bst_status status = BST_OK;
    for (int i = 0; i < d->count && status == BST_OK && count < MOST_WIDTHS; i++) {
        /* evenly over the frames if there are more than are needed */
        const bool taken = d->fits_index[i] >= 0 &&
                           (seen + 1) * MOST_WIDTHS / candidates > seen * MOST_WIDTHS / candidates;
        seen += d->fits_index[i] >= 0;
        if (!taken && candidates > MOST_WIDTHS) {
            continue;
        }
        if (d->fits_index[i] < 0) {
            continue;
        }
        if (d->fits_index[i] != loaded) {
            /* extensions count from 1, planes of a cube from 0 */
            status = bst_fits_reader_frame(ctx, reader, d->fits_index[i] - !cube, &frame);
            loaded = d->fits_index[i];
        }
        if (status == BST_OK && width_of(&frame, &d->stars[i], &d->window[2 * i], &fwhm[count])) {
            const int column = (int)(3.0 * d->stars[i].x_px / (double)d->camera.width_px),
                      row = (int)(3.0 * d->stars[i].y_px / (double)d->camera.height_px);
            ninth[count++] = 3 * (row < 0   ? 0
                                  : row > 2 ? 2
                                            : row) +
                             (column < 0   ? 0
                              : column > 2 ? 2
                                           : column);
        }
    }
    bst_fits_reader_close(reader);
    if (status == BST_OK) {
        summarise(fwhm, ninth, count, out);
    }
    return status;
}

/* ---------------------------------------------------------------- the command */

static void print_figures(FILE *out, const bst_camera_figures *f) {
    const bst_camera_geometry_fit *g = &f->geometry;
    const bst_camera_distortion *k = &g->distortion, *s = &g->distortion_sigma;
    fprintf(out, "stars            %d in %d frames, %d left out\n", g->stars, g->frames,
            g->rejected);
    fprintf(out, "pixel scale      %.6f +- %.6f arcsec\n", g->pixel_scale_arcsec,
            g->pixel_scale_sigma_arcsec);
    fprintf(out, "k1, k2           %.5g +- %.2g, %.5g +- %.2g\n", k->k1, s->k1, k->k2, s->k2);
    fprintf(out, "p1, p2           %.5g +- %.2g, %.5g +- %.2g\n", k->p1, s->p1, k->p2, s->p2);
    fprintf(out, "                 the map in the field's corner +- %.4f px\n", g->corner_sigma_px);
    fprintf(out,
            "residuals        %.4f px RMS an axis, %.4f px of it beyond the centroids' noise\n",
            g->rms_px, g->scatter_px);
    if (f->widths.stars > 0) {
        fprintf(out, "FWHM             %.3f +- %.3f px, Gaussian, %d stars\n", f->widths.fwhm_px,
                f->widths.fwhm_sigma_px, f->widths.stars);
    }
    if (f->psf.value) {
        fprintf(out,
                "PSF              %d x %d nodes, %d stars, chi2 %.3f per pixel of their cores\n",
                f->psf.options.columns, f->psf.options.rows, f->psf.stars, f->psf.chi_squared);
    }
    if (f->photometry.stars > 0) {
        const bst_camera_photometry_fit *p = &f->photometry;
        fprintf(out, "zero point       V %.4f +- %.4f gives 1 electron/s\n", p->zero_point_mag,
                p->zero_point_sigma_mag);
        fprintf(out, "colour term      %.4f +- %.4f mag per mag of B-V\n", p->colour_term,
                p->colour_term_sigma);
        fprintf(out, "scatter          %.4f mag beyond the noise, %d stars, %d left out\n",
                p->scatter_mag, p->stars, p->rejected);
    }
}

/* Measures the PSF if it is asked for. One number of nodes alone: the other is 1. */
static bst_status measure_psf(bst_ctx *ctx, const bst_camera_calibration_request *q,
                              const reading *d, bst_effective_psf *out) {
    if (q->psf_columns == 0 && q->psf_rows == 0) {
        return BST_OK;
    }
    if (!d->sensor.file[0]) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the run has no frames to measure a PSF on: leave --psf-columns and "
                        "--psf-rows out, or record frames");
    }
    const bst_effective_psf_options options = {.columns = q->psf_columns ? (int)q->psf_columns : 1,
                                               .rows = q->psf_rows ? (int)q->psf_rows : 1,
                                               .half_px = (int)q->psf_radius_px};
    char path[4096];
    BST_TRY(bst_run_reader_file(ctx, d->run, d->sensor.file, path, sizeof path));
    const bst_camera_psf_stars stars = {.frames = path,
                                        .camera = &d->camera,
                                        .stars = d->stars,
                                        .fits_index = d->fits_index,
                                        .window = d->window,
                                        .count = d->count};
    return bst_camera_psf_fit(ctx, &stars, &options, out);
}

/* Fits all. */
static bst_status fit_all(bst_ctx *ctx, const bst_camera_calibration_request *q, reading *d,
                          bst_camera_figures *f) {
    BST_TRY(bst_camera_fit_geometry(ctx, &d->camera, d->stars, d->count, d->frames, &f->geometry));
    bst_ctx quiet;
    bst_ctx_init(&quiet, NULL, NULL, BST_LOG_ERROR);
    if (bst_camera_fit_photometry(&quiet, d->stars, d->count, &f->photometry) != BST_OK) {
        bst_log(ctx, BST_LOG_WARNING, "no zero point: %s", quiet.message);
        f->photometry.stars = 0;
    }
    if (d->sensor.file[0]) {
        BST_TRY(measure_widths(ctx, d, &f->widths));
    }
    return measure_psf(ctx, q, d, &f->psf);
}

/* Fits all, prints and writes it. */
static bst_status calibrate(bst_ctx *ctx, const bst_camera_calibration_request *q, reading *d,
                            FILE *out) {
    bst_camera_figures f = {.psf = {.value = NULL}};
    bst_status status = fit_all(ctx, q, d, &f);
    if (status == BST_OK) {
        status = bst_folder_make(ctx, q->out);
    }
    if (status == BST_OK) {
        bst_camera_calibration_request where = *q;
        where.camera = q->camera ? q->camera : d->pointer;
        status = bst_camera_calibration_write(ctx, &where, &d->camera, &f, d->stars, d->exposures,
                                              d->count);
    }
    if (status == BST_OK) {
        print_figures(out, &f);
    }
    bst_effective_psf_free(&f.psf);
    return status;
}

/* Checks that --camera can be a camera's place. */
static bst_status check_pointer(bst_ctx *ctx, const char *pointer) {
    int observer, sensor, end = 0;
    if (pointer &&
        (sscanf(pointer, "/observers/%4d/sensors/%4d/camera%n", &observer, &sensor, &end) != 2 ||
         end == 0 || pointer[end] != '\0')) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--camera %s: no place of a camera, such as /observers/0/sensors/1/camera",
                        pointer);
    }
    return BST_OK;
}

bst_status bst_camera_calibration_run(bst_ctx *ctx, const bst_camera_calibration_request *q,
                                      const char *run, FILE *out) {
    char path[4096];
    snprintf(path, sizeof path, "%.4000s/camera.json", q->out);
    BST_TRY(bst_outputs_refuse_earlier(ctx, path, q->overwrite));
    BST_TRY(check_pointer(ctx, q->camera));
    reading d = {0};
    bst_status status = read_run(ctx, q, run, &d);
    if (status == BST_OK) {
        status = calibrate(ctx, q, &d, out);
        status = status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", run);
    }
    bst_stars_close(d.catalogue);
    bst_run_scene_close(&d.scene);
    bst_run_reader_close(d.run);
    free(d.stars);
    free(d.exposures);
    free(d.fits_index);
    free(d.window);
    return status;
}
