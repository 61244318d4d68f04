#include "sim/analysis/calibration/calibration_frames.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/version.h"
#include "scenegen/detector/detector.h"
#include "scenegen/renderer.h"
#include "sim/cli/stop_signals.h"
#include "sim/core/draft.h"
#include "sim/core/folder.h"
#include "sim/core/text.h"
#include "sim/io/fits_frames.h"

/* One kind of calibration frames. */
typedef struct series {
    const char *name, *type; /* file name, IMAGETYP */
    int64_t count;
    double exposure_s, level_e; /* flat field: electrons per pixel of mean response */
    int64_t steps; /* exposures from 1 / steps of exposure_s on, in the same light; 0: one */
} series;

/* State of making the frames of one sensor. */
typedef struct job {
    const bst_calibration_frames *request;
    const bst_scenario *scenario;
    const bst_observer_config *observer;
    const bst_sensor_config *sensor;
    bst_device *device;
    bst_renderer *renderer;
    char name[160]; /* observer/sensor */
    double start_s; /* of the next frame: all follow one another after 1 s, for persistence */
} job;

/* Renders and writes one bias, dark or flat frame. */
static bst_status write_frame(bst_ctx *ctx, job *j, const series *s, int64_t i, bst_fits *fits) {
    const bst_camera *camera = &j->sensor->camera;
    /* of a series of exposures: two frames of each */
    double share = s->steps > 0 ? (double)(i / 2 + 1) / (double)s->steps : 1.0;
    double exposure_s = share * s->exposure_s, time_s[2] = {0.0, exposure_s};
    bst_quat q[2] = {BST_QUAT_IDENTITY, BST_QUAT_IDENTITY};
    bst_los_track track = {2, time_s, q};
    double dark_e = bst_camera_dark_e_per_s(camera) * exposure_s;
    bst_render_request request = {
        .window = {0, 0, (int)camera->width_px, (int)camera->height_px},
        .track = &track,
        .background_e = share * s->level_e + dark_e,
        .dark_e = dark_e,
        .key = bst_rng_make_key(j->scenario->seed, (uint64_t)j->scenario->run, j->name, s->type),
        .exposure_id = i,
        .start_s = j->start_s};
    bst_frame *frame;
    const uint16_t *pixels;
    BST_TRY(bst_renderer_render(ctx, j->renderer, &request, &frame));
    bst_status status = bst_frame_map(frame, ctx, &pixels);
    if (status == BST_OK) {
        bst_fits_frame head = {.id = i,
                               .start = bst_time_add(j->scenario->epoch, request.start_s),
                               .exposure_s = exposure_s,
                               .window = request.window,
                               .binning = 1,
                               .bits = (int)camera->bits};
        status = bst_fits_write(ctx, fits, &head, pixels, frame->width, frame->height, NULL);
        bst_frame_unmap(frame);
    }
    bst_frame_release(frame);
    j->start_s += exposure_s + 1.0;
    return status;
}

/* Charge of the longest exposure of the series for linearity, over what fits. */
static const double BEYOND_FULL = 1.3;

/* Draft name of a file, which is renamed when complete. */
static bst_status draft_of(bst_ctx *ctx, const char *path, char *draft, size_t bytes) {
    struct stat there;
    int fd;
    if (lstat(path, &there) == 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(EEXIST));
    }
    BST_TRY(bst_draft_make(ctx, path, draft, bytes, &fd));
    close(fd);
    unlink(draft); /* bst_fits_create requires a new name */
    return BST_OK;
}

/* Writes the FITS file of one series: bias, dark or flat. */
static bst_status write_series(bst_ctx *ctx, job *j, const series *s) {
    if (s->count == 0) {
        return BST_OK;
    }
    char path[4096], draft[4160], program[64];
    snprintf(program, sizeof program, "boresight %s", bst_version());
    snprintf(path, sizeof path, "%s/%s_%s_%s.fits", j->request->out, j->observer->name,
             j->sensor->name, s->name);
    BST_TRY(draft_of(ctx, path, draft, sizeof draft));
    bst_fits_info info = {.observer = j->observer->name,
                          .instrument = j->sensor->name,
                          .object = s->type,
                          .image_type = s->type,
                          .program = program,
                          .camera = &j->sensor->camera};
    bst_fits *fits;
    bst_status status = bst_fits_create(ctx, draft, BST_FITS_EXTENSIONS, &info, &fits);
    if (status != BST_OK) {
        unlink(draft);
        return status;
    }
    for (int64_t i = 0; status == BST_OK && i < s->count; i++) {
        status = bst_stop_requested() ? bst_fail(ctx, BST_ERR_INTERRUPTED, "interrupted")
                                      : write_frame(ctx, j, s, i, fits);
    }
    bst_status closed = bst_fits_close(ctx, fits);
    status = status == BST_OK ? closed : status;
    if (status == BST_OK && rename(draft, path) != 0) {
        status = bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
    }
    if (status != BST_OK) {
        unlink(draft);
    } else {
        printf("%s: %s of %s%g s\n", path,
               bst_text_of_count((char[BST_COUNT_TEXT]){0}, s->count, "frame", "frames"),
               s->steps > 0 ? "up to " : "", s->exposure_s);
    }
    return status;
}

/* Half of the full well or of the converter's range, whichever is smaller. */
static double half_level_e(const bst_camera *c) {
    double top_e = ((double)((1 << c->bits) - 1) - c->offset_dn) * c->gain_e_per_dn;
    return 0.5 * fmin(c->full_well_e, top_e);
}

/* Writes the calibration frames of one sensor. */
static bst_status do_sensor(bst_ctx *ctx, job *j) {
    const bst_calibration_frames *r = j->request;
    const bst_sensor_config *s = j->sensor;
    snprintf(j->name, sizeof j->name, "%s/%s", j->observer->name, s->name);
    bst_renderer_options options = bst_renderer_default_options();
    options.pattern = bst_detector_pattern_key(&s->camera, j->name);
    options.pool_frames = 2;
    /* these frames have no point sources and need no PSF */
    bst_camera camera = s->camera;
    camera.optics.psf = BST_PSF_GAUSSIAN;
    BST_TRY(bst_renderer_create(ctx, j->device, &camera, &options, &j->renderer));
    double exposure_s = r->exposure_s > 0.0 ? r->exposure_s : s->exposure.exposure_s;
    double level_e = r->level_e > 0.0 ? r->level_e : half_level_e(&s->camera);
    /* the longest exposure collects 1.3 times what fits */
    double longest = BEYOND_FULL * 2.0 * half_level_e(&s->camera) / level_e;
    const series all[] = {{"bias", "BIAS", r->bias, 0.0, 0.0, 0},
                          {"dark", "DARK", r->dark, exposure_s, 0.0, 0},
                          {"flat", "FLAT", r->flat, exposure_s, level_e, 0},
                          {"linearity", "LINEARITY", 2 * r->linearity, longest * exposure_s,
                           longest * level_e, r->linearity}};
    /* before the first file: OpenCL's compiler ends the program where it cannot write */
    bst_status status = bst_renderer_prepare(ctx, j->renderer);
    for (size_t i = 0; status == BST_OK && i < sizeof all / sizeof *all; i++) {
        status = write_series(ctx, j, &all[i]);
    }
    bst_renderer_free(j->renderer);
    return status;
}

bst_status bst_calibration_frames_make(bst_ctx *ctx, const bst_calibration_frames *r,
                                       bst_scenario *scenario) {
    bst_device *device;
    BST_TRY(bst_folder_make(ctx, r->out));
    BST_TRY(bst_device_open(ctx, r->device ? r->device : "", r->threads, &device));
    bst_status status = BST_OK;
    bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; status == BST_OK && o < scenario->observers.count; o++) {
        bst_sensor_config *sensors = observers[o].sensors.items;
        for (int s = 0; status == BST_OK && s < observers[o].sensors.count; s++) {
            job j = {.request = r,
                     .scenario = scenario,
                     .observer = &observers[o],
                     .sensor = &sensors[s],
                     .device = device};
            char name[160];
            snprintf(name, sizeof name, "%s/%s", observers[o].name, sensors[s].name);
            if (r->sensor && strcmp(r->sensor, name) != 0) {
                continue;
            }
            status = bst_camera_prepare(ctx, &sensors[s].camera);
            status = status == BST_OK ? do_sensor(ctx, &j) : status;
        }
    }
    bst_device_close(device);
    return status;
}
